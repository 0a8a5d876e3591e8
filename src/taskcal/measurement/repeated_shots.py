"""Shots of one pose, averaged."""

from dataclasses import replace

import numpy as np
from jaxtyping import Float

from taskcal.errors import FileError, shown
from taskcal.geometry import se3
from taskcal.measurement.readings import Readings
from taskcal.tabular.faults import Faults

SAME_POSE_RAD = 1e-4
"""Largest difference of joints, radians or metres, of one pose: what a controller reports of a robot at rest."""


def average_shots(readings: Readings) -> Readings:
    """Readings with one row for each id: rows of one id are shots of one pose, and their positions and rotations are averaged.

    The scatter of the shots about their means is noted.

    Raises:
        FileError: rows of one id have different joints.
    """
    if readings.ids is None or len(set(readings.ids)) == len(readings.ids):
        return readings
    groups = rows_by_id(readings.ids)
    numbers = {name: pose for pose, name in enumerate(groups)}
    pose_of = [numbers[name] for name in readings.ids]
    refuse_other_joints(readings, groups)
    points = {
        name: np.stack([mean_of_seen(values[rows]) for rows in groups.values()])
        for name, values in readings.points.items()
    }
    first = readings.take(np.array([rows[0] for rows in groups.values()]))

    def mean_rotations(R: Float[np.ndarray, "n 3 3"]) -> Float[np.ndarray, "poses 3 3"]:
        sums = np.zeros((len(groups), 3, 3))
        np.add.at(sums, pose_of, R)
        return se3.nearest_rotation(sums)

    turned, angles = readings.rotations, readings.open_angles
    most = max(len(rows) for rows in groups.values())
    note = f"{len(readings)} rows are {len(groups)} poses measured up to {most} times, and averaged"
    if readings.length_unit_stated:
        note += f"; the shots scatter by {_scatter(readings, groups) * 1e3:.4f} mm per axis"
    return replace(
        first,
        points=points,
        rotations=None if turned is None else mean_rotations(turned),
        other_rotations={name: mean_rotations(R) for name, R in readings.other_rotations.items()},
        open_angles=None if angles is None else angles.mapped(mean_rotations),
        notes=(*readings.notes, note),
    )


def rows_by_id(ids: tuple[str, ...]) -> dict[str, list[int]]:
    """The rows of each id, in the order in which the ids come first."""
    groups: dict[str, list[int]] = {}
    for row, name in enumerate(ids):
        groups.setdefault(name, []).append(row)
    return groups


def refuse_other_joints(readings: Readings, groups: dict[str, list[int]]) -> None:
    """See that rows of one id are of one pose.

    Raises:
        FileError: some have different joints.
    """
    if readings.q is None:
        return
    faults = Faults()
    for name, rows in groups.items():
        for row in rows[1:]:
            if np.abs(readings.q[row] - readings.q[rows[0]]).max() > SAME_POSE_RAD:
                line = int(readings.lines[rows[0]])
                message = f"id '{shown(name)}' stands in line {line} already; give each row its own"
                with faults.collecting():
                    raise FileError(readings.path, message, line=int(readings.lines[row]), column="id")
    faults.raise_any()


def mean_of_seen(points: Float[np.ndarray, "shots 3"]) -> Float[np.ndarray, "3"]:
    """Mean of the shots that saw the target; NaN where none did."""
    seen = points[~np.isnan(points[:, 0])]
    return seen.mean(axis=0) if len(seen) else np.full(3, np.nan)


def _scatter(readings: Readings, groups: dict[str, list[int]]) -> float:
    """Pooled standard deviation of shots about their means, per axis, metres."""
    squares, freedom = 0.0, 0
    for values in readings.points.values():
        for rows in groups.values():
            seen = values[rows][~np.isnan(values[rows][:, 0])]
            if len(seen) > 1:
                squares += float(np.sum((seen - seen.mean(axis=0)) ** 2))
                freedom += 3 * (len(seen) - 1)
    return float(np.sqrt(squares / freedom)) if freedom else 0.0
