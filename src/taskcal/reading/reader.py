"""Reading a campaign, whatever instrument or spreadsheet wrote it."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float

from taskcal.arguments import expect_kinds
from taskcal.campaigns.campaign import Campaign
from taskcal.errors import Faults, FileError, shown
from taskcal.geometry import se3
from taskcal.observations import Point, Pose, Read, kinds
from taskcal.observations.base import TrackerNoise
from taskcal.reading.columns import (
    ANGLES,
    FARTHEST,
    LENGTHS,
    MOST_TARGETS,
    StatedUnits,
    each_in_most,
    parts_of_names,
    split_names,
    stated_units,
)
from taskcal.reading.inference import with_convention
from taskcal.reading.readings import MAX_TARGETS, AngleForm, Readings, read_readings
from taskcal.reading.stated_scale import with_distances, with_unknown_scale
from taskcal.robot.conditions import Conditions, conditions_in_order
from taskcal.robot.robot import Robot
from taskcal.tables.forms import TableForm

# How each row of a campaign was reached, as its file tells.

_COUNT = re.compile(r"[0-9]{1,15}")


def recorded_ways(readings: Readings, robot: Robot, q: np.ndarray) -> Conditions:
    """How each row was reached: by columns, or else by the order of the rows."""
    if readings.approach is None and readings.move is None:
        return conditions_in_order(robot, q, _follows(readings.ids))
    approach = readings.approach
    if approach is None and readings.move is not None:
        approach = np.sign(readings.move)
    return Conditions(approach=approach, move=readings.move)


def _follows(ids: tuple[str, ...] | None) -> Bool[np.ndarray, " n"] | None:
    """Whether each row was measured after the one before it, as far as ids that count tell."""
    if ids is None or len(ids) < 3 or not all(_COUNT.fullmatch(text) for text in ids):
        return None
    steps = np.diff([int(text) for text in ids])
    return None if steps.min() <= 0 else np.concatenate([[False], steps <= np.median(steps)])


# Shots of one pose, averaged.

SAME_POSE_RAD = 1e-4
"""Largest difference of joints, radians or metres, of one pose: what a controller reports of a robot at rest."""

RETURN_M = 1e-3
"""Distance of two returns to one pose, metres. Data sheets of industrial robots state a repeatability (ISO 9283:1998, RP) of 0.02
to 0.5 mm: a radius about the mean, so that two returns are up to twice as far apart."""

SIGMAS = 10.0
"""Standard uncertainties of a coordinate between two shots of one pose. The distance of two shots is √2 times a Maxwell variable:
beyond ten in fewer than one of a thousand million pairs."""

COARSEST_M = 1e-3
"""Standard uncertainty of a coordinate, metres, at most, that shots of one pose show. A convention: cameras and motion capture
stay below; beyond, shots are of several poses."""

MIN_REPEATED = 3
"""Poses with several shots, from which their scatter is learnt; one of three may hold two poses."""

TURNED_RAD = float(np.radians(2.0))
"""Angle, radians, at most, between two shots of one pose. A convention: instruments of six degrees of freedom scatter by
hundredths of a degree, cameras by tenths."""


def average_shots(readings: Readings, metres: float = 1e-3) -> Readings:
    """Readings with one row for each id: rows of one id are shots of one pose, and their positions and rotations are averaged.

    The scatter of the shots about their means is noted.

    Args:
        readings: one row for each shot.
        metres: that one unit of positions is likely to be, where they state none.

    Raises:
        FileError: rows of one id have different joints, or their shots are too far apart for one pose.
    """
    if readings.ids is None or len(set(readings.ids)) == len(readings.ids):
        return readings
    groups = rows_by_id(readings.ids)
    numbers = {name: pose for pose, name in enumerate(groups)}
    pose_of = [numbers[name] for name in readings.ids]
    refuse_other_joints(readings, groups)
    for name, values in readings.points.items():
        refuse_two_poses(readings, name, values, groups, metres)
    _refuse_turned(readings, groups)
    points = {
        name: np.stack([mean_of_seen(values[rows]) for rows in groups.values()])
        for name, values in readings.points.items()
    }
    first = readings.take(np.array([rows[0] for rows in groups.values()]))

    seen = _seen(readings)
    counted = seen | ~np.isin(pose_of, np.array(pose_of)[seen])

    def mean_rotations(R: Float[np.ndarray, "n 3 3"]) -> Float[np.ndarray, "poses 3 3"]:
        sums = np.zeros((len(groups), 3, 3))
        # a lost beam has no orientation of its own
        np.add.at(sums, pose_of, R * counted[:, None, None])
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


def refuse_two_poses(
    readings: Readings,
    target: str,
    values: Float[np.ndarray, "n 3"],
    groups: Mapping[str, Sequence[int]],
    metres: float = 1e-3,
) -> None:
    """See that the shots of each pose are as near as one pose and one instrument leave them.

    The limit is `RETURN_M` plus `SIGMAS` standard uncertainties: those that the file states, or else those of the default
    `TrackerNoise`, or what the median pose shows up to `COARSEST_M`.

    Args:
        readings: whose rows they are.
        target: whose positions they are, as columns name it.
        values: positions in the unit of the readings; NaN where the target was not seen.
        groups: rows of each pose.
        metres: as of `average_shots`.

    Raises:
        FileError: two shots of a pose are farther apart.
    """
    scale = 1.0 if readings.length_unit_stated else metres
    stated = readings.uncertainty.get(target.casefold(), readings.uncertainty.get(""))
    seen = {name: [row for row in rows if not np.isnan(values[row, 0])] for name, rows in groups.items()}
    several = {name: scale * values[rows] for name, rows in seen.items() if len(rows) > 1}
    if not several:
        return
    own = [np.sqrt(np.sum((p - p.mean(axis=0)) ** 2) / (3 * (len(p) - 1))) for p in several.values()]
    shown_by_shots = min(float(np.median(own)), COARSEST_M) if len(own) >= MIN_REPEATED else 0.0
    faults = Faults()
    for name, points in several.items():
        # the farthest shot from the mean, and the farthest from that
        first = int(np.argmax(np.linalg.norm(points - points.mean(axis=0), axis=1)))
        away = np.linalg.norm(points - points[first], axis=1)
        second = int(np.argmax(away))
        if away[second] <= RETURN_M:
            continue
        if stated is None:
            sigma = max(float(np.sqrt(np.trace(TrackerNoise().covariance(points[first])) / 3)), shown_by_shots)
        else:
            sigma = scale * float(stated[seen[name]].max())
        limit = RETURN_M + SIGMAS * sigma
        if away[second] > limit:
            with faults.collecting():
                raise _two_poses(
                    readings, name, sorted((seen[name][first], seen[name][second])), away[second], limit, sigma
                )
    faults.raise_any()


def _two_poses(
    readings: Readings, name: str, rows: Sequence[int], distance: float, limit: float, sigma: float
) -> FileError:
    lines = [int(readings.lines[row]) for row in rows]
    message = (
        f"pose '{shown(name, 40)}' has shots {distance * 1e3:.1f} mm apart, in lines {lines[0]} and {lines[1]}; one pose has at "
        f"most {limit * 1e3:.1f} mm: {RETURN_M * 1e3:.0f} mm between two returns of a robot (ISO 9283), and {SIGMAS:.0f} standard "
        f"uncertainties of {sigma * 1e3:.3f} mm; give each pose its own id or header, each target its name in a column 'target', "
        "or state the uncertainty (u_mm)"
    )
    return FileError(readings.path, message, line=lines[1])


def _refuse_turned(readings: Readings, groups: Mapping[str, Sequence[int]]) -> None:
    """See that shots of one pose have one orientation, by the convention under which they differ least where it is open.

    Raises:
        FileError: two are turned by more than `TURNED_RAD`.
    """
    turned = [] if readings.rotations is None else [readings.rotations]
    if readings.open_angles is not None:
        turned += readings.open_angles.meanings.values()
    if not turned:
        return
    seen = _seen(readings)
    for name, rows in groups.items():
        kept = [row for row in rows if seen[row]]
        if len(kept) < 2:
            continue
        traces = np.array([np.einsum("ij,nij->n", R[kept[0]], R[kept]) for R in turned])
        angles = np.arccos(np.clip((traces - 1.0) / 2.0, -1.0, 1.0)).min(axis=0)
        if angles.max() > TURNED_RAD:
            first, line = (int(readings.lines[row]) for row in (kept[0], kept[int(np.argmax(angles))]))
            message = (
                f"pose '{shown(name, 40)}' has shots turned by {np.degrees(angles.max()):.1f}°, in lines {first} and {line}; one "
                f"pose has at most {np.degrees(TURNED_RAD):.0f}°; give each pose an id of its own"
            )
            raise FileError(readings.path, message, line=line)


def _seen(readings: Readings) -> Bool[np.ndarray, " n"]:
    """Rows in which a target was seen; all where there are no positions."""
    if not readings.points:
        return np.ones(len(readings), dtype=bool)
    return np.any([~np.isnan(values[:, 0]) for values in readings.points.values()], axis=0)


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


# Tables with one target a row, made into tables with one pose a row.

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


# Targets without a column that says so: behind the name of the pose, as in ``P12_T1``, or as points of a group.

_APART = 3e-3
"""Distance of two targets over the scatter of all points, at least; it may change as much from pose to pose. A convention:
shots of one target are nearer."""


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


def _group_scatter(points: Float[np.ndarray, "n 3"]) -> float:
    return float(np.linalg.norm(np.nanstd(points, axis=0))) if not np.isnan(points).all() else 0.0


def _lie_together(points: Float[np.ndarray, "n 3"], poses: Sequence[str]) -> bool:
    """Whether the rows of most poses are nearer than two targets."""
    several = [seen for rows in rows_by_id(tuple(poses)).values() if len(seen := _seen_targets(points[rows])) > 1]
    apart = [float(np.linalg.norm(np.ptp(seen, axis=0))) for seen in several]
    return bool(apart) and float(np.median(apart)) < _APART * _group_scatter(points)


def _seen_targets(points: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "k 3"]:
    return points[~np.isnan(points[:, 0])]


def _keep_distances(points: Float[np.ndarray, "n 3"], poses: Sequence[str], targets: Sequence[str]) -> bool:
    """Whether targets are as far from one another in most poses, as on one tool; one that stands still is beside the robot."""
    limit = _APART * _group_scatter(points)
    numbers = {name: k for k, name in enumerate(dict.fromkeys(poses))}
    place = {name: np.full((len(numbers), 3), np.nan) for name in dict.fromkeys(targets)}
    for row, (pose, target) in enumerate(zip(poses, targets, strict=True)):
        place[target][numbers[pose]] = points[row]
    moving = [at for at in place.values() if _group_scatter(at) > limit]
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


# Readings in the units that their file states above its table.


def with_stated_units(readings: Readings, robot: Robot) -> Readings:
    """Readings in radians and metres as far as the file states above its table what its columns do not.

    Raises:
        FileError: the points would not spread as the robot does in the unit stated, but would in another, or are beyond any robot.
    """
    stated = stated_units(readings.preamble)
    angle = None if readings.joint_unit_stated else stated.angle
    length = None if readings.length_unit_stated else stated.length
    if angle is None and length is None:
        return readings
    _refuse_contradiction(readings, stated, robot, angle, length)
    q, notes = readings.q, []
    if angle is not None and q is not None:
        q = np.where(robot.prismatic, q, q * ANGLES[angle])
        notes.append(f"joints are read in {angle}")
    scale = 1.0 if length is None else LENGTHS[length]
    if length is not None:
        notes.append(f"positions are read in {length}")
    where = f", as stated above the table: '{shown(stated.where, 60)}'"
    out = replace(
        readings,
        q=q,
        points={name: points * scale for name, points in readings.points.items()},
        uncertainty={
            name: u if name in readings.uncertainty_stated else u * scale for name, u in readings.uncertainty.items()
        },
        joint_unit_stated=readings.joint_unit_stated or angle is not None,
        length_unit_stated=readings.length_unit_stated or length is not None,
        notes=(*readings.notes, " and ".join(notes) + where),
    )
    if out.length_unit_stated:
        refuse_far(out)
    return out


def refuse_far(readings: Readings) -> None:
    """See that all positions, in metres, are within those of any robot.

    Raises:
        FileError: one is not.
    """
    for name, points in readings.points.items():
        for row, axis in np.argwhere(np.abs(points) > FARTHEST)[:1].tolist():
            message = f"{points[row, axis]:g} m is beyond ±{FARTHEST:g} m; check the cell and its unit"
            column = f"{name} {'xyz'[axis]}"
            raise FileError(readings.path, message, line=int(readings.lines[row]), column=column)


def _refuse_contradiction(
    readings: Readings, stated: StatedUnits, robot: Robot, angle: str | None, length: str | None
) -> None:
    if readings.q is None or not readings.points:
        return
    known_angle = "rad" if readings.joint_unit_stated else None
    known_length = "m" if readings.length_unit_stated else None
    from taskcal.reading.inference import infer_units  # fits, and so imports the compiler

    likely = {"mm", "m", "in"}
    for target, points in readings.points.items():
        fitting = infer_units(robot, readings.q, known_angle, points, known_length)
        if len(fitting) == 1 and any(
            unit is not None and unit != fits and (unit in likely or unit in ANGLES)
            for unit, fits in zip((angle, length), fitting[0], strict=True)
        ):
            named = " and ".join(unit for unit in (angle, length) if unit)
            fits = " and ".join(unit for unit, asked in zip(fitting[0], (angle, length), strict=True) if asked)
            whose = f"points of '{shown(target)}'" if len(readings.points) > 1 else "points"
            message = (
                f"states {named} above the table ('{shown(stated.where, 60)}'), but {robot.name} moved as far as the {whose} only "
                f"if they are {fits}: write the right unit into the columns' names"
            )
            raise FileError(readings.path, message)


# Rows below a table that hold its mean, and other statistics beside it, without a word that says so.

MIN_ROWS = 6
"""Above a row that may be their mean."""

MOST_STATISTICS = 8
"""Rows below a table: mean, standard deviation, least, largest, range, median, root mean square …"""

MIN_COLUMNS = 5
"""In which the rows differ, and all of which must agree with one statistic."""

_AGREES = 2e-3
"""Difference over the standard deviation of the rows above, at most, of a stated statistic. A convention: means are often
written with fewer digits."""


def without_means(readings: Readings) -> Readings:
    """Readings without last rows that are the mean of all above, and other statistics of these beside it; a note says so."""
    if readings.q is None or not readings.points or readings.targets_by_row is not None:
        return readings
    values = np.concatenate([readings.q, next(iter(readings.points.values()))], axis=1)
    end = _end_of_measurements(values)
    if end == len(values):
        return readings
    lines = ", ".join(str(line) for line in readings.lines[end:])
    note = f"the last rows (line {lines}) are the mean of those above, or another statistic of them, and are left out"
    rest = readings.take(np.arange(end))
    return replace(rest, notes=(*rest.notes, note))


def _end_of_measurements(values: Float[np.ndarray, "n columns"]) -> int:
    """The first of last rows that are all statistics of the rows before them, one of them the mean; else the number of rows."""
    n = len(values)
    for end in range(max(MIN_ROWS, n - MOST_STATISTICS), n):
        above, below = values[:end], values[end:]
        above = above[~np.isnan(above).any(axis=1)]
        if len(above) < MIN_ROWS:
            continue
        scatter = above.std(axis=0)
        differ = scatter > 0.0
        if differ.sum() < MIN_COLUMNS:
            continue
        statistics = _statistics(above)
        off = np.abs(below[:, None] - statistics[None])[..., differ] / scatter[differ]
        fits = (off < _AGREES).all(axis=2)
        if fits[:, 0].any() and fits.any(axis=1).all():
            return end
    return n


def _statistics(rows: np.ndarray) -> Float[np.ndarray, "statistics columns"]:
    """The mean first."""
    spread = [rows.std(axis=0), rows.std(axis=0, ddof=1), np.ptp(rows, axis=0)]
    places = [rows.mean(axis=0), rows.min(axis=0), rows.max(axis=0), np.median(rows, axis=0)]
    return np.stack([*places, *spread, np.sqrt(np.mean(rows**2, axis=0)), rows.sum(axis=0)])


MOVED = 0.01
"""Displacement, metres, at most, of a point that stands still. A convention: stands bend and bases drift by less."""

LARGEST_IN_RADIANS = 10.0
"""Joint position, at most, taken for radians: a turn and a half. A convention: joints that stay within it in degrees hardly
move."""


@dataclass(frozen=True, kw_only=True)
class ReadOptions:
    """What a user states of a file of measurements that the file does not say; nothing by default."""

    form: TableForm = field(default_factory=TableForm)
    """Of the table."""
    angles: AngleForm | None = None
    """What three angles of a pose mean."""
    points: str | Path | None = None
    """Another file with the points, where the first holds joints only."""
    distances: str | Path | None = None
    """Another file with stated distances of sockets."""
    wire_scale: bool = False
    """Whether the scale of measured lengths (`d_mm`) is unknown."""


def read_campaign(
    path: str | Path,
    robot: Robot,
    *,
    targets: Sequence[str] | None = None,
    reference_points: Sequence[str] | None = None,
    options: ReadOptions | None = None,
) -> Campaign:
    """Read a campaign.

    Columns, in any order and letter case, with units in their names (``J1_deg``, ``Joint 1 (deg)``, ``X [mm]``) or in a row
    of their own: joints by the robot's names or by number (``J1``, ``A1``, ``q1``, ``Achse 1``); one target as ``x y z``,
    several as ``NAME_x …``, or one a row with its name in a column ``target``; for a pose ``qx qy qz qw``, a matrix ``r11 …``
    or angles ``A B C`` (KUKA), ``W P R`` (FANUC), ``roll pitch yaw``; optionally ``id``; ``u_mm`` or ``NAME_u_mm`` (standard
    uncertainty per axis); ``temp_C``; ``time_s`` (since the robot began to work); and for each joint ``J1_approach``, the
    way its drive turned last (1 up, −1 down, 0 unknown), and ``J1_move_deg``, how far. A target whose three cells are all
    empty or all zero is a lost beam. Other columns are left out. `Campaign.notes` says what was left out and decided.

    Without a tracker: the ``socket`` that a ball on the tool rests in, and the ``place`` where its block
    stood; or ``d_mm``, the length of a wire from the tool to an ``anchor``.

    Rows of one id with the same joints are shots of one pose, and averaged. Units that are stated nowhere are told by the
    robot's own motion, or the file is refused. Without columns that say how poses were approached, the rows are taken in
    the order of measurement. Where their ids are rising whole numbers, a step larger than the usual one says that rows were
    left out, and the way is unknown there.

    Args:
        path: a text file in columns, a workbook (.xlsx), or a log of labelled values.
        robot: the robot that was measured.
        targets: the targets to read; all that are not reference points by default.
        reference_points: fixed points beside the robot; targets whose name begins with ``base`` by default.
        options: what is stated that the file does not say.

    Raises:
        FileError: with file, line, column, value and a remedy, for anything that cannot be read as a campaign; the first
            twenty faults.
    """
    expect_kinds({"robot": Robot}, robot=robot)
    readings = read_measurements(path, robot, options)
    campaign = campaign_of(readings, robot, targets, reference_points)
    if options is not None and options.wire_scale:
        campaign = with_unknown_scale(campaign)
    if options is None or options.distances is None:
        return campaign
    return with_distances(campaign, options.distances)


def read_measurements(path: str | Path, robot: Robot, options: ReadOptions | None = None) -> Readings:
    """Read joints, points or both, one row for each pose, in radians and metres.

    Raises:
        FileError: as of `read_campaign`, but for joints or points that are lacking.
    """
    options = options or ReadOptions()
    readings = _of_file(path, robot, options.form, options.angles)
    if options.points is not None:
        others = _of_file(options.points, robot, replace(options.form, columns=None), options.angles)
        if others.targets_by_row is not None and others.ids and len(set(others.ids)) < len(others.ids):
            others = side_by_side(others, _likely_metres(others, robot))
        from taskcal.reading.inference import pair  # fits, and so imports the compiler

        readings = pair(_averaged(readings, robot), _averaged(others, robot), robot)
    if readings.targets_by_row is not None:
        readings = side_by_side(readings, _likely_metres(readings, robot))
    return with_convention(_averaged(_with_units(readings, robot), robot), robot)


def _of_file(path: str | Path, robot: Robot, form: TableForm, angles: AngleForm | None) -> Readings:
    """What one file says, in its own words."""
    readings = with_stated_units(read_readings(path, robot, form, angles), robot)
    return with_targets_in_names(without_means(readings))


def _averaged(readings: Readings, robot: Robot) -> Readings:
    if readings.targets_by_row is not None:
        return readings
    return average_shots(readings, _likely_metres(readings, robot))


def _likely_metres(readings: Readings, robot: Robot) -> float:
    """What one unit of positions is by their scatter, where none is stated; of a millimetre where it cannot be told."""
    if readings.length_unit_stated or not readings.points:
        return LENGTHS["mm"]
    from taskcal.reading.inference import infer_length

    return LENGTHS[infer_length(robot, next(iter(readings.points.values()))) or "mm"]


def _with_units(readings: Readings, robot: Robot) -> Readings:
    """Readings in radians and metres.

    Raises:
        FileError: a unit is stated nowhere and cannot be told.
    """
    if readings.joint_unit_stated and readings.length_unit_stated:
        return readings
    if readings.q is None:
        return _with_length(readings, robot)
    from taskcal.reading.inference import infer_units  # fits, and so imports the compiler

    points = next(iter(readings.points.values()), None)
    angle = "rad" if readings.joint_unit_stated else None
    length = "m" if readings.length_unit_stated else None
    fitting = infer_units(robot, readings.q, angle, points, length)
    angles = {unit for unit, _ in fitting or infer_units(robot, readings.q, angle, None, length)}
    if not readings.joint_unit_stated and len(angles) != 1:
        column = readings.joint_columns[int(np.argmin(robot.prismatic))]
        message = f"the unit is not stated; name the column {column}_deg or {column}_rad"
        raise FileError(readings.path, message, line=1, column=column)
    if not fitting and points is not None and angles == {"deg"} and not readings.joint_unit_stated:
        _refuse_small_angles(readings, robot, readings.q)
    if points is not None and not readings.length_unit_stated and len({unit for _, unit in fitting}) != 1:
        raise FileError(readings.path, _unit_of_points(fitting), line=1, column="x")
    notes: list[str] = []
    q = readings.q
    if not readings.joint_unit_stated:
        (unit,) = angles
        q = np.where(robot.prismatic, q, q * ANGLES[unit])
        notes.append(f"joints without a unit are read as {'degrees' if unit == 'deg' else 'radians'}, by their size")
    out = replace(readings, q=q, joint_unit_stated=True, notes=(*readings.notes, *notes))
    if points is None or readings.length_unit_stated:
        return out
    return _scaled(out, _unit_of_each(out, robot, fitting[0][1]), f"by how far {robot.name} moved")


def _unit_of_each(readings: Readings, robot: Robot, first: str) -> dict[str, str]:
    """The unit of each target's positions, by its own motion, or that of the first where it does not move.

    Raises:
        FileError: a target moves, but in no unit as far as the robot.
    """
    from taskcal.reading.inference import infer_units

    assert readings.q is not None
    out: dict[str, str] = {}
    for name, points in readings.points.items():
        units = {unit for _, unit in infer_units(robot, readings.q, "rad", points, None)}
        out[name] = first if first in units or not units else min(units)
        moved = float(np.nanmax(np.ptp(points[~np.isnan(points[:, 0])], axis=0), initial=0.0)) * LENGTHS[first]
        if (len(units - {first}) > 1 and first not in units) or (not units and moved > MOVED):
            column = f"{name}_x"
            raise FileError(
                readings.path, f"the unit is not stated; name the column {column}_mm", line=1, column=column
            )
    return out


def _refuse_small_angles(readings: Readings, robot: Robot, q: np.ndarray) -> None:
    """Angles that look like radians, are beyond the robot's limits as such, and as degrees would hardly move it."""
    turning = ~np.array(robot.prismatic)
    if np.abs(q[:, turning]).max() > LARGEST_IN_RADIANS:
        return
    row, reason = robot.outside_limits(q)[0]
    column = readings.joint_columns[int(np.argmax(turning))]
    message = (
        f"the unit is not stated: as degrees the joints would not move the flange as far as the points, as radians {reason}; "
        f"name the column {column}_deg or {column}_rad, and look at this row"
    )
    raise FileError(readings.path, message, line=int(readings.lines[row]), column=column)


def _with_length(readings: Readings, robot: Robot) -> Readings:
    """Points alone in metres, by the robot's reach."""
    from taskcal.reading.inference import infer_length

    unit = infer_length(robot, next(iter(readings.points.values())))
    if unit is None:
        raise FileError(readings.path, _unit_of_points([("", "mm"), ("", "m")]), line=1, column="x")
    return _scaled(readings, dict.fromkeys(readings.points, unit), f"by the reach of {robot.name}")


def _scaled(readings: Readings, units: Mapping[str, str], why: str) -> Readings:
    """Readings whose positions are in a unit for each target, in metres.

    Raises:
        FileError: units differ, and an uncertainty without one is of all targets; a position is beyond any robot.
    """
    several = len(set(units.values())) > 1
    if several and "" in readings.uncertainty.keys() - readings.uncertainty_stated:
        raise FileError(readings.path, "the unit of the uncertainty is not stated; name its column u_mm", line=1)
    scale = {name: LENGTHS[unit] for name, unit in units.items()}
    points = {name: values * scale[name] for name, values in readings.points.items()}
    by_case = {name.casefold(): factor for name, factor in scale.items()}
    each = (
        ", ".join(f"{name} in {unit}" for name, unit in units.items())
        if several
        else f"in {next(iter(units.values()))}"
    )
    out = replace(
        readings,
        points=points,
        uncertainty={
            name: values
            * (1.0 if name in readings.uncertainty_stated else by_case.get(name, next(iter(scale.values()))))
            for name, values in readings.uncertainty.items()
        },
        length_unit_stated=True,
        notes=(*readings.notes, f"positions without a unit are read {each}, {why}"),
    )
    refuse_far(out)
    return out


def _unit_of_points(fitting: list[tuple[str, str]]) -> str:
    """Why positions have no unit."""
    if fitting:
        return "the unit is not stated; name the column x_mm"
    return (
        "the unit is not stated, and in mm, m or inches the points would not spread as the robot's flange does; name the "
        "columns x_mm y_mm z_mm, or look at the joints (their units, order and signs)"
    )


def campaign_of(
    readings: Readings,
    robot: Robot,
    targets: Sequence[str] | None = None,
    reference_points: Sequence[str] | None = None,
) -> Campaign:
    """The campaign that readings are, where they hold joints and points.

    Raises:
        FileError: they hold only one of them, a target is not there, a pose is beyond the robot's limits, or positions may be the
            controller's own.
    """
    q = readings.q
    if q is None:
        raise _header_error(
            readings,
            f"has no column for joint {robot.joint_names[0]} of {robot.name}; it needs one for each of "
            f"{', '.join(robot.joint_names)}, such as {robot.joint_names[0]}_deg or q1_rad, or a second file that holds them"
            f"{_other_sheets(readings)}",
        )
    points = dict(readings.points)
    fixed = (
        [n for n in points if n.lower().startswith("base")]
        if reference_points is None
        else _among(readings, reference_points, points)
    )
    observed = _observed(readings, targets)
    if observed and targets is not None:
        targets = [name for name in targets if name.casefold() not in {one.target for one in observed}]
    chosen = [n for n in points if n not in fixed] if targets is None else _among(readings, targets, points)
    fixed = [n for n in fixed if n not in chosen]
    if len(chosen) > MAX_TARGETS:
        raise _header_error(readings, f"names {len(chosen)} targets; Taskcal fits {MAX_TARGETS} at most: choose some")
    if not chosen and not observed:
        if readings.observed is not None and targets is None:
            empty = ", ".join(readings.observed.headers.values())
            raise _header_error(readings, f"{empty}: no row is filled in; write down there what was measured")
        raise _header_error(
            readings,
            "names no target; give columns x_mm, y_mm, z_mm, or NAME_x_mm, NAME_y_mm, NAME_z_mm; without a tracker d_mm of a wire, "
            f"sx_mm, sy_mm, sz_mm of a sensor, socket, plane, or face and edge_mm{_other_sheets(readings)}{_left(readings)}",
        )
    readings = _with_own_rotations(readings, chosen)
    if readings.rotations is not None and len(chosen) > 1:
        raise _header_error(readings, f"a pose has one target, this file names {', '.join(chosen)}; choose one")
    _refuse_limits(readings, robot, q)
    ids = readings.ids or tuple(str(number) for number in range(1, len(readings) + 1))
    values = [*(points[name] for name in chosen), *(one.points for one in observed)]
    tracked = Point() if readings.rotations is None else Pose()
    campaign = Campaign(
        ids=ids,
        q=q,
        targets=(*chosen, *(one.target for one in observed)),
        points=np.stack(values, axis=1),
        rotations=_rotations(readings, observed),
        observations=(*(tracked for _ in chosen), *(one.observation for one in observed)) if observed else (),
        uncertainty=_uncertainty(readings, [*chosen, *(one.target for one in observed)]),
        reference_points={name: points[name] for name in fixed},
        conditions=replace(recorded_ways(readings, robot, q), temperature=readings.temperature, time=readings.time),
        source=readings.path.name,
        lines=readings.lines,
        notes=readings.notes,
    )
    if targets is None:
        _refuse_controllers(readings, robot, campaign)
    return campaign


def _with_own_rotations(readings: Readings, chosen: Sequence[str]) -> Readings:
    """Readings with the rotations of the only target that is chosen; a note says whose others are left out."""
    turned = {readings.rotated: readings.rotations, **readings.other_rotations}
    if readings.rotations is None or len(chosen) > 1:
        return readings
    named = {name.casefold() for name in readings.points}
    own = {"", *(name.casefold() for name in chosen)}
    mine = next((name for name in turned if name.casefold() in own), None)
    if mine is None and len(turned) == 1 and readings.rotated.casefold() not in named:
        return readings
    left = [name for name in turned if name != mine]
    rotations = None if mine is None else turned[mine]
    if not left:
        return readings
    note = f"rotations of {shown(', '.join(left))} are left out"
    return replace(readings, rotations=rotations, rotated=mine or "", other_rotations={}, notes=(*readings.notes, note))


def _refuse_controllers(readings: Readings, robot: Robot, campaign: Campaign) -> None:
    """See that positions in the robot's base are not the controller's own, where another column may hold the measurement.

    Raises:
        FileError: they are in the robot's base, and a column of lengths is left out, or something else was observed.
    """
    other = [*readings.left_lengths, *(readings.observed.headers.values() if readings.observed else ())]
    tracked = [
        name
        for t, name in enumerate(campaign.targets)
        if not campaign.observations or campaign.observations[t].in_tracker
    ]
    if not other or not tracked:
        return
    from taskcal.registration.consensus import fits_in_base  # fits, and so imports the compiler

    for name in tracked:
        if fits_in_base(robot, campaign, name):
            message = (
                f"the positions of '{name}' are in the robot's own base, as the controller shows them, and '{shown(other[0])}' may "
                f"be what was measured. If it is, leave those columns out (of lengths to an anchor, name it d_mm); if '{name}' was "
                f"measured, choose it: --targets {name}"
            )
            raise _header_error(readings, message)


def _observed(readings: Readings, targets: Sequence[str] | None) -> list[Read]:
    """What was observed without a tracker, of all or of those that are asked for."""
    if readings.observed is None:
        return []
    found = [one for kind in kinds() if (one := kind.read(readings.observed)) is not None]
    wanted = None if targets is None else {name.casefold() for name in targets}
    return [one for one in found if wanted is None or one.target in wanted]


def _rotations(readings: Readings, observed: Sequence[Read]) -> Float[np.ndarray, "n 3 3"] | None:
    """Of the only target that is measured with one.

    Raises:
        FileError: there are several.
    """
    turned = [one for one in observed if one.rotations is not None]
    if len(turned) + (readings.rotations is not None) > 1:
        raise _header_error(
            readings, "has rotations of several targets in one file; Taskcal fits one: choose with --targets"
        )
    return turned[0].rotations if turned else readings.rotations


def _other_sheets(readings: Readings) -> str:
    """What is said of a workbook whose other sheets may hold what is lacking."""
    note = next((note for note in readings.notes if note.startswith("sheet '")), None)
    return "" if note is None else f" ({note}; name one as in {readings.path.name}#SHEET)"


def _left(readings: Readings) -> str:
    """What is said of columns that were left out where what was measured is lacking."""
    note = next((note for note in readings.notes if re.match("columns? left out", note)), None)
    return "" if note is None else f"; {note}"


def _header_error(readings: Readings, message: str) -> FileError:
    return FileError(readings.path, message, line=1)


def _among(readings: Readings, wanted: Sequence[str], points: dict[str, np.ndarray]) -> list[str]:
    by_case = {name.lower(): name for name in points}
    for name in wanted:
        if name.lower() not in by_case:
            raise _header_error(readings, f"has no target '{name}'; it has {shown(', '.join(points) or 'none')}")
    return [by_case[name.lower()] for name in wanted]


def _refuse_limits(readings: Readings, robot: Robot, q: np.ndarray) -> None:
    outside = robot.outside_limits(q)
    if not outside:
        return
    row, reason = outside[0]
    count = len({r for r, _ in outside})
    message = (
        f"{reason} ({count} of {len(q)} rows are outside the limits of {robot.name}); check the units, the order of the joints "
        "and their signs, or widen the limits in the robot file"
    )
    raise FileError(readings.path, message, line=int(readings.lines[row]))


def _uncertainty(readings: Readings, targets: Sequence[str]) -> Float[np.ndarray, "n targets"] | None:
    stated = [readings.uncertainty.get(name.casefold(), readings.uncertainty.get("")) for name in targets]
    values = [u for u in stated if u is not None]
    if not values:
        return None
    if len(values) < len(targets):
        without = targets[next(k for k, u in enumerate(stated) if u is None)]
        message = f"states the uncertainty of some targets but not of '{without}'; give {without}_u_mm"
        raise _header_error(readings, message)
    return np.stack(values, axis=1)
