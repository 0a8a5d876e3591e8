"""Writing joints and campaigns as CSV or Parquet."""

import csv
import io
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from jaxtyping import Float

from taskcal.arguments import checked
from taskcal.campaigns.campaign import Campaign
from taskcal.geometry import se3
from taskcal.io.files import write_whole
from taskcal.observations import pictures_of
from taskcal.observations.base import written
from taskcal.reading.pictures import Corners, stem_of, tabulate_corners
from taskcal.reading.readings import Readings
from taskcal.robot.robot import Robot
from taskcal.tables.parquet import parquet_of

Columns = dict[str, list[str]]
"""Cells as text, by the names of their columns."""


@checked
def write_campaign(path: str | Path, campaign: Campaign, robot: Robot) -> None:
    """Write a campaign that `read_campaign` reads back: millimetres and degrees, lost beams empty.

    Args:
        path: of the file; as Parquet where it ends in ``.parquet``, as CSV otherwise.
        campaign: the measurements.
        robot: whose joints they are.

    Raises:
        FileError: the folder is missing or not writable.
        TaskcalError: it is to be Parquet, and pyarrow is not installed.
    """
    text = campaign_text(campaign, robot)
    write_whole(path, as_parquet(text) if Path(path).suffix.lower() == ".parquet" else text)


def campaign_text(campaign: Campaign, robot: Robot) -> str:
    """Text of the file that `write_campaign` writes."""
    columns: Columns = {"id": list(campaign.ids), **_joint_columns(campaign.q, robot)}
    if (stations := campaign.stations) is not None:
        columns["station"] = [stations.names[k] for k in stations.of]
        campaign = campaign.carried(np.tile(np.eye(4), (len(stations.names), 1, 1)))
    for t, name in enumerate(campaign.targets):
        own = campaign.observations[t].cells(campaign.read(t))
        columns |= _position(_prefix(name), campaign.points[:, t]) if own is None else own
        if campaign.uncertainty is not None:
            columns[f"{_prefix(name)}u_mm"] = written(campaign.uncertainty[:, t] * 1e3)
    if campaign.rotations is not None and all(one.in_tracker for one in campaign.observations if one.width == 6):
        columns |= _quaternion("", campaign.rotations)
    for name, points in campaign.reference_points.items():
        columns |= _position(f"{name}_", points)
    if campaign.temperature is not None:
        columns["temp_C"] = written(campaign.temperature, 3)
    if campaign.time is not None:
        columns["time_s"] = written(campaign.time, 3)
    if campaign.approach is not None:
        ways = zip(robot.joint_names, campaign.approach.T, strict=True)
        columns |= {f"{name}_approach": written(way, 0) for name, way in ways}
    if campaign.move is not None:
        columns |= _joint_columns(campaign.move, robot, "_move")
    return _table(columns)


def as_parquet(text: str) -> bytes:
    """The table of `campaign_text` or `readings_text` as a Parquet file, with the same columns, in groups of rows.

    Raises:
        TaskcalError: pyarrow is not installed.
    """
    header, *rows = csv.reader(io.StringIO(text))
    return parquet_of(header, rows)


def readings_text(readings: Readings, robot: Robot) -> str:
    """Readings of joints only, or points only, as plain CSV: millimetres and degrees, lost beams empty.

    Args:
        readings: in radians and metres.
        robot: whose joints they are.
    """
    ids = readings.ids or tuple(str(number) for number in range(1, len(readings) + 1))
    columns: Columns = {"id": list(ids)}
    if readings.stations is not None:
        columns["station"] = list(readings.stations)
    if readings.q is not None:
        columns |= _joint_columns(readings.q, robot)
    for name, points in readings.points.items():
        columns |= _position(_prefix(name), points)
    for name, uncertainty in readings.uncertainty.items():
        columns[f"{name}_u_mm" if name else "u_mm"] = written(uncertainty * 1e3)
    for name, rotations in readings.rotations.items():
        columns |= _quaternion(f"{name}_" if name and len(readings.points) > 1 else "", rotations)
    if (observed := readings.observed) is not None:
        columns |= {observed.headers[name]: list(texts) for name, texts in observed.cells.items()}
    return _table(columns)


@checked
def write_joints(path: str | Path, q: Float[np.ndarray, "n joints"], robot: Robot) -> None:
    """Write joint positions to be measured: ``id`` and a column for each joint.

    Raises:
        WrongValue: they are of another number of joints.
        FileError: the folder is missing or not writable.
    """
    robot.check_shape(q)
    write_whole(path, joints_text(q, robot))


def joints_text(q: Float[np.ndarray, "n joints"], robot: Robot, more: Mapping[str, Sequence[str]] | None = None) -> str:
    """Text of the file that `write_joints` writes, with more columns after the joints."""
    ids = [str(i) for i in range(len(q))]
    own = {name: list(cells) for name, cells in (more or {}).items()}
    return _table({"id": ids, **_joint_columns(q, robot), **own})


def corners_text(corners: Sequence[Corners]) -> str:
    """Text of a file of corners, which ``--images`` reads."""
    return _table(tabulate_corners(corners))


def pictured_text(campaign: Campaign, corners: Sequence[Corners], robot: Robot) -> str:
    """Text of a campaign of images: the corners of each image that a row shows, with the joints of the row.

    Args:
        campaign: of images, as it is read with the corners.
        corners: in the images of each camera.
        robot: whose joints they are.
    """
    kind = pictures_of(campaign.observations)
    assert kind is not None
    assert kind.of is not None
    cells, name_of = tabulate_corners(corners), str if len(corners) == 1 else stem_of
    rows = {name_of(kind.images[k]): row for row, k in enumerate(kind.of) if k >= 0}
    named = [name_of(name) for name in cells["image"]]
    own = [n for n, name in enumerate(named) if name in rows]
    which = [rows[named[n]] for n in own]
    seen = {name: [column[n] for n in own] for name, column in cells.items()}
    return _table({**seen, **_joint_columns(campaign.q[which], robot)})


def _prefix(target: str) -> str:
    return "" if target == "tool" else f"{target}_"


def _joint_columns(q: np.ndarray, robot: Robot, kind: str = "") -> Columns:
    units = [("mm", 1e3) if slides else ("deg", 180 / np.pi) for slides in robot.prismatic]
    return {
        f"{name}{kind}_{unit}": written(values * scale, 9)
        for name, (unit, scale), values in zip(robot.column_names, units, q.T, strict=True)
    }


def _position(prefix: str, points: Float[np.ndarray, "n 3"]) -> Columns:
    return {f"{prefix}{axis}_mm": written(points[:, k] * 1e3) for k, axis in enumerate("xyz")}


def _quaternion(prefix: str, rotations: Float[np.ndarray, "n 3 3"]) -> Columns:
    quaternion = se3.to_quaternion(rotations)
    return {f"{prefix}q{part}": written(quaternion[:, k], 10) for k, part in enumerate("xyzw")}


def _table(columns: Columns) -> str:
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows(zip(*columns.values(), strict=True))
    return out.getvalue()
