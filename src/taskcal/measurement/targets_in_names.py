"""Targets that stand behind the name of the pose, as in ``P12_T1``: one target a row without a column that says so."""

from dataclasses import replace

import numpy as np

from taskcal.measurement.readings import Readings
from taskcal.measurement.repeated_shots import SAME_POSE_RAD
from taskcal.measurement.target_names import split_names

_APART = 3e-3
"""Least distance of two targets over the scatter of all points: shots of one target are nearer."""


def with_targets_in_names(readings: Readings) -> Readings:
    """Readings that say whose position each row holds, where the ids of rows do; a note says so.

    Rows of one pose must have the same joints and points apart, which shots of one target have not.
    """
    if readings.targets_by_row is not None or readings.q is None or readings.ids is None or len(readings.points) != 1:
        return readings
    split = split_names(readings.ids)
    if split is None:
        return readings
    poses, targets = split
    rows: dict[str, list[int]] = {}
    for row, pose in enumerate(poses):
        rows.setdefault(pose, []).append(row)
    (points,) = readings.points.values()
    moved = max(float(np.ptp(readings.q[at], axis=0).max()) for at in rows.values())
    apart = [float(np.linalg.norm(np.ptp(points[at], axis=0))) for at in rows.values() if len(at) > 1]
    if moved > SAME_POSE_RAD or not np.nanmedian(apart) > _APART * np.linalg.norm(np.nanstd(points, axis=0)):
        return readings
    note = f"ids such as '{readings.ids[0]}' are read as pose '{poses[0]}' and target '{targets[0]}'"
    return replace(readings, ids=poses, targets_by_row=targets, notes=(*readings.notes, note))
