"""Writing joints and campaigns as CSV or Parquet."""

import csv
import io
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from jaxtyping import Float

from taskcal.campaigns.campaign import Campaign
from taskcal.geometry import se3
from taskcal.io.files import write_whole
from taskcal.reading.readings import Readings
from taskcal.robot.robot import Robot
from taskcal.tables.parquet import parquet_of


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
    header, columns = _joint_columns(campaign.q, robot)
    for t, name in enumerate(campaign.targets):
        prefix = "" if name == "tool" else f"{name}_"
        own = campaign.observations[t].cells(campaign.read(t)) if campaign.observations else None
        for column, texts in (own or {}).items():
            header.append(column)
            columns.append(texts)
        for axis in range(3) if own is None else ():
            header.append(f"{prefix}{'xyz'[axis]}_mm")
            columns.append(_texts(campaign.points[:, t, axis] * 1e3, 6))
        if campaign.uncertainty is not None:
            header.append(f"{prefix}u_mm")
            columns.append(_texts(campaign.uncertainty[:, t] * 1e3, 6))
    if campaign.rotations is not None and all(one.in_tracker for one in campaign.observations if one.width == 6):
        quaternion = se3.to_quaternion(campaign.rotations)
        for k, name in enumerate(("qx", "qy", "qz", "qw")):
            header.append(name)
            columns.append(_texts(quaternion[:, k], 10))
    for name, points in campaign.reference_points.items():
        for axis in range(3):
            header.append(f"{name}_{'xyz'[axis]}_mm")
            columns.append(_texts(points[:, axis] * 1e3, 6))
    if campaign.temperature is not None:
        header.append("temp_C")
        columns.append(_texts(campaign.temperature, 3))
    if campaign.time is not None:
        header.append("time_s")
        columns.append(_texts(campaign.time, 3))
    if campaign.approach is not None:
        header += [f"{name}_approach" for name in robot.joint_names]
        columns += [_texts(campaign.approach[:, j], 0) for j in range(len(robot.joints))]
    if campaign.move is not None:
        more, moved = _joint_columns(campaign.move, robot, "_move")
        header, columns = header + more, columns + moved
    return _table(["id", *header], [list(campaign.ids), *columns])


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
    header: list[str] = []
    columns: list[list[str]] = []
    if readings.q is not None:
        header, columns = _joint_columns(readings.q, robot)
    for name, points in readings.points.items():
        prefix = "" if name == "tool" else f"{name}_"
        for axis in range(3):
            header.append(f"{prefix}{'xyz'[axis]}_mm")
            columns.append(_texts(points[:, axis] * 1e3, 6))
    for name, uncertainty in readings.uncertainty.items():
        header.append(f"{name}_u_mm" if name else "u_mm")
        columns.append(_texts(uncertainty * 1e3, 6))
    for name, rotations in readings.rotations.items():
        prefix = f"{name}_" if name and len(readings.points) > 1 else ""
        quaternion = se3.to_quaternion(rotations)
        header += [f"{prefix}q{part}" for part in "xyzw"]
        columns += [_texts(quaternion[:, k], 10) for k in range(4)]
    if readings.observed is not None:
        header += list(readings.observed.headers.values())
        columns += [list(texts) for texts in readings.observed.cells.values()]
    ids = readings.ids or tuple(str(number) for number in range(1, len(readings) + 1))
    return _table(["id", *header], [list(ids), *columns])


def write_joints(path: str | Path, q: Float[np.ndarray, "n joints"], robot: Robot) -> None:
    """Write joint positions to be measured: ``id`` and a column for each joint.

    Raises:
        FileError: the folder is missing or not writable.
    """
    write_whole(path, joints_text(q, robot))


def joints_text(q: Float[np.ndarray, "n joints"], robot: Robot, more: Mapping[str, Sequence[str]] | None = None) -> str:
    """Text of the file that `write_joints` writes, with more columns after the joints."""
    header, columns = _joint_columns(q, robot)
    own = more or {}
    return _table(["id", *header, *own], [[str(i) for i in range(len(q))], *columns, *map(list, own.values())])


def _joint_columns(q: np.ndarray, robot: Robot, kind: str = "") -> tuple[list[str], list[list[str]]]:
    header = [
        f"{name}{kind}_{'mm' if slides else 'deg'}"
        for name, slides in zip(robot.joint_names, robot.prismatic, strict=True)
    ]
    scale = np.where(robot.prismatic, 1e3, 180 / np.pi)
    return header, [_texts(q[:, j] * scale[j], 9) for j in range(q.shape[1])]


def _texts(values: np.ndarray, decimals: int) -> list[str]:
    return ["" if np.isnan(v) else f"{v:.{decimals}f}" for v in values]


def _table(header: list[str], columns: list[list[str]]) -> str:
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(header)
    writer.writerows(zip(*columns, strict=True))
    return out.getvalue()
