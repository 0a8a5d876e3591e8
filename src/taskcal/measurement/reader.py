"""Reading a campaign from CSV: which columns there are, and what each cell must hold."""

import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float

from taskcal.arguments import expect_kinds, renamed_arguments
from taskcal.errors import shown
from taskcal.geometry import se3
from taskcal.measurement.campaign import Campaign
from taskcal.robot.approach import conditions_in_order
from taskcal.robot.conditions import Conditions
from taskcal.robot.robot import Robot
from taskcal.tabular.column_groups import QUATERNION, ColumnGroups, joint_scale
from taskcal.tabular.csv_form import read_csv

_POINT = re.compile(r"(?:(?P<name>.+)_)?(?P<axis>[xyz])_(?P<unit>mm|m|um|in)$")
LEAVE_EMPTY = "give a number, or leave all the target's cells empty"

MAX_TIME_S = 1e7
"""No robot works so many seconds before it is measured; clocks count more."""

_COUNT = re.compile(r"[0-9]{1,15}")

MAX_TARGETS = 100
"""On one tool; plates for trackers carry up to a dozen reflectors, and the fit's matrices grow with the square."""


@renamed_arguments(nests="reference_points")
def read_campaign(
    path: str | Path,
    robot: Robot,
    *,
    targets: Sequence[str] | None = None,
    reference_points: Sequence[str] | None = None,
) -> Campaign:
    """Read a campaign.

    Columns: ``id``; joints as ``J1_deg``, ``q1_deg``, ``q1_rad`` or the robot's own joint names with ``_deg`` or
    ``_rad`` (``_mm`` where a joint slides); one target as ``x_mm y_mm z_mm``, several as ``NAME_x_mm …``, or a pose with
    ``qx qy qz qw``; optionally ``u_mm`` or ``NAME_u_mm`` (standard uncertainty per axis), ``temp_C``, ``time_s`` (since
    the robot began to work), and for each joint ``J1_approach``, the way its drive turned last (1 up, −1 down, 0 unknown),
    and ``J1_move_deg``, how far. Letter case does not matter. A target whose three cells are all empty or all zero is a lost beam.

    Without such columns the rows are taken in the order of measurement. Where their ids are rising whole numbers, a step
    larger than the usual one says that rows were left out, and the way is unknown there.

    Args:
        path: the CSV.
        robot: the robot that was measured.
        targets: the targets to read; all that are not reference points by default.
        reference_points: fixed points beside the robot; targets whose name begins with ``base`` by default.

    Raises:
        FileError: with file, line, column, value and a remedy, for anything that cannot be read as a campaign.
    """
    expect_kinds({"robot": Robot}, robot=robot)
    columns = ColumnGroups(read_csv(path))
    ids = _ids(columns)
    q = columns.joints(robot)
    points = _points(columns)
    reference_names = (
        [n for n in points if n.lower().startswith("base")]
        if reference_points is None
        else _among(columns, reference_points, points)
    )
    if targets is None:
        target_names = [n for n in points if n not in reference_names]
    else:
        target_names = _among(columns, targets, points)
        reference_names = [n for n in reference_names if n not in target_names]
    if len(target_names) > MAX_TARGETS:
        raise columns.refusal(f"names {len(target_names)} targets; Taskcal fits {MAX_TARGETS} at most: choose some")
    if not target_names:
        raise columns.refusal("names no target; give columns x_mm, y_mm, z_mm, or NAME_x_mm, NAME_y_mm, NAME_z_mm")
    rotations = _rotations(columns, target_names, points)
    uncertainty = _uncertainty(columns, target_names)
    conditions = replace(_ways(columns, robot, q, ids), temperature=_temperature(columns), time=_time(columns))
    columns.refuse_unused(
        f"a campaign has id, joints ({robot.joint_names[0]}_deg …), targets (x_mm … or NAME_x_mm …), qx qy qz qw, u_mm, temp_C, "
        f"time_s, {robot.joint_names[0]}_approach …"
    )
    if not len(columns):
        raise columns.error("has no measurements below its header")
    outside = robot.outside_limits(q)
    if outside:
        row, reason = outside[0]
        count = len({r for r, _ in outside})
        raise columns.error(
            f"{reason} ({count} of {len(q)} rows are outside the limits of {robot.name}); check the units, the order of the "
            "joints and their signs, or widen the limits in the robot file",
            row,
        )
    return Campaign(
        ids=ids,
        q=q,
        targets=tuple(target_names),
        points=np.stack([points[name] for name in target_names], axis=1),
        rotations=rotations,
        uncertainty=uncertainty,
        reference_points={name: points[name] for name in reference_names},
        conditions=conditions,
        source=Path(path).name,
        lines=np.array(columns.table.lines),
    )


def _ids(columns: ColumnGroups) -> tuple[str, ...]:
    if "id" not in columns:
        raise columns.refusal("has no column 'id'; name every row, with numbers if nothing better")
    ids = columns.texts("id")
    seen: dict[str, int] = {}
    for row, text in enumerate(ids):
        if not text:
            raise columns.error("the row has no id; give each row its own", row, "id")
        if text in seen:
            line = columns.table.lines[seen[text]]
            raise columns.error(f"id '{shown(text)}' stands in line {line} already; give each row its own", row, "id")
        seen[text] = row
    return tuple(ids)


def _temperature(columns: ColumnGroups) -> Float[np.ndarray, " n"] | None:
    """Of the robot, °C."""
    return columns.numbers("temp_C", empty=True) if "temp_C" in columns else None


def _time(columns: ColumnGroups) -> Float[np.ndarray, " n"] | None:
    """Seconds since the robot began to work."""
    if "time_s" not in columns:
        return None
    time = columns.numbers("time_s", empty=True, largest=np.inf)
    wrong = np.flatnonzero((time < 0.0) | (time > MAX_TIME_S))
    if len(wrong):
        message = f"{time[wrong[0]]:g} s is not a time since the robot began to work; subtract the time when it did"
        raise columns.error(message, int(wrong[0]), "time_s")
    return time


def _ways(columns: ColumnGroups, robot: Robot, q: Float[np.ndarray, "n joints"], ids: tuple[str, ...]) -> Conditions:
    """How each row was reached: by columns, or else by the order of the rows."""
    lacking = "; give it, with 0 where it is unknown"
    approaches = columns.joint_columns(robot, [("approach",)] * len(robot.joints), lacking)
    approach = columns.side_by_side(approaches, remedy="give 1, -1, or 0 where it is unknown") if approaches else None
    if approach is not None:
        for row, j in zip(*np.nonzero(~np.isin(approach, (-1.0, 0.0, 1.0))), strict=True):
            message = f"{approach[row, j]:g} is not a way of approach; give 1 (the joint's value grew), -1 (it fell) or 0 (unknown)"
            raise columns.error(message, int(row), approaches[j])
    endings = [("move_mm", "move_m") if slides else ("move_deg", "move_rad") for slides in robot.prismatic]
    moves = columns.joint_columns(robot, endings, lacking)
    if not moves and approach is None:
        return conditions_in_order(robot, q, _follows(ids))
    move = None
    if moves:
        move = columns.side_by_side(moves, remedy="give the last move, or 0 where it is unknown") * joint_scale(moves)
        approach = np.sign(move) if approach is None else approach
    return Conditions(approach=approach, move=move)


def _follows(ids: tuple[str, ...]) -> Bool[np.ndarray, " n"] | None:
    """Whether each row was measured after the one before it, as far as ids that count tell."""
    if len(ids) < 3 or not all(_COUNT.fullmatch(text) for text in ids):
        return None
    steps = np.diff([int(text) for text in ids])
    return None if steps.min() <= 0 else np.concatenate([[False], steps <= np.median(steps)])


def _points(columns: ColumnGroups) -> dict[str, Float[np.ndarray, "n 3"]]:
    """Points of every target and reference point, metres; NaN for a lost beam."""
    out: dict[str, np.ndarray] = {}
    for label in _labels(columns):
        prefix = f"{label}_" if label else ""
        points = columns.points(prefix, empty=True, remedy=LEAVE_EMPTY)
        blank = np.isnan(points)
        partial = np.flatnonzero(blank.any(axis=1) & ~blank.all(axis=1))
        if len(partial):
            row = int(partial[0])
            message = "the cell is empty while its target's others are not; leave all three empty for a lost beam, or drop the row"
            raise columns.error(message, row, f"{prefix}{'xyz'[int(np.argmax(blank[row]))]}_mm")
        points[(points == 0.0).all(axis=1)] = np.nan
        out[label or "tool"] = points
    return out


def _labels(columns: ColumnGroups) -> list[str]:
    """Names of targets and reference points, as the file writes them first; one may be empty."""
    labels: dict[str, str] = {}
    for lower, name in columns.names.items():
        match = _POINT.match(lower)
        if match is None:
            if re.match(r"(?:.+_)?[xyz]$", lower) and not columns.is_used(lower):
                raise columns.refusal(f"the unit is not stated; name the column {name}_mm", name)
            continue
        if match["unit"] != "mm":
            raise columns.refusal(f"positions are in millimetres; give {name[: -len(match['unit'])]}mm", name)
        labels.setdefault(match["name"] or "", name[: -len("_x_mm")] if match["name"] else "")
    return list(labels.values())


def _among(columns: ColumnGroups, wanted: Sequence[str], points: dict[str, np.ndarray]) -> list[str]:
    by_case = {name.lower(): name for name in points}
    for name in wanted:
        if name.lower() not in by_case:
            raise columns.refusal(f"has no target '{name}'; it has {shown(', '.join(points) or 'none')}")
    return [by_case[name.lower()] for name in wanted]


def _rotations(
    columns: ColumnGroups, targets: list[str], points: dict[str, np.ndarray]
) -> Float[np.ndarray, "n 3 3"] | None:
    if not columns.together(QUATERNION, "a pose needs qx qy qz qw"):
        return None
    if len(targets) > 1:
        raise columns.refusal(f"a pose has one target, this file names {', '.join(targets)}; choose one")
    return se3.from_quaternion(columns.quaternions(needed=~np.isnan(points[targets[0]][:, 0])))


def _uncertainty(columns: ColumnGroups, targets: list[str]) -> Float[np.ndarray, "n targets"] | None:
    names = [next((c for c in (f"{t}_u_mm", "u_mm") if c in columns), None) for t in targets]
    stated = [name for name in names if name is not None]
    if not stated:
        return None
    if len(stated) < len(targets):
        without = targets[names.index(None)]
        raise columns.refusal(f"states the uncertainty of some targets but not of '{without}'; give {without}_u_mm")
    out = columns.side_by_side(stated)
    for row, t in zip(*np.nonzero(out <= 0), strict=True):
        message = f"{out[row, t]:g} is not a standard uncertainty; give one above zero"
        raise columns.error(message, int(row), stated[t])
    return out * 1e-3
