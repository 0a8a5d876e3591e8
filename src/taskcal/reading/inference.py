"""What the robot's kinematics decides of readings: units, which rows of two files belong together, the convention of angles.

Each step follows the reading of files, and notes what it decided. They fit, and so import the compiler.
"""

import itertools
import re
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from jaxtyping import Float, Int

from taskcal.campaigns.campaign import Campaign
from taskcal.errors import CampaignError, FileError, TaskcalError, shown
from taskcal.geometry import se3
from taskcal.geometry.point_registration import Moments, closed_form, closed_form_rotations, products
from taskcal.reading.columns import MAX_COORDINATE_M, StatedUnits, stated_units
from taskcal.reading.joints import COUNTS_OF_A_DEGREE, within_limits
from taskcal.reading.readings import Readings
from taskcal.reading.rows import split_names
from taskcal.registration.registration import register
from taskcal.registration.rotations import MAX_MISFIT_RAD, MIN_POSES
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot import Robot
from taskcal.tables.table import ANGLES, LENGTHS, PLURALS

# Units that a file does not state, told by what the robot can have done.

MAX_JOINT_RAD = 4 * np.pi + 0.01
"""Joint position, at most, that a controller shows: two turns."""

LIKELY_UNITS = ("mm", "m", "in")
"""Of points that state none."""

MAX_SCATTER_RATIO = 1.8
"""Largest factor between the scatter of points and that of the flange, which a tool's length can explain over many poses. Inches,
millimetres and metres lie further apart."""
MIN_SCATTERED_POSES = 4
"""Poses at least whose scatter is compared. A convention: a tool's length explains that of fewer."""

MAX_SCATTER_M = 50.0
"""Scatter, metres, at most, of points that one instrument measures. A convention: beyond any robot's workspace."""
MAX_MISFIT_RATIO = 0.2
"""Ratio of two misfits, at most, where the better one decides. A nominal robot misses by hundredths of the scatter in the right
units, by tenths in others. A convention."""


def infer_units(
    robot: Robot,
    q: Float[np.ndarray, "n joints"],
    angle: str | None,
    points: Float[np.ndarray, "n 3"] | None,
    length: str | None,
) -> list[tuple[str, str]]:
    """The units of joints and points under which points scatter as the nominal flange does.

    Args:
        robot: the robot.
        q: joint positions, in the unit of `angle` where it is known.
        angle: unit of the joints that turn, where it is known.
        points: measured positions of one target, NaN where it was not seen; None where there are none.
        length: their unit, where it is known.

    Returns:
        Every pair of units under which they fit; one where it can be told.
    """
    angles = [angle] if angle else [unit for unit in ("deg", "rad") if _possible(robot, q, unit)]
    lengths = [length] if length else list(LIKELY_UNITS)
    if points is None:
        return list(itertools.product(angles, ["mm"]))
    seen = ~np.isnan(points[:, 0])
    if seen.sum() < MIN_SCATTERED_POSES:
        return list(itertools.product(angles, lengths))
    measured = _scatter(points[seen])
    out: list[tuple[str, str]] = []
    for unit in angles:
        flange = _scatter(ErrorModel(robot).poses(_in_radians(robot, q[seen], unit))[:, :3, 3])
        out += [
            (unit, other)
            for other in lengths
            if flange > 0 and 1 / MAX_SCATTER_RATIO < measured * LENGTHS[other] / flange < MAX_SCATTER_RATIO
        ]
    return out if len(out) < 2 else _clearly_best(robot, q[seen], points[seen], out)


def infer_length(robot: Robot, points: Float[np.ndarray, "n 3"]) -> str | None:
    """Millimetres or metres, where only one of them spreads the points over a plausible part of the robot's reach, or of a hall.

    Args:
        robot: that reached them.
        points: of unknown unit, NaN where a target was not seen.
    """
    seen = points[~np.isnan(points[:, 0])]
    if len(seen) < 2:
        return None
    scatter = _scatter(seen)
    reached = [unit for unit in ("mm", "m") if 0.01 < scatter * LENGTHS[unit] / robot.reach < 2.0]
    measured = [unit for unit in ("mm", "m") if 1e-3 < scatter * LENGTHS[unit] < MAX_SCATTER_M]
    return next((units[0] for units in (reached, measured) if len(units) == 1), None)


def _clearly_best(
    robot: Robot, q: np.ndarray, points: np.ndarray, pairs: list[tuple[str, str]]
) -> list[tuple[str, str]]:
    """The pair under which the nominal robot fits far better than under any other; all where there is none."""
    misfits = sorted((_unit_misfit(robot, q, points, *pair), pair) for pair in pairs)
    return [misfits[0][1]] if misfits[0][0] < MAX_MISFIT_RATIO * misfits[1][0] else pairs


def _unit_misfit(robot: Robot, q: np.ndarray, points: np.ndarray, angle: str, length: str) -> float:
    """Root mean square misfit of the nominal robot, over the scatter of the points; infinite where it cannot be registered."""
    scaled = points * LENGTHS[length]
    try:
        return register(ErrorModel(robot), _campaign(_in_radians(robot, q, angle), scaled)).rms / _scatter(scaled)
    except TaskcalError:
        return np.inf


def _in_radians(robot: Robot, q: np.ndarray, unit: str) -> np.ndarray:
    return np.where(robot.prismatic, q, q * ANGLES[unit])


def _possible(robot: Robot, q: np.ndarray, unit: str) -> bool:
    """Whether no joint turns further than its limits, or two turns."""
    turned = _in_radians(robot, q, unit)
    if (np.abs(turned[:, ~np.array(robot.prismatic)]) > MAX_JOINT_RAD).any():
        return False
    return not robot.outside_limits(within_limits(robot, turned)[0])


def _scatter(points: np.ndarray) -> float:
    """Root mean square distance from the mean."""
    return float(np.sqrt(np.mean(np.sum((points - points.mean(axis=0)) ** 2, axis=1))))


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
    notes = [f"joints are read in {angle}"] if angle is not None and readings.q is not None else []
    notes += [] if length is None else [f"positions are read in {length}"]
    where = f", as stated above the table: '{shown(stated.where, 60)}'"
    lengths = {} if length is None else dict.fromkeys(readings.points, length)
    out = readings.converted(robot, angle, lengths).noted(" and ".join(notes) + where)
    out = replace(out, length_unit_stated=readings.length_unit_stated or length is not None)
    if out.length_unit_stated:
        refuse_far(out)
    return out


def refuse_far(readings: Readings) -> None:
    """See that all positions, in metres, are within those of any robot.

    Raises:
        FileError: one is not.
    """
    for name, points in readings.points.items():
        for row, axis in np.argwhere(np.abs(points) > MAX_COORDINATE_M)[:1].tolist():
            message = f"{points[row, axis]:g} m is beyond ±{MAX_COORDINATE_M:g} m; check the cell and its unit"
            column = f"{name} {'xyz'[axis]}"
            raise readings.points_error(message, row, column)


def _refuse_contradiction(
    readings: Readings, stated: StatedUnits, robot: Robot, angle: str | None, length: str | None
) -> None:
    if readings.q is None or not readings.points:
        return
    known_angle = "rad" if readings.joint_unit_stated else None
    known_length = "m" if readings.length_unit_stated else None
    for target, points in readings.points.items():
        fitting = infer_units(robot, readings.q, known_angle, points, known_length)
        if len(fitting) == 1 and any(
            unit is not None and unit != fits and (unit in LIKELY_UNITS or unit in ANGLES)
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


MIN_MOVED_M = 0.01
"""Displacement, metres, at most, of a point that stands still. A convention: stands bend and bases drift by less."""

MAX_IN_RADIANS = 10.0
"""Joint position, at most, taken for radians: a turn and a half. A convention: joints that stay within it in degrees hardly
move."""


def with_inferred_units(readings: Readings, robot: Robot) -> Readings:
    """Readings in radians and metres.

    Raises:
        FileError: a unit is stated nowhere and cannot be told.
    """
    if readings.joint_unit_stated and readings.length_unit_stated:
        return readings
    points = next(iter(readings.points.values()), None)
    if readings.q is None and points is not None:
        if (unit := infer_length(robot, points)) is None:
            raise readings.points_error(_unit_of_points([("", "mm"), ("", "m")]), column="x")
        return _scaled(readings, robot, dict.fromkeys(readings.points, unit), f"by the reach of {robot.name}")
    assert readings.q is not None
    angle = "rad" if readings.joint_unit_stated else None
    length = "m" if readings.length_unit_stated else None
    fitting = infer_units(robot, readings.q, angle, points, length)
    angles = {unit for unit, _ in fitting or infer_units(robot, readings.q, angle, None, length)}
    if not readings.joint_unit_stated and len(angles) != 1:
        column = readings.joint_columns[int(np.argmin(robot.prismatic))]
        message = f"the unit is not stated; name the column {column}_deg or {column}_rad"
        if not angles and (outside := robot.outside_limits(_in_radians(robot, readings.q, "deg"))):
            message = (
                f"the unit is not stated, and as degrees {outside[0][1]}, as radians all the more; name the column {column}_deg or "
                f"{column}_rad and look at the joints' signs and order, or, if they are counts of an encoder, {COUNTS_OF_A_DEGREE}"
            )
        elif np.abs(readings.q[:, ~np.array(robot.prismatic)]).max() <= 1.0:
            message += ", or multiply turns by 360"
        raise FileError(readings.path, message, line=1, column=column)
    if not fitting and points is not None and angles == {"deg"} and not readings.joint_unit_stated:
        _refuse_small_angles(readings, robot, readings.q)
    if points is not None and not readings.length_unit_stated and len({unit for _, unit in fitting}) != 1:
        raise readings.points_error(_unit_of_points(fitting), column="x")
    out = readings
    if not readings.joint_unit_stated:
        (unit,) = angles
        said = f"joints without a unit are read as {PLURALS[unit]}, by their size"
        out = readings.converted(robot, unit, {}).noted(said)
    if points is None or readings.length_unit_stated:
        return out
    return _scaled(out, robot, _unit_of_each(out, robot, fitting[0][1]), f"by how far {robot.name} moved")


def _unit_of_each(readings: Readings, robot: Robot, first: str) -> dict[str, str]:
    """The unit of each target's positions, by its own motion, or that of the first where it does not move."""
    assert readings.q is not None
    out: dict[str, str] = {}
    for name, points in readings.points.items():
        units = {unit for _, unit in infer_units(robot, readings.q, "rad", points, None)}
        out[name] = first if first in units or not units else min(units)
        moved = float(np.nanmax(np.ptp(points[~np.isnan(points[:, 0])], axis=0), initial=0.0)) * LENGTHS[first]
        if (len(units - {first}) > 1 and first not in units) or (not units and moved > MIN_MOVED_M):
            column = f"{name}_x"
            raise readings.points_error(f"the unit is not stated; name the column {column}_mm", column=column)
    return out


def _refuse_small_angles(readings: Readings, robot: Robot, q: np.ndarray) -> None:
    """Angles that look like radians, are beyond the robot's limits as such, and as degrees would hardly move it."""
    turning = ~np.array(robot.prismatic)
    if np.abs(q[:, turning]).max() > MAX_IN_RADIANS:
        return
    row, reason = robot.outside_limits(q)[0]
    column = readings.joint_columns[int(np.argmax(turning))]
    message = (
        f"the unit is not stated: as degrees the joints would not move the flange as far as the points, as radians {reason}; "
        f"name the column {column}_deg or {column}_rad, and look at this row"
    )
    raise FileError(readings.path, message, line=int(readings.lines[row]), column=column)


def _scaled(readings: Readings, robot: Robot, units: Mapping[str, str], why: str) -> Readings:
    """Readings whose positions are in a unit for each target, in metres."""
    several = len(set(units.values())) > 1
    if several and "" in readings.uncertainty.keys() - readings.uncertainty_stated:
        raise readings.points_error("the unit of the uncertainty is not stated; name its column u_mm")
    each = (
        ", ".join(f"{name} in {unit}" for name, unit in units.items())
        if several
        else f"in {next(iter(units.values()))}"
    )
    out = readings.converted(robot, None, units).noted(f"positions without a unit are read {each}, {why}")
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


# Which rows of two files belong together.

WINDOW = 10
"""Successive rows that are fitted to find a shift: a frame and a target have nine unknowns, ten points 30 coordinates."""

MAX_WINDOWS = 6
"""Windows, at most, tried for each shift. A convention: of some, both files hold all rows where a few are lost."""

MAX_SHIFT = 30
"""Rows, at most, that one file begins before the other. A convention: who loses more sees it."""

MIN_SHARE = 0.8
"""Share of the shorter file's rows, at least, that must agree. A convention: fewer rows in common are mostly two campaigns."""

MAX_MISFIT_SHARE = 0.01
"""Misfit of a nominal robot over its reach, at most, with rows that belong together. A convention: 20 mm of a reach of 2 m; of
other rows it is tenths of the reach."""


def pair(joints: Readings, points: Readings, robot: Robot) -> Readings:
    """The readings of both files as one: by their ids, or else by their order, or else by what the robot can have done.

    Ids pair rows where both files have them and most of the shorter file's are in the other, whatever the letter case, or
    else the numbers at their ends do (``P7`` and ``Point 007``). Otherwise the order does, where the files have as many
    rows. Otherwise ten successive rows of each are fitted with one shift after another, and where these meet the others
    follow in order, each with the point next to where the robot should be. How it was done is noted.

    Raises:
        FileError: one holds what the other should, or no pairing agrees.
    """
    if joints.q is None and points.q is not None:
        joints, points = points, joints
    if joints.q is None or points.q is not None or not points.points:
        lacking = "both files hold joints" if points.q is not None else "neither file holds points"
        lacking = "neither file holds joints" if joints.q is None else lacking
        raise FileError(points.path, f"{lacking}; one must hold joints, the other points")
    points = _with_poses_of(joints, points)
    rows, note = _rows(joints, points, robot)
    mine, others = joints.take(rows[:, 0]), points.take(rows[:, 1])
    return replace(
        mine,
        **{name: getattr(others, name) for name in _OF_POINTS},
        ids=mine.ids or others.ids,
        left_lengths=(*mine.left_lengths, *others.left_lengths),
        temperature=others.temperature if mine.temperature is None else mine.temperature,
        time=others.time if mine.time is None else mine.time,
        points_path=others.path,
        point_lines=others.lines,
        notes=(*mine.notes, *others.notes, note),
        acted=mine.acted | others.acted,
    )


_OF_POINTS = (
    "points", "length_unit_stated", "uncertainty", "uncertainty_stated", "rotations", "open_angles", "targets_by_row",
)  # fmt: skip
"""What the file of the points states alone."""


def _with_poses_of(joints: Readings, points: Readings) -> Readings:
    """Points whose ids are those of the poses, where the file writes the target behind them."""
    if joints.ids is None or points.ids is None or points.targets_by_row is not None or len(points.points) != 1:
        return points
    split = split_names(points.ids)
    if split is None or len(set(split[0]) & set(joints.ids)) < MIN_SHARE * len(set(split[0])):
        return points
    note = f"ids such as '{points.ids[0]}' are read as pose '{split[0][0]}' and target '{split[1][0]}'"
    return replace(points, ids=split[0], targets_by_row=split[1]).noted(note)


def _rows(joints: Readings, points: Readings, robot: Robot) -> tuple[Int[np.ndarray, "pairs 2"], str]:
    by_name = _by_name(joints.ids, points.ids)
    if by_name is not None:
        return by_name
    if len(joints) == len(points):
        rows = np.tile(np.arange(len(joints))[:, None], (1, 2))
        return (
            rows,
            f"rows of both files are paired by their order, {len(joints)} of each{_agreement(joints, points, robot)}",
        )
    return _by_geometry(joints, points, robot)


def _by_name(mine: tuple[str, ...] | None, others: tuple[str, ...] | None) -> tuple[np.ndarray, str] | None:
    """Rows of the same id, as written or else by the number at its end; None where too few are the same."""
    if mine is None or others is None or _count_from_other_numbers(mine, others):
        return None
    for key, called in ((_plain, "{} ids"), (_number_of, "the numbers of {} ids, which are written in different ways")):
        first, second = [key(name) for name in mine], [key(name) for name in others]
        common = set(first) & set(second) - {""}
        shared = len(common) >= MIN_SHARE * min(len(set(first)), len(set(second)))
        if not shared or (key is _number_of and (len(set(first)) < len(first) or len(set(second)) < len(set(others)))):
            continue
        at = {name: row for row, name in enumerate(first)}
        rows = np.array([(at[name], row) for row, name in enumerate(second) if name in common])
        without = len(set(first) ^ set(second))
        rest = f"; {without} ids are in one file only and left out" if without else ""
        ordered = rows[np.argsort(rows[:, 0], kind="stable")]
        return ordered, f"rows of both files are paired by {called.format(len(common))}{rest}"
    return None


def _count_from_other_numbers(mine: tuple[str, ...], others: tuple[str, ...]) -> bool:
    """Whether both files count as many rows one after another, one from 0 and the other from 1, say."""
    counts = [[int(name) for name in names if re.fullmatch(r"\d{1,9}", name, re.ASCII)] for names in (mine, others)]
    if not len(counts[0]) == len(counts[1]) == len(mine) == len(others):
        return False
    runs = [list(range(count[0], count[0] + len(count))) == count for count in counts]
    return all(runs) and counts[0][0] != counts[1][0]


def _plain(name: str) -> str:
    text = name.strip().casefold()
    # a count that passed through a table of numbers
    return re.sub(r"(?<=\d)\.0+$", "", text) if re.fullmatch(r"\d+\.0+", text, re.ASCII) else text


def _number_of(name: str) -> str:
    """The number at the end of a name, without zeros before it; empty where there is none."""
    match = re.search(r"(\d{1,9})\D?$", _plain(name), re.ASCII)
    return str(int(match[1])) if match else ""


def _agreement(joints: Readings, points: Readings, robot: Robot) -> str:
    """Note on rows paired by order that the nominal robot misses by far; empty otherwise."""
    if len(points.points) != 1 or points.targets_by_row is not None or len(joints) < WINDOW:
        return ""
    (measured,) = points.points.values()
    misfits = [_misfit(ErrorModel(robot).poses(q), scaled) for q, scaled in _in_si(joints, points, robot, measured)]
    least = min(misfits, default=0.0)
    if least < MAX_MISFIT_SHARE * robot.reach:
        return ""
    return (
        f"; the nominal robot misses them by {least * 1e3:.0f} mm: if their order differs, {_with_ids(joints, points)}"
    )


def _by_geometry(joints: Readings, points: Readings, robot: Robot) -> tuple[np.ndarray, str]:
    if len(points.points) != 1 or points.targets_by_row is not None:
        raise FileError(
            points.path, f"has {len(points)} rows, {joints.path.name} {len(joints)}; several targets pair by ids only"
        )
    (measured,) = points.points.values()
    counts = f"{points.path.name} has {len(points)} rows, {joints.path.name} {len(joints)}"
    model = ErrorModel(robot)
    meeting = next(
        (
            (q, scaled, start, other)
            for q, scaled in _in_si(joints, points, robot, measured)
            for T in [model.poses(q)]
            for start, other in _windows(len(q), len(scaled))
            if _misfit(T[start : start + WINDOW], scaled[other : other + WINDOW]) < MAX_MISFIT_SHARE * robot.reach
        ),
        None,
    )
    if meeting is None:
        raise FileError(
            points.path, f"{counts}, and no {WINDOW} successive rows fit together; {_with_ids(joints, points)}"
        )
    q, scaled, start, other = meeting
    rows = _in_order(model, q, scaled, start, other)
    share = len(rows) / min(len(q), len(scaled))
    if share < MIN_SHARE:
        raise FileError(
            points.path, f"{counts}, and only {share:.0%} of them fit together in order; {_with_ids(joints, points)}"
        )
    return (
        rows,
        f"rows of both files are paired by geometry: {len(rows)} fit together, {share:.0%} of the shorter file ({counts})",
    )


def _with_ids(joints: Readings, points: Readings) -> str:
    """What would pair two files, in words; of logs with times that they are not paired by these."""
    if not all(one.time is not None or _LEFT_TIMES.search("\n".join(one.notes)) for one in (joints, points)):
        return "give both files ids"
    return (
        "both are logs with times, which do not pair them: keep one row of each pose at rest in both, and give it an id"
    )


_LEFT_TIMES = re.compile(
    r"columns? left out: .*\b(?:date|time|timestamp|datum|zeit|uhrzeit|zeitstempel)", re.IGNORECASE
)
"""A note on a column of clock times that was left out."""


def _windows(joints: int, points: int) -> list[tuple[int, int]]:
    """First rows of the windows in each file, small shifts first."""
    shifts = sorted(range(-MAX_SHIFT, MAX_SHIFT + 1), key=abs)
    starts = np.unique(np.linspace(0, max(0, joints - WINDOW), MAX_WINDOWS).astype(int)).tolist()
    return [
        (start, start + shift) for shift in shifts for start in starts if 0 <= start + shift <= max(0, points - WINDOW)
    ]


def _in_si(
    joints: Readings, points: Readings, robot: Robot, measured: np.ndarray
) -> list[tuple[Float[np.ndarray, "n joints"], Float[np.ndarray, "m 3"]]]:
    """Both in radians and metres, in every unit that can be meant."""
    assert joints.q is not None
    angles = [unit for unit, _ in infer_units(robot, joints.q, "rad" if joints.joint_unit_stated else None, None, None)]
    lengths = ["m"] if points.length_unit_stated else [*LIKELY_UNITS]
    return [(_in_radians(robot, joints.q, angle), measured * LENGTHS[length]) for angle in angles for length in lengths]


def _misfit(T: Float[np.ndarray, "n 4 4"], points: Float[np.ndarray, "m 3"]) -> float:
    """Root mean square distance of as many points as poses to the nominal robot's, frame and target in closed form; metres."""
    n = min(len(T), len(points))
    seen = ~np.isnan(points[:n, 0])
    if seen.sum() < WINDOW // 2:
        return np.inf
    R, p, y = T[:n][seen, :3, :3], T[:n][seen, :3, 3], points[:n][seen]
    Z = closed_form(Moments.of(R, p, y, np.zeros(len(y), dtype=int), 1))
    # with the rotation known, the target and the frame's origin are linear: Z R o + t = y − Z p
    A = np.concatenate([Z @ R, np.broadcast_to(np.eye(3), R.shape)], axis=2).reshape(-1, 6)
    b = (y - p @ Z.T).ravel()
    residual = b - A @ np.linalg.lstsq(A, b, rcond=1e-6)[0]
    return float(np.sqrt(np.mean(residual**2) * 3))


def _campaign(q: np.ndarray, points: np.ndarray) -> Campaign:
    return Campaign(ids=tuple(map(str, range(len(q)))), q=q, targets=("tool",), points=points[:, None])


def _in_order(model: ErrorModel, q: np.ndarray, points: np.ndarray, start: int, shift: int) -> np.ndarray:
    """Pairs in rising order on both sides, beginning at rows that belong together."""
    count = min(WINDOW, len(q) - start, len(points) - shift)
    rows = np.stack([start + np.arange(count), shift + np.arange(count)], axis=1)
    for _ in range(2):
        found = register(model, _campaign(q[rows[:, 0]], points[rows[:, 1]]))
        predicted = (found.T_tracker_base @ model.poses(q) @ found.T_tool_target[0])[:, :3, 3]
        near = np.linalg.norm(predicted[:, None] - points[None], axis=2)
        rows = _rising(near, limit=max(5 * found.rms, 1e-3))
    return rows


def _rising(near: Float[np.ndarray, "n m"], limit: float) -> np.ndarray:
    """The most pairs nearer than a limit whose rows rise on both sides (longest common subsequence)."""
    fits = near < limit
    n, m = near.shape
    length = np.zeros((n + 1, m + 1), dtype=int)
    for i in range(n - 1, -1, -1):
        for j in range(m - 1, -1, -1):
            length[i, j] = length[i + 1, j + 1] + 1 if fits[i, j] else max(length[i + 1, j], length[i, j + 1])
    pairs: list[tuple[int, int]] = []
    i = j = 0
    while i < n and j < m:
        if fits[i, j]:
            pairs.append((i, j))
            i, j = i + 1, j + 1
        elif length[i + 1, j] >= length[i, j + 1]:
            i += 1
        else:
            j += 1
    return np.array(pairs, dtype=int).reshape(-1, 2)


# Which convention three angles follow whose names leave it open, told by what the robot can have done.

MAX_POSES = 200
"""Poses, at most, that are looked at, spread over all. A convention that bounds the time."""

MAX_CALCULATED_RAD = 1e-5
"""Misfit under which angles of no certain meaning are the controller's own: no robot is built and measured so well."""


def with_convention(readings: Readings, robot: Robot) -> Readings:
    """Readings whose orientations follow the convention under which the nominal robot fits them.

    Where none fits far better than the others, it is the usual one of their names. A note says which it was, and what changes it.

    Args:
        readings: joints in radians and metres.
        robot: that was measured.
    """
    angles = readings.open_angles
    if angles is None:
        return readings
    misfits = {} if readings.q is None else _misfits(readings, robot)
    ranked = sorted(misfits, key=lambda form: misfits[form])
    readings = replace(readings, open_angles=None)
    # the first of rising misfits is small, and far smaller than the second
    if len(ranked) < 2 or misfits[ranked[0]] > min(MAX_MISFIT_RAD, MAX_MISFIT_RATIO * misfits[ranked[1]]):
        none_fits = ""
        if ranked and (least := misfits[ranked[0]]) > MAX_MISFIT_RAD:
            none_fits = f"; none fits the nominal robot: even as {ranked[0]} it misses them by {np.degrees(least):.0f}°"
        return _as_assumed(readings, angles.columns, angles.assumed, list(angles.meanings), none_fits)
    best, second = ranked[:2]
    off, other_off = np.degrees(misfits[best]), np.degrees(misfits[second])
    compared = f"the nominal robot misses them by {off:.2f}°, as {second} by {other_off:.2f}°"
    if angles.assumed is None and (misfits[best] < MAX_CALCULATED_RAD or len(readings.points) > 1):
        why = (
            "several targets are measured" if len(readings.points) > 1 else "they are what the nominal robot calculates"
        )
        return readings.noted(f"{angles.columns} are left out, since {why}; --angles {best} uses them")
    note = f"{angles.columns} are read as {best}, by what fits: {compared}; --angles changes that"
    return replace(readings, rotations={"": angles.meanings[best]}).noted(note)


def _as_assumed(readings: Readings, columns: str, assumed: str | None, forms: list[str], misfit: str) -> Readings:
    if assumed is None:
        why = "they may be angles about fixed or moving axes or a rotation vector, in degrees or radians"
        return readings.noted(
            f"{columns} are left out, since {why}; to use them state --angles {' | '.join(forms)}{misfit}"
        )
    others = " or ".join(form for form in forms if form != assumed)
    note = f"{columns} are read as {assumed}, the usual meaning of these names; if they are {others}, state --angles{misfit}"
    return readings.noted(note)


def _misfits(readings: Readings, robot: Robot) -> dict[str, float]:
    """Root mean square angle between measured orientations and the registered nominal robot's, by what the angles may mean.

    Nothing where there are too few poses, or the robot cannot take one.
    """
    assert readings.open_angles is not None
    assert readings.q is not None
    seen = np.ones(len(readings), dtype=bool)
    for points in readings.points.values():
        seen &= ~np.isnan(points[:, 0])
    rows = np.flatnonzero(seen & np.isfinite(readings.q).all(axis=1))
    if len(rows) < MIN_POSES:
        return {}
    rows = rows[np.unique(np.linspace(0, len(rows) - 1, min(len(rows), MAX_POSES)).astype(int))]
    try:
        R = ErrorModel(robot).poses(readings.q[rows])[:, :3, :3]
    except CampaignError:
        return {}
    out: dict[str, float] = {}
    for form, measured in readings.open_angles.meanings.items():
        Z, X = closed_form_rotations(products(R, measured[rows]))
        off = se3.log(np.swapaxes(Z @ R @ X, 1, 2) @ measured[rows])
        out[form] = float(np.sqrt(np.mean(np.sum(off**2, axis=1))))
    return out
