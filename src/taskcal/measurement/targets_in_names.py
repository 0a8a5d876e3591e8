"""Targets without a column that says so: behind the name of the pose, as in ``P12_T1``, or as points of a group."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float

from taskcal.errors import FileError, shown
from taskcal.measurement.readings import Readings
from taskcal.measurement.repeated_shots import SAME_POSE_RAD, rows_by_id
from taskcal.measurement.target_names import MOST_TARGETS, each_in_most, parts_of_names, split_names

_APART = 3e-3
"""Least distance of two targets over the scatter of all points: shots of one target are nearer. As much, the distance of two
targets on one tool may change from pose to pose."""


def with_targets_in_names(readings: Readings) -> Readings:
    """Readings that say whose position each row holds, where the ids of rows do; a note says so.

    Rows of one pose must have the same joints and points apart, which shots of one target have not.

    Raises:
        FileError: points stand in groups, and either may be the pose.
    """
    readings = _with_groups(readings)
    if readings.groups is not None:
        readings = replace(_of_groups(readings, readings.groups), groups=None)
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


def _with_groups(readings: Readings) -> Readings:
    """Readings whose ids such as ``Collection::Group::P1`` are parted into the group and the point."""
    if readings.groups is not None or readings.ids is None or (parts := parts_of_names(readings.ids)) is None:
        return readings
    groups, names = parts
    within = "" if groups is None else f" of group '{shown(groups[0], 40)}'"
    note = f"names such as '{shown(readings.ids[0], 60)}' are read as '{shown(names[0], 40)}'{within}"
    return replace(readings, ids=names, groups=groups, notes=(*readings.notes, note))


def _of_groups(readings: Readings, groups: tuple[str, ...]) -> Readings:
    """Readings with the pose of each row as its id, and its target, of points in groups.

    Names that all differ are poses. Otherwise the group is the pose and the point its target, or the point is the pose and the
    group its target: which of them, joints tell that are the same in a pose, or else distances of targets that are the same in all.
    Rows that lie together are shots. Where neither holds, every row is a pose of its own.

    Raises:
        FileError: either may be the pose.
    """
    names = readings.ids
    if names is None or len(set(names)) == len(names) or readings.targets_by_row is not None:
        return readings
    if len(set(names)) == 1:
        return replace(readings, ids=groups)
    line = f"group '{shown(groups[0], 40)}' and point '{shown(names[0], 40)}' (line {int(readings.lines[0])})"
    joined = tuple(f"{group} {name}" for group, name in zip(groups, names, strict=True))
    each = f"{line}: each group and point is read as a pose of its own"
    forms = [
        (poses, targets, word)
        for poses, targets, word in ((names, groups, "the point"), (groups, names, "the group"))
        if _of_same_joints(readings, poses)
    ]
    if len(readings.points) != 1:
        of_joints = len(forms) == 1 and readings.q is not None
        return replace(
            readings, ids=forms[0][0] if of_joints else joined, notes=(*readings.notes, *([] if of_joints else [each]))
        )
    (points,) = readings.points.values()
    for poses, _, word in forms:
        if len(set(poses)) > 1 and _lie_together(points, poses):
            note = f"{line}: {word} is read as the pose, and its rows as shots of it, which lie together"
            return replace(readings, ids=poses, notes=(*readings.notes, note))
    forms = [form for form in forms if 2 <= len(set(form[1])) <= MOST_TARGETS and 1 < len(set(form[0])) < len(names)]
    usual = [form for form in forms if each_in_most(form[0], form[1])]
    if readings.q is None or len(usual) != 1:
        kept = [form for form in forms if _keep_distances(points, form[0], form[1])]
        usual = kept if len(kept) == 1 else [form for form in usual if form in kept]
        if len(usual) != 1 and (kept or len(set(groups)) == len(groups)):
            remedy = "name the column of poses 'id', that of targets 'target'"
            message = f"{line}: either may be the pose, the other its target; {remedy}"
            raise FileError(readings.path, message, line=int(readings.lines[0]))
    if not usual:
        return replace(readings, ids=joined, notes=(*readings.notes, each))
    poses, targets, word = usual[0]
    why = "distances of targets are the same in all poses" if readings.q is None else "joints are the same in each pose"
    note = f"{line}: {word} is read as the pose, the other as its target, since {why}"
    return replace(readings, ids=poses, targets_by_row=targets, notes=(*readings.notes, note))


def _of_same_joints(readings: Readings, poses: Sequence[str]) -> bool:
    """Whether rows of one pose have the same joints; true where there are none."""
    if readings.q is None:
        return True
    most = SAME_POSE_RAD if readings.joint_unit_stated else np.degrees(SAME_POSE_RAD)
    return all(np.ptp(readings.q[rows], axis=0).max() <= most for rows in rows_by_id(tuple(poses)).values())


def _scatter(points: Float[np.ndarray, "n 3"]) -> float:
    return float(np.linalg.norm(np.nanstd(points, axis=0))) if not np.isnan(points).all() else 0.0


def _lie_together(points: Float[np.ndarray, "n 3"], poses: Sequence[str]) -> bool:
    """Whether the rows of most poses are nearer than two targets."""
    several = [seen for rows in rows_by_id(tuple(poses)).values() if len(seen := _seen(points[rows])) > 1]
    apart = [float(np.linalg.norm(np.ptp(seen, axis=0))) for seen in several]
    return bool(apart) and float(np.median(apart)) < _APART * _scatter(points)


def _seen(points: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "k 3"]:
    return points[~np.isnan(points[:, 0])]


def _keep_distances(points: Float[np.ndarray, "n 3"], poses: Sequence[str], targets: Sequence[str]) -> bool:
    """Whether targets are as far from one another in most poses, as on one tool; one that stands still is beside the robot."""
    limit = _APART * _scatter(points)
    numbers = {name: k for k, name in enumerate(dict.fromkeys(poses))}
    place = {name: np.full((len(numbers), 3), np.nan) for name in dict.fromkeys(targets)}
    for row, (pose, target) in enumerate(zip(poses, targets, strict=True)):
        place[target][numbers[pose]] = points[row]
    moving = [at for at in place.values() if _scatter(at) > limit]
    changes: list[float] = []
    for k, one in enumerate(moving):
        for other in moving[:k]:
            distance = np.linalg.norm(one - other, axis=1)
            distance = distance[~np.isnan(distance)]
            if len(distance) > 1:
                changes += np.abs(distance - np.median(distance)).tolist()
    if not changes:
        return len(moving) == 1 < len(place)
    return float(np.median(changes)) < limit
