"""Tables with one target a row, made into tables with one pose a row."""

from dataclasses import replace

import numpy as np

from taskcal.errors import FileError, shown
from taskcal.measurement.readings import Readings
from taskcal.measurement.repeated_shots import (
    SAME_POSE_RAD,
    mean_of_seen,
    refuse_other_joints,
    refuse_two_poses,
    rows_by_id,
)
from taskcal.measurement.target_columns import MAX_TARGETS

_NO_NAME = frozenset({"", "nan", "none", "null", "nil", "n/a", "na", "#n/a", "-", "?"})
"""What programs write where there is no text."""


def side_by_side(readings: Readings, metres: float = 1e-3) -> Readings:
    """One row for each pose, with the position of every target.

    Rows of one id are one pose; where no id stands twice, or there are none, successive rows of the same joints. Shots of
    one target in one pose are averaged.

    Args:
        readings: one row for each target of a pose.
        metres: as of `average_shots`.

    Raises:
        FileError: a row names no target, rows of one id have different joints, shots of one target in one pose are too far
            apart, or columns name a target, too, which is not that of every row.
    """
    targets = readings.targets_by_row
    assert targets is not None
    for row, name in enumerate(targets):
        if name.casefold() in _NO_NAME:
            raise FileError(readings.path, "the row names no target", line=int(readings.lines[row]), column="target")
    named = set(readings.points)
    # a column of another name, such as 'measured_x', says nothing about which target it is
    if len(named) != 1 or (named & set(targets) and named != set(targets)):
        message = f"names a target in each row and in columns too ({shown(', '.join(readings.points))}); keep one form"
        raise FileError(readings.path, message, line=1)
    if readings.rotations is not None and len(set(targets)) > 1:
        raise FileError(readings.path, "has poses of several targets; choose the rows of one", line=1)
    (values,) = readings.points.values()
    if (count := len(set(targets))) > MAX_TARGETS:
        message = f"names {count} targets; Taskcal fits {MAX_TARGETS} at most: leave the rows of the others out"
        raise FileError(readings.path, message, line=1, column="target")
    pose_of = _poses(readings)
    firsts = np.unique(pose_of, return_index=True)[1]
    points = {name: np.full((len(firsts), 3), np.nan) for name in dict.fromkeys(targets)}
    shots: dict[tuple[str, int], list[int]] = {}
    for row, shown_in in enumerate(zip(targets, pose_of.tolist(), strict=True)):
        shots.setdefault(shown_in, []).append(row)
    for target in points:
        of_poses = {_pose_name(readings, rows[0]): rows for (name, _), rows in shots.items() if name == target}
        refuse_two_poses(readings, target, values, of_poses, metres)
    for (name, pose), rows in shots.items():
        points[name][pose] = mean_of_seen(values[rows])
    return replace(readings.take(firsts), points=points, targets_by_row=None)


def _pose_name(readings: Readings, row: int) -> str:
    """How an error names the pose of a row, and its target."""
    targets = readings.targets_by_row or ()
    return f"{readings.ids[row] if readings.ids else int(readings.lines[row])}, target {targets[row]}"


def _poses(readings: Readings) -> np.ndarray:
    """Number of each row's pose."""
    ids, targets = readings.ids, readings.targets_by_row or ()
    each_its_own = ids is not None and len(set(ids)) == len(ids) and len(set(targets)) > 1
    if ids is not None and not (each_its_own and readings.q is not None):
        refuse_other_joints(readings, rows_by_id(ids))
        numbers = {name: k for k, name in enumerate(dict.fromkeys(ids))}
        return np.array([numbers[name] for name in ids])
    if readings.q is None:
        raise FileError(
            readings.path, "has rows of several targets, and neither ids nor joints say which belong together"
        )
    moved = np.abs(np.diff(readings.q, axis=0)).max(axis=1) > SAME_POSE_RAD
    return np.concatenate([[0], np.cumsum(moved)])
