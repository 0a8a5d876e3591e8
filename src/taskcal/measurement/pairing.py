"""Joints in one file and points in another: which rows belong together."""

import re
from dataclasses import replace

import numpy as np
from jaxtyping import Float, Int

from taskcal.errors import FileError
from taskcal.measurement.campaign import Campaign
from taskcal.measurement.readings import Readings
from taskcal.measurement.registration import register
from taskcal.measurement.registration_moments import Moments
from taskcal.measurement.registration_start import closed_form
from taskcal.measurement.target_names import split_names
from taskcal.measurement.unit_inference import infer_units
from taskcal.measurement.units import ANGLES, LENGTHS
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot import Robot

WINDOW = 10
"""Successive rows that are fitted to find a shift: a frame and a target have nine unknowns, ten points 30 coordinates."""

MAX_WINDOWS = 6
"""Tried for each shift: of some both files hold all rows, where a few are lost."""

MAX_SHIFT = 30
"""Rows that one file may begin before the other."""

MIN_SHARE = 0.8
"""Of the shorter file's rows that must agree where geometry pairs them."""

_PER_REACH = 0.01
"""Misfit of a nominal robot over its reach at most, with rows that belong together; with others it is tenths of the reach."""


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
        raise FileError(points.path, f"{_lacking(joints, points)}; one must hold joints, the other points")
    points = _with_poses_of(joints, points)
    rows, note = _rows(joints, points, robot)
    mine, others = joints.take(rows[:, 0]), points.take(rows[:, 1])
    return replace(
        mine,
        ids=mine.ids or others.ids,
        points=others.points,
        length_unit_stated=others.length_unit_stated,
        uncertainty=others.uncertainty,
        uncertainty_stated=others.uncertainty_stated,
        rotations=others.rotations,
        open_angles=others.open_angles,
        rotated=others.rotated,
        other_rotations=others.other_rotations,
        left_lengths=(*mine.left_lengths, *others.left_lengths),
        temperature=others.temperature if mine.temperature is None else mine.temperature,
        time=others.time if mine.time is None else mine.time,
        targets_by_row=others.targets_by_row,
        notes=(*mine.notes, *others.notes, note),
    )


def _with_poses_of(joints: Readings, points: Readings) -> Readings:
    """Points whose ids are those of the poses, where the file writes the target behind them."""
    if joints.ids is None or points.ids is None or points.targets_by_row is not None or len(points.points) != 1:
        return points
    split = split_names(points.ids)
    if split is None or len(set(split[0]) & set(joints.ids)) < MIN_SHARE * len(set(split[0])):
        return points
    note = f"ids such as '{points.ids[0]}' are read as pose '{split[0][0]}' and target '{split[1][0]}'"
    return replace(points, ids=split[0], targets_by_row=split[1], notes=(*points.notes, note))


def _lacking(joints: Readings, points: Readings) -> str:
    """Why two files are no joints and points."""
    if joints.q is None:
        return "neither file holds joints"
    return "both files hold joints" if points.q is not None else "neither file holds points"


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
    """What is said of rows paired by order that the nominal robot misses by far; empty where it does not."""
    if len(points.points) != 1 or points.targets_by_row is not None or len(joints) < WINDOW:
        return ""
    (measured,) = points.points.values()
    misfits = [_misfit(ErrorModel(robot).poses(q), scaled) for q, scaled in _in_si(joints, points, robot, measured)]
    least = min(misfits, default=0.0)
    if least < _PER_REACH * robot.reach:
        return ""
    return f"; the nominal robot misses them by {least * 1e3:.0f} mm: if their order differs, give both files ids"


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
            if _misfit(T[start : start + WINDOW], scaled[other : other + WINDOW]) < _PER_REACH * robot.reach
        ),
        None,
    )
    if meeting is None:
        raise FileError(points.path, f"{counts}, and no {WINDOW} successive rows fit together; give both files ids")
    q, scaled, start, other = meeting
    rows = _in_order(model, q, scaled, start, other)
    share = len(rows) / min(len(q), len(scaled))
    if share < MIN_SHARE:
        raise FileError(
            points.path, f"{counts}, and only {share:.0%} of them fit together in order; give both files ids"
        )
    return (
        rows,
        f"rows of both files are paired by geometry: {len(rows)} fit together, {share:.0%} of the shorter file ({counts})",
    )


def _windows(joints: int, points: int) -> list[tuple[int, int]]:
    """Where to begin in each file, small shifts first."""
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
    lengths = ["m"] if points.length_unit_stated else ["mm", "m", "in"]
    return [
        (np.where(robot.prismatic, joints.q, joints.q * ANGLES[angle]), measured * LENGTHS[length])
        for angle in angles
        for length in lengths
    ]


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
