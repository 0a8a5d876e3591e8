"""Reading a campaign from CSV: which columns there are, and what each cell must hold."""

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float

from taskcal.csv_table import CsvTable, read_csv
from taskcal.errors import FileError, shown
from taskcal.geometry import se3
from taskcal.measurement.campaign import Campaign
from taskcal.robot.approach import conditions_in_order
from taskcal.robot.conditions import Conditions
from taskcal.robot.robot import Robot

_POINT = re.compile(r"(?:(?P<name>.+)_)?(?P<axis>[xyz])_(?P<unit>mm|m|um|in)$")
_QUATERNION = ("qx", "qy", "qz", "qw")
_JOINT_UNITS = {"deg": np.pi / 180, "rad": 1.0, "mm": 1e-3, "m": 1.0}
LEAVE_OUT = "give a number, or leave out the row"
LEAVE_EMPTY = "give a number, or leave all the target's cells empty"

LONGEST = 1e7
"""No robot works so many seconds before it is measured; clocks count more."""

_COUNT = re.compile(r"[0-9]{1,15}")

MOST_TARGETS = 100
"""On one tool; plates for trackers carry up to a dozen reflectors, and the fit's matrices grow with the square."""

_UNIT_QUATERNION = 1e-3
"""How far a quaternion's length may be from one: files round to a few digits."""


def read_campaign(
    path: str | Path, robot: Robot, *, targets: Sequence[str] | None = None, nests: Sequence[str] | None = None
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
        targets: the targets to read; all that are not nests by default.
        nests: fixed points beside the robot; targets whose name begins with ``base`` by default.

    Raises:
        FileError: with file, line, column, value and a remedy, for anything that cannot be read as a campaign.
    """
    table = read_csv(path)
    lowered = [name.lower() for name in table.header]
    twice = [name for name, times in Counter(lowered).items() if times > 1]
    if twice:
        raise FileError(table.path, f"two columns are named '{shown(min(twice))}' but for letter case", line=1)
    names = dict(zip(lowered, table.header, strict=True))
    used: set[str] = set()
    ids = _ids(table, names, used)
    q = _joints(table, names, robot, used)
    found = _points(table, names, used)
    nest_names = [n for n in found if n.lower().startswith("base")] if nests is None else _among(table, nests, found)
    if targets is None:
        target_names = [n for n in found if n not in nest_names]
    else:
        target_names = _among(table, targets, found)
        nest_names = [n for n in nest_names if n not in target_names]
    if len(target_names) > MOST_TARGETS:
        message = f"names {len(target_names)} targets; Taskcal fits {MOST_TARGETS} at most: choose some"
        raise FileError(table.path, message, line=1)
    if not target_names:
        raise FileError(
            table.path, "names no target; give columns x_mm, y_mm, z_mm, or NAME_x_mm, NAME_y_mm, NAME_z_mm", line=1
        )
    rotations = _rotations(table, names, used, target_names, found)
    uncertainty = _uncertainty(table, names, used, target_names)
    ways = _ways(table, names, robot, used, q, ids)
    conditions = replace(ways, temperature=_temperature(table, names, used), time=_time(table, names, used))
    unknown = [name for lower, name in names.items() if lower not in used]
    if unknown:
        named = shown(", ".join(repr(n) for n in unknown))
        raise FileError(
            table.path,
            f"unknown column{'s' if len(unknown) > 1 else ''} {named}; a campaign has id, joints "
            f"({robot.joint_names[0]}_deg …), targets (x_mm … or NAME_x_mm …), qx qy qz qw, u_mm, temp_C, time_s, "
            f"{robot.joint_names[0]}_approach …",
            line=1,
        )
    if not len(table):
        raise FileError(table.path, "has no measurements below its header")
    outside = robot.outside_limits(q)
    if outside:
        row, reason = outside[0]
        count = len({r for r, _ in outside})
        raise table.error(
            f"{reason} ({count} of {len(q)} rows are outside the limits of {robot.name}); check the units, the order of the "
            "joints and their signs, or widen the limits in the robot file",
            row,
        )
    return Campaign(
        ids=ids,
        q=q,
        targets=tuple(target_names),
        points=np.stack([found[name] for name in target_names], axis=1),
        rotations=rotations,
        uncertainty=uncertainty,
        nests={name: found[name] for name in nest_names},
        conditions=conditions,
        source=Path(path).name,
        lines=np.array(table.lines),
    )


def _ids(table: CsvTable, names: dict[str, str], used: set[str]) -> tuple[str, ...]:
    if "id" not in names:
        raise FileError(table.path, "has no column 'id'; name every row, with numbers if nothing better", line=1)
    used.add("id")
    ids = table.texts(names["id"])
    seen: dict[str, int] = {}
    for row, text in enumerate(ids):
        if not text:
            raise table.error("the row has no id; give each row its own", row, names["id"])
        if text in seen:
            raise table.error(
                f"id '{shown(text)}' stands in line {table.lines[seen[text]]} already; give each row its own",
                row,
                names["id"],
            )
        seen[text] = row
    return tuple(ids)


def _joints(table: CsvTable, names: dict[str, str], robot: Robot, used: set[str]) -> Float[np.ndarray, "n joints"]:
    columns: list[np.ndarray] = []
    for number, joint in enumerate(robot.joint_names, start=1):
        units = ("mm", "m") if robot.prismatic[number - 1] else ("deg", "rad")
        spellings = dict.fromkeys(s.lower() for s in (joint, f"J{number}", f"q{number}"))
        found = [(f"{s}_{u}", u) for s in spellings for u in units if f"{s}_{u}" in names]
        if len(found) > 1:
            both = " and ".join(repr(names[c]) for c, _ in found)
            raise FileError(table.path, f"joint {joint} is given twice, by {both}; keep one", line=1)
        if not found:
            bare = [names[s] for s in spellings if s in names]
            if bare:
                wanted = " or ".join(f"{bare[0]}_{u}" for u in units)
                raise FileError(table.path, f"the unit is not stated; name the column {wanted}", line=1, column=bare[0])
            raise FileError(
                table.path,
                f"has no column for joint {joint} of {robot.name}; it needs one for each of {', '.join(robot.joint_names)}, "
                f"such as {joint}_{units[0]} or q{number}_{units[1]}",
                line=1,
            )
        column, unit = found[0]
        used.add(column)
        columns.append(table.numbers(names[column], remedy=LEAVE_OUT) * _JOINT_UNITS[unit])
    extra = f"j{len(robot.joints) + 1}"
    surplus = [n for lower, n in names.items() if re.match(rf"({extra}|q{extra[1:]})_(deg|rad)$", lower)]
    if surplus:
        raise FileError(
            table.path,
            f"'{surplus[0]}' is a joint that {robot.name} does not have; it has {len(robot.joints)}: is it the right robot?",
            line=1,
        )
    return np.stack(columns, axis=1)


def _temperature(table: CsvTable, names: dict[str, str], used: set[str]) -> Float[np.ndarray, " n"] | None:
    """Of the robot, °C."""
    if "temp_c" not in names:
        return None
    used.add("temp_c")
    return table.numbers(names["temp_c"], empty=True)


def _time(table: CsvTable, names: dict[str, str], used: set[str]) -> Float[np.ndarray, " n"] | None:
    """Seconds since the robot began to work."""
    if "time_s" not in names:
        return None
    used.add("time_s")
    time = table.numbers(names["time_s"], empty=True, largest=np.inf)
    wrong = np.flatnonzero((time < 0.0) | (time > LONGEST))
    if len(wrong):
        message = f"{time[wrong[0]]:g} s is no time since the robot began to work; subtract the time when it did"
        raise table.error(message, int(wrong[0]), names["time_s"])
    return time


def _ways(
    table: CsvTable,
    names: dict[str, str],
    robot: Robot,
    used: set[str],
    q: Float[np.ndarray, "n joints"],
    ids: tuple[str, ...],
) -> Conditions:
    """How each row was reached: by columns, or else by the order of the rows."""
    ways = [("approach",)] * len(robot.joints)
    approach, columns = _of_joints(table, names, robot, used, ways, "give 1, -1, or 0 where it is unknown")
    if approach is not None:
        for row, j in zip(*np.nonzero(~np.isin(approach, (-1.0, 0.0, 1.0))), strict=True):
            message = f"{approach[row, j]:g} is no way of approach; give 1 (the joint's value grew), -1 (it fell), or 0 (unknown)"
            raise table.error(message, int(row), columns[j])
    moves = [("move_mm", "move_m") if slides else ("move_deg", "move_rad") for slides in robot.prismatic]
    move, columns = _of_joints(table, names, robot, used, moves, "give the last move, or 0 where it is unknown")
    if move is None and approach is None:
        return conditions_in_order(robot, q, _follows(ids))
    if move is not None:
        move *= [_JOINT_UNITS[column.lower().rpartition("_")[2]] for column in columns]
        approach = np.sign(move) if approach is None else approach
    return Conditions(approach=approach, move=move)


def _of_joints(
    table: CsvTable, names: dict[str, str], robot: Robot, used: set[str], kinds: list[tuple[str, ...]], remedy: str
) -> tuple[Float[np.ndarray, "n joints"] | None, list[str]]:
    """A number of each joint, in columns such as ``J1_approach``, and the columns' names; None where there are none."""
    columns: list[str | None] = []
    for number, (joint, suffixes) in enumerate(zip(robot.joint_names, kinds, strict=True), start=1):
        spellings = dict.fromkeys(s.lower() for s in (joint, f"J{number}", f"q{number}"))
        found = [names[c] for s in spellings for u in suffixes if (c := f"{s}_{u}") in names]
        if len(found) > 1:
            both = " and ".join(map(repr, found))
            raise FileError(table.path, f"the same of joint {joint} is given twice, by {both}; keep one", line=1)
        columns.append(found[0] if found else None)
    stated = [c for c in columns if c is not None]
    if stated and len(stated) < len(columns):
        j = columns.index(None)
        wanted = f"{robot.joint_names[j]}_{kinds[j][0]}"
        raise FileError(
            table.path, f"has '{stated[0]}' but no column '{wanted}'; give it, with 0 where it is unknown", line=1
        )
    used.update(c.lower() for c in stated)
    return np.stack([table.numbers(c, remedy=remedy) for c in stated], axis=1) if stated else None, stated


def _follows(ids: tuple[str, ...]) -> Bool[np.ndarray, " n"] | None:
    """Whether each row was measured after the one before it, as far as ids that count tell."""
    if len(ids) < 3 or not all(_COUNT.fullmatch(text) for text in ids):
        return None
    steps = np.diff([int(text) for text in ids])
    return None if steps.min() <= 0 else np.concatenate([[False], steps <= np.median(steps)])


def _points(table: CsvTable, names: dict[str, str], used: set[str]) -> dict[str, Float[np.ndarray, "n 3"]]:
    """Points of every target and nest, metres; NaN for a lost beam."""
    columns: dict[str, dict[str, str]] = {}
    for lower, name in names.items():
        match = _POINT.match(lower)
        if match is None:
            bare = re.match(r"(?:.+_)?[xyz]$", lower)
            if bare and lower not in used:
                raise FileError(table.path, f"the unit is not stated; name the column {name}_mm", line=1, column=name)
            continue
        if match["unit"] != "mm":
            raise FileError(
                table.path, f"positions are in millimetres; give {name[: -len(match['unit'])]}mm", line=1, column=name
            )
        used.add(lower)
        label = name[: -len("_x_mm")] if match["name"] else ""
        columns.setdefault(label, {})[match["axis"]] = name
    out: dict[str, np.ndarray] = {}
    for label, axes in columns.items():
        lacking = [axis for axis in "xyz" if axis not in axes]
        if lacking:
            prefix = f"{label}_" if label else ""
            wanted = f"{prefix}{lacking[0]}_mm"
            raise FileError(table.path, f"has no column '{wanted}' beside '{next(iter(axes.values()))}'", line=1)
        cells = np.stack([table.numbers(axes[axis], empty=True, remedy=LEAVE_EMPTY) for axis in "xyz"], axis=1)
        blank = np.isnan(cells)
        partial = np.flatnonzero(blank.any(axis=1) & ~blank.all(axis=1))
        if len(partial):
            row = int(partial[0])
            column = axes["xyz"[int(np.argmax(blank[row]))]]
            message = "the cell is empty while its target's others are not; leave all three empty for a lost beam, or drop the row"
            raise table.error(message, row, column)
        cells[(cells == 0.0).all(axis=1)] = np.nan
        out[label or "tool"] = cells * 1e-3
    return out


def _among(table: CsvTable, wanted: Sequence[str], found: dict[str, np.ndarray]) -> list[str]:
    by_case = {name.lower(): name for name in found}
    for name in wanted:
        if name.lower() not in by_case:
            raise FileError(table.path, f"has no target '{name}'; it has {shown(', '.join(found) or 'none')}", line=1)
    return [by_case[name.lower()] for name in wanted]


def _rotations(
    table: CsvTable, names: dict[str, str], used: set[str], targets: list[str], found: dict[str, np.ndarray]
) -> Float[np.ndarray, "n 3 3"] | None:
    given = [c for c in _QUATERNION if c in names]
    if not given:
        return None
    lacking = [c for c in _QUATERNION if c not in names]
    if lacking:
        raise FileError(table.path, f"has '{given[0]}' but no column '{lacking[0]}'; a pose needs qx qy qz qw", line=1)
    if len(targets) > 1:
        raise FileError(table.path, f"a pose has one target, this file names {', '.join(targets)}; choose one", line=1)
    used.update(_QUATERNION)
    seen = ~np.isnan(found[targets[0]][:, 0])
    quaternion = np.stack([table.numbers(names[c], empty=True) for c in _QUATERNION], axis=1)
    blank = np.isnan(quaternion)
    for row in np.flatnonzero(seen):
        if blank[row].any():
            column = names[_QUATERNION[int(np.argmax(blank[row]))]]
            raise table.error(
                "the cell is empty while the position is there; a pose needs all of qx qy qz qw", int(row), column
            )
        length = float(np.linalg.norm(quaternion[row]))
        if abs(length - 1.0) > _UNIT_QUATERNION:
            raise table.error(
                f"the quaternion has length {length:.4f}; it must be 1 (is qw last?)", int(row), names["qx"]
            )
    quaternion[~seen] = (0.0, 0.0, 0.0, 1.0)
    return se3.from_quaternion(quaternion)


def _uncertainty(
    table: CsvTable, names: dict[str, str], used: set[str], targets: list[str]
) -> Float[np.ndarray, "n targets"] | None:
    columns = [next((c for c in (f"{t.lower()}_u_mm", "u_mm") if c in names), None) for t in targets]
    stated = [c for c in columns if c is not None]
    if not stated:
        return None
    if len(stated) < len(targets):
        without = targets[columns.index(None)]
        raise FileError(
            table.path, f"states the uncertainty of some targets but not of '{without}'; give {without}_u_mm", line=1
        )
    used.update(stated)
    out = np.stack([table.numbers(names[c]) for c in stated], axis=1)
    for row, t in zip(*np.nonzero(out <= 0), strict=True):
        value = out[row, t]
        raise table.error(f"{value:g} is no standard uncertainty; give one above zero", int(row), names[stated[t]])
    return out * 1e-3
