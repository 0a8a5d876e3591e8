"""From the rows of a file to one row a pose: shots are averaged, targets set side by side, statistics left out."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TypeVar

import numpy as np
from jaxtyping import Bool, Float, Int

from taskcal.errors import FileError, shown
from taskcal.geometry import se3
from taskcal.observations.base import TrackerNoise
from taskcal.reading.positions import MAX_TARGETS
from taskcal.reading.readings import Readings
from taskcal.tables.table import raise_all

# Shots of one pose, averaged.

SAME_POSE_RAD = 1e-4
"""Largest difference of joints, radians or metres, of one pose: what a controller reports of a robot at rest."""

MAX_RETURN_M = 1e-3
"""Distance of two returns to one pose, metres. Data sheets of industrial robots state a repeatability (ISO 9283:1998, RP) of 0.02
to 0.5 mm: a radius about the mean, so that two returns are up to twice as far apart."""

MAX_SIGMAS = 10.0
"""Standard uncertainties of a coordinate between two shots of one pose. The distance of two shots is √2 times a Maxwell variable:
beyond ten in fewer than one of a thousand million pairs."""

MAX_SHOT_NOISE_M = 1e-3
"""Standard uncertainty of a coordinate, metres, at most, that shots of one pose show. A convention: cameras and motion capture
stay below; beyond, shots are of several poses."""

MIN_REPEATED = 3
"""Poses with several shots, from which their scatter is learnt; one of three may hold two poses."""

MAX_TURN_RAD = float(np.radians(2.0))
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
    groups, pose_of = rows_by_id(readings.ids), numbered(readings.ids)
    refuse_other_joints(readings, groups)
    for name, values in readings.points.items():
        refuse_two_poses(readings, name, values, groups, metres)
    _refuse_turned(readings, groups)
    points = {
        name: np.stack([mean_of_seen(values[rows]) for rows in groups.values()])
        for name, values in readings.points.items()
    }
    first = readings.take(np.array([rows[0] for rows in groups.values()]))

    seen = _rows_seen(readings)
    counted = seen | ~np.isin(pose_of, pose_of[seen])

    def mean_rotations(R: Float[np.ndarray, "n 3 3"]) -> Float[np.ndarray, "poses 3 3"]:
        sums = np.zeros((len(groups), 3, 3))
        # a lost beam has no orientation of its own
        np.add.at(sums, pose_of, R * counted[:, None, None])
        return se3.nearest_rotation(sums)

    angles = readings.open_angles
    most = max(len(rows) for rows in groups.values())
    note = f"{len(readings)} rows are {len(groups)} poses measured up to {most} times, and averaged"
    if readings.length_unit_stated:
        note += f"; the shots scatter by {_scatter(readings, groups) * 1e3:.4f} mm per axis"
    return replace(
        first,
        points=points,
        rotations={name: mean_rotations(R) for name, R in readings.rotations.items()},
        open_angles=None if angles is None else angles.mapped(mean_rotations),
    ).noted(note)


Id = TypeVar("Id")


def rows_by_id(ids: Sequence[Id]) -> dict[Id, list[int]]:
    """The rows of each id, in the order in which the ids come first."""
    groups: dict[Id, list[int]] = {}
    for row, name in enumerate(ids):
        groups.setdefault(name, []).append(row)
    return groups


def numbered(ids: Sequence[str]) -> Int[np.ndarray, " n"]:
    """Number of each row's id, counted from 0 as they come first."""
    numbers = {name: k for k, name in enumerate(dict.fromkeys(ids))}
    return np.array([numbers[name] for name in ids], dtype=int)


def refuse_other_joints(readings: Readings, groups: dict[str, list[int]]) -> None:
    """See that rows of one id are of one pose.

    Raises:
        FileError: some have different joints.
    """
    if readings.q is None:
        return
    faults: list[FileError] = []
    for name, rows in groups.items():
        message = f"id '{shown(name)}' stands in line {int(readings.lines[rows[0]])} already; give each row its own"
        for row in rows[1:]:
            if np.abs(readings.q[row] - readings.q[rows[0]]).max() > SAME_POSE_RAD:
                faults.append(FileError(readings.path, message, line=int(readings.lines[row]), column="id"))
    raise_all(faults)


def refuse_two_poses(
    readings: Readings,
    target: str,
    values: Float[np.ndarray, "n 3"],
    groups: Mapping[str, Sequence[int]],
    metres: float = 1e-3,
) -> None:
    """See that the shots of each pose are as near as one pose and one instrument leave them.

    The limit is `MAX_RETURN_M` plus `MAX_SIGMAS` standard uncertainties: those that the file states, or else those of the default
    `TrackerNoise`, or what the median pose shows up to `MAX_SHOT_NOISE_M`.

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
    shown_by_shots = min(float(np.median(own)), MAX_SHOT_NOISE_M) if len(own) >= MIN_REPEATED else 0.0
    faults: list[FileError] = []
    for name, points in several.items():
        # the farthest shot from the mean, and the farthest from that
        first = int(np.argmax(np.linalg.norm(points - points.mean(axis=0), axis=1)))
        away = np.linalg.norm(points - points[first], axis=1)
        second = int(np.argmax(away))
        if away[second] <= MAX_RETURN_M:
            continue
        if stated is None:
            sigma = max(float(np.sqrt(np.trace(TrackerNoise().covariance(points[first])) / 3)), shown_by_shots)
        else:
            sigma = scale * float(stated[seen[name]].max())
        limit = MAX_RETURN_M + MAX_SIGMAS * sigma
        if away[second] <= limit:
            continue
        rows = sorted((seen[name][first], seen[name][second]))
        lines = [int(readings.lines_of_points[row]) for row in rows]
        message = (
            f"pose '{shown(name, 40)}' has shots {away[second] * 1e3:.1f} mm apart, in lines {lines[0]} and {lines[1]}; one pose "
            f"has at most {limit * 1e3:.1f} mm: {MAX_RETURN_M * 1e3:.0f} mm between two returns of a robot (ISO 9283), and "
            f"{MAX_SIGMAS:.0f} standard uncertainties of {sigma * 1e3:.3f} mm; give each pose its own id or header, each target "
            "its name in a column 'target', or state the uncertainty (u_mm)"
        )
        faults.append(readings.points_error(message, rows[1]))
    raise_all(faults)


def _refuse_turned(readings: Readings, groups: Mapping[str, Sequence[int]]) -> None:
    """See that shots of one pose have one orientation, by the convention under which they differ least where it is open."""
    turned = [*readings.rotations.values()][:1]
    if readings.open_angles is not None:
        turned += readings.open_angles.meanings.values()
    if not turned:
        return
    seen = _rows_seen(readings)
    for name, rows in groups.items():
        kept = [row for row in rows if seen[row]]
        if len(kept) < 2:
            continue
        traces = np.array([np.einsum("ij,nij->n", R[kept[0]], R[kept]) for R in turned])
        angles = np.arccos(np.clip((traces - 1.0) / 2.0, -1.0, 1.0)).min(axis=0)
        if angles.max() > MAX_TURN_RAD:
            second = int(kept[int(np.argmax(angles))])
            first, line = (int(readings.lines_of_points[row]) for row in (kept[0], second))
            message = (
                f"pose '{shown(name, 40)}' has shots turned by {np.degrees(angles.max()):.1f}°, in lines {first} and {line}; one "
                f"pose has at most {np.degrees(MAX_TURN_RAD):.0f}°; give each pose an id of its own"
            )
            raise readings.points_error(message, second)


def _rows_seen(readings: Readings) -> Bool[np.ndarray, " n"]:
    """Rows in which a target was seen; all where there are no positions."""
    if not readings.points:
        return np.ones(len(readings), dtype=bool)
    return np.any([~np.isnan(values[:, 0]) for values in readings.points.values()], axis=0)


def seen_points(points: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "k 3"]:
    """Points where the beam was not lost."""
    return points[~np.isnan(points[:, 0])]


def mean_of_seen(points: Float[np.ndarray, "shots 3"]) -> Float[np.ndarray, "3"]:
    """Mean of the shots that saw the target; NaN where none did."""
    seen = seen_points(points)
    return seen.mean(axis=0) if len(seen) else np.full(3, np.nan)


def _scatter(readings: Readings, groups: dict[str, list[int]]) -> float:
    """Pooled standard deviation of shots about their means, per axis, metres."""
    squares, freedom = 0.0, 0
    for values in readings.points.values():
        for rows in groups.values():
            seen = seen_points(values[rows])
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
            raise readings.points_error("the row names no target", row, "target")
    named = set(readings.points)
    # a column of another name, such as 'measured_x', says nothing about which target it is
    if len(named) != 1 or (named & set(targets) and named != set(targets)):
        message = f"names a target in each row and in columns too ({shown(', '.join(readings.points))}); keep one form"
        raise readings.points_error(message)
    if readings.rotations and len(set(targets)) > 1:
        raise readings.points_error("has poses of several targets; choose the rows of one")
    (values,) = readings.points.values()
    if (count := len(set(targets))) > MAX_TARGETS:
        message = f"names {count} targets; Taskcal fits {MAX_TARGETS} at most: leave the rows of the others out"
        raise readings.points_error(message, column="target")
    pose_of = _poses(readings)
    firsts = np.unique(pose_of, return_index=True)[1]
    points = {name: np.full((len(firsts), 3), np.nan) for name in dict.fromkeys(targets)}
    shots = rows_by_id(list(zip(targets, pose_of.tolist(), strict=True)))
    for target in points:
        own = [rows for (name, _), rows in shots.items() if name == target]
        firsts_named = [readings.ids[rows[0]] if readings.ids else int(readings.lines[rows[0]]) for rows in own]
        of_poses = {f"{pose}, target {target}": rows for pose, rows in zip(firsts_named, own, strict=True)}
        refuse_two_poses(readings, target, values, of_poses, metres)
    for (name, pose), rows in shots.items():
        points[name][pose] = mean_of_seen(values[rows])
    return replace(readings.take(firsts), points=points, targets_by_row=None)


def _poses(readings: Readings) -> np.ndarray:
    """Number of each row's pose."""
    ids, targets = readings.ids, readings.targets_by_row or ()
    each_its_own = ids is not None and len(set(ids)) == len(ids) and len(set(targets)) > 1
    if ids is not None and not (each_its_own and readings.q is not None):
        refuse_other_joints(readings, rows_by_id(ids))
        return numbered(ids)
    if readings.q is None:
        raise FileError(
            readings.path, "has rows of several targets, and neither ids nor joints say which belong together"
        )
    moved = np.abs(np.diff(readings.q, axis=0)).max(axis=1) > SAME_POSE_RAD
    return np.concatenate([[0], np.cumsum(moved)])


# Names of poses and of targets in one: ``P12_T1``.

_PARTED = re.compile(r"(?P<pose>.*[^\s_\-./:])(?:::|[\s_\-./:])(?P<target>[^\s_\-./:]+)")

MAX_NAMED_TARGETS = 20
"""On one tool; more names are those of something else."""


def split_names(names: Sequence[str]) -> tuple[tuple[str, ...], tuple[str, ...]] | None:
    """Pose and target of each name; None where names do not consist of both throughout.

    All names differ, and `are_poses_and_targets`.
    """
    matches = [_PARTED.fullmatch(name) for name in names]
    if not names or None in matches:
        return None
    poses = tuple(match["pose"] for match in matches if match)
    targets = tuple(match["target"] for match in matches if match)
    return (poses, targets) if are_poses_and_targets(poses, targets) else None


def parts_of_names(names: Sequence[str]) -> tuple[tuple[str, ...] | None, tuple[str, ...]] | None:
    """Group and point of names such as ``Collection::Group::P1``; None where one is written otherwise.

    Parts that are the same in all names are left out: no group is left where only one part differs.
    """
    if not names or "::" not in names[0]:
        return None
    parts = [name.split("::") for name in names]
    if any(len(part) != len(parts[0]) or not all(part) for part in parts):
        return None
    columns = [column for column in zip(*parts, strict=True) if len(set(column)) > 1]
    if len(columns) < 2:
        return None, columns[0] if columns else tuple(part[-1] for part in parts)
    return tuple(map(" ".join, zip(*columns[:-1], strict=True))), columns[-1]


def each_in_most(poses: Sequence[str], targets: Sequence[str]) -> bool:
    """Whether there are several poses, at most `MAX_NAMED_TARGETS` targets and two at least, and each target is in most poses."""
    seen_in: dict[str, set[str]] = {}
    for pose, target in zip(poses, targets, strict=True):
        seen_in.setdefault(target, set()).add(pose)
    count = len(set(poses))
    return 2 <= len(seen_in) <= MAX_NAMED_TARGETS and count > 1 and min(map(len, seen_in.values())) > count / 2


def are_poses_and_targets(poses: Sequence[str], targets: Sequence[str]) -> bool:
    """Whether no target stands twice in a pose, and `each_in_most`."""
    return len(set(zip(poses, targets, strict=True))) == len(poses) and each_in_most(poses, targets)


# Targets without a column that says so: behind the name of the pose, as in ``P12_T1``, or as points of a group.

MIN_TARGET_DISTANCE = 3e-3
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
    rows = rows_by_id(poses)
    (points,) = readings.points.values()
    moved = max(float(np.ptp(readings.q[at], axis=0).max()) for at in rows.values())
    apart = [float(np.linalg.norm(np.ptp(points[at], axis=0))) for at in rows.values() if len(at) > 1]
    if moved > SAME_POSE_RAD or not np.nanmedian(apart) > MIN_TARGET_DISTANCE * np.linalg.norm(
        np.nanstd(points, axis=0)
    ):
        return readings
    note = f"ids such as '{readings.ids[0]}' are read as pose '{poses[0]}' and target '{targets[0]}'"
    return replace(readings, ids=poses, targets_by_row=targets).noted(note)


def _with_groups(readings: Readings) -> Readings:
    """Readings whose ids such as ``Collection::Group::P1`` are parted into the group and the point."""
    if readings.groups is not None or readings.ids is None or (parts := parts_of_names(readings.ids)) is None:
        return readings
    groups, names = parts
    within = "" if groups is None else f" of group '{shown(groups[0], 40)}'"
    note = f"names such as '{shown(readings.ids[0], 60)}' are read as '{shown(names[0], 40)}'{within}"
    return replace(readings, ids=names, groups=groups).noted(note)


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
        return replace(readings, ids=forms[0][0]) if of_joints else replace(readings, ids=joined).noted(each)
    (points,) = readings.points.values()
    for poses, _, word in forms:
        if len(set(poses)) > 1 and _lie_together(points, poses):
            note = f"{line}: {word} is read as the pose, and its rows as shots of it, which lie together"
            return replace(readings, ids=poses).noted(note)
    forms = [
        form for form in forms if 2 <= len(set(form[1])) <= MAX_NAMED_TARGETS and 1 < len(set(form[0])) < len(names)
    ]
    usual = [form for form in forms if each_in_most(form[0], form[1])]
    if readings.q is None or len(usual) != 1:
        kept = [form for form in forms if _keep_distances(points, form[0], form[1])]
        usual = kept if len(kept) == 1 else [form for form in usual if form in kept]
        if len(usual) != 1 and (kept or len(set(groups)) == len(groups)):
            remedy = "name the column of poses 'id', that of targets 'target'"
            message = f"{line}: either may be the pose, the other its target; {remedy}"
            raise FileError(readings.path, message, line=int(readings.lines[0]))
    if not usual:
        return replace(readings, ids=joined).noted(each)
    poses, targets, word = usual[0]
    why = "distances of targets are the same in all poses" if readings.q is None else "joints are the same in each pose"
    note = f"{line}: {word} is read as the pose, the other as its target, since {why}"
    return replace(readings, ids=poses, targets_by_row=targets).noted(note)


def _of_same_joints(readings: Readings, poses: Sequence[str]) -> bool:
    """Whether rows of one pose have the same joints; true where there are none."""
    if readings.q is None:
        return True
    most = SAME_POSE_RAD if readings.joint_unit_stated else np.degrees(SAME_POSE_RAD)
    return all(np.ptp(readings.q[rows], axis=0).max() <= most for rows in rows_by_id(poses).values())


def _group_scatter(points: Float[np.ndarray, "n 3"]) -> float:
    return float(np.linalg.norm(np.nanstd(points, axis=0))) if not np.isnan(points).all() else 0.0


def _lie_together(points: Float[np.ndarray, "n 3"], poses: Sequence[str]) -> bool:
    """Whether the rows of most poses are nearer than two targets."""
    several = [seen for rows in rows_by_id(poses).values() if len(seen := seen_points(points[rows])) > 1]
    apart = [float(np.linalg.norm(np.ptp(seen, axis=0))) for seen in several]
    return bool(apart) and float(np.median(apart)) < MIN_TARGET_DISTANCE * _group_scatter(points)


def _keep_distances(points: Float[np.ndarray, "n 3"], poses: Sequence[str], targets: Sequence[str]) -> bool:
    """Whether targets are as far from one another in most poses, as on one tool; one that stands still is beside the robot."""
    limit = MIN_TARGET_DISTANCE * _group_scatter(points)
    numbers = numbered(poses)
    place = {name: np.full((numbers.max() + 1, 3), np.nan) for name in dict.fromkeys(targets)}
    for row, (pose, target) in enumerate(zip(numbers, targets, strict=True)):
        place[target][pose] = points[row]
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


# Rows below a table that hold its mean, and other statistics beside it, without a word that says so.

MIN_ROWS = 6
"""Above a row that may be their mean."""

MAX_STATISTICS = 8
"""Rows below a table: mean, standard deviation, least, largest, range, median, root mean square …"""

MIN_COLUMNS = 5
"""In which the rows differ, and all of which must agree with one statistic."""

MAX_STATISTIC_ERROR = 2e-3
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
    return readings.take(np.arange(end)).noted(note)


def _end_of_measurements(values: Float[np.ndarray, "n columns"]) -> int:
    """The first of last rows that are all statistics of the rows before them, one of them the mean; else the number of rows."""
    n = len(values)
    for end in range(max(MIN_ROWS, n - MAX_STATISTICS), n):
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
        fits = (off < MAX_STATISTIC_ERROR).all(axis=2)
        if fits[:, 0].any() and fits.any(axis=1).all():
            return end
    return n


def _statistics(rows: np.ndarray) -> Float[np.ndarray, "statistics columns"]:
    """The mean first."""
    spread = [rows.std(axis=0), rows.std(axis=0, ddof=1), np.ptp(rows, axis=0)]
    places = [rows.mean(axis=0), rows.min(axis=0), rows.max(axis=0), np.median(rows, axis=0)]
    return np.stack([*places, *spread, np.sqrt(np.mean(rows**2, axis=0)), rows.sum(axis=0)])
