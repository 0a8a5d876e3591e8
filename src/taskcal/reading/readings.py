"""From a table to quantities: joints, positions, orientations and all else that one file states, as it states it."""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
from jaxtyping import Float, Int

from taskcal.errors import Faults, FileError, shown
from taskcal.geometry import se3
from taskcal.observations import ObservedColumns, kinds
from taskcal.observations.base import Quantity
from taskcal.reading.columns import (
    CALCULATED,
    MAX_COORDINATE_M,
    Kind,
    Meaning,
    contradiction,
    meanings,
    numbered_parts,
    split_unit,
    stated_units,
)
from taskcal.robot.robot import POINT_COLUMNS, Robot
from taskcal.tables.forms import TableForm, read_table
from taskcal.tables.table import ANGLES, LEAVE_OUT, LENGTHS, NUMBER, TIMES, UNIT_LENGTH, UNITS, Table
from taskcal.tables.text import footer_note, is_statistic


@dataclass(frozen=True, eq=False, kw_only=True)
class MeasuredTable:
    """A table of measurements, and what its columns mean."""

    table: Table
    known: tuple[Meaning | None, ...]
    """Meaning of each column; None where it means nothing here."""
    robot: Robot

    def of(self, kind: Kind) -> list[tuple[str, Meaning]]:
        """Name and meaning of every column of a kind."""
        columns = zip(self.table.header, self.known, strict=True)
        return [(name, meaning) for name, meaning in columns if meaning is not None and meaning.kind == kind]

    def by_joint(self, kind: Kind) -> dict[int, tuple[str, Meaning]]:
        """Name and meaning of each joint's column of a kind.

        Raises:
            FileError: a joint has two, or there is a joint too many.
        """
        at: dict[int, tuple[str, Meaning]] = {}
        for name, meaning in self.of(kind):
            if meaning.index >= len(self.robot.joints):
                count = len(self.robot.joints)
                message = f"is a joint that {self.robot.name} does not have; it has {count}: is it the right robot?"
                raise self.table.header_error(f"'{name}' {message}")
            if meaning.index in at:
                joint, twice = self.robot.joint_names[meaning.index], f"by '{at[meaning.index][0]}' and '{name}'"
                other = f", or name the joint's q{meaning.index + 1}" if joint.casefold() in POINT_COLUMNS else ""
                raise self.table.header_error(f"joint {joint} is given twice, {twice}; keep one{other}")
            at[meaning.index] = (name, meaning)
        return at

    def by_target(self, kind: Kind) -> dict[str, dict[int, tuple[str, Meaning]]]:
        """Name and meaning of the columns of a kind by target in small letters, and by index."""
        out: dict[str, dict[int, tuple[str, Meaning]]] = {}
        for name, meaning in self.of(kind):
            out.setdefault(meaning.target.casefold(), {})[meaning.index] = (name, meaning)
        return out


# Joint positions in a table of measurements.

_OTHER_AXIS = re.compile(
    r"(?:e|ext|eax|external|external axis|zusatzachse) ?[1-6]|(?:linear axis|linearachse|rail|track)"
    r"|(?:j|joint|a|axis|achse|q) ?(?P<number>\d{1,2})"
)
"""Axes beside the robot's own, as controllers call them."""

MAX_STILL_RANGE = 1e-3
"""Range of an axis, at most, that stands still, in any unit. A convention: what an encoder flickers."""


def joints_of(measured: MeasuredTable) -> dict[str, Any]:
    """Fields of `Readings` on the joints of a table's rows; none where it has no column of a joint.

    Raises:
        FileError: a joint has no column, or two, or a joint too many, only some have a unit, or a cell is not a number.
    """
    table, robot, at = measured.table, measured.robot, measured.by_joint("joint")
    if not at:
        return {}
    for j in range(len(robot.joints)):
        if j not in at:
            raise table.header_error(no_joint(robot, j))
    turning = [at[j][1].unit for j, slides in enumerate(robot.prismatic) if not slides]
    scale = np.ones(len(at))
    for j, slides in enumerate(robot.prismatic):
        name, unit = at[j][0], at[j][1].unit
        known = LENGTHS if slides else ANGLES
        if unit in known:
            scale[j] = known[unit]
        elif unit is not None or slides or any(turning):
            bare = robot.joint_names[j] if unit is not None else name
            what = f"'{unit}' is no unit of this joint" if unit else "the unit is not stated"
            raise table.header_error(
                f"{what}; name the column {' or '.join(f'{bare}_{u}' for u in _units(slides))}", name
            )
    columns = tuple(at[j][0] for j in range(len(at)))
    values = _together(table, columns, remedy=LEAVE_OUT)
    return {"q": values * scale, "joint_columns": columns, "joint_unit_stated": any(turning) or not turning}


def read_joints(table: Table, robot: Robot, *, poses: bool = False) -> Float[np.ndarray, "rows joints"] | None:
    """The joints of a table's rows, radians and metres; None where it has no column of a joint.

    Args:
        table: the table.
        robot: whose joints they are.
        poses: whether the table has poses, too, of which columns ``x``, ``y`` and ``z`` are then part.

    Raises:
        FileError: as of `joints_of`, or no unit is stated.
    """
    names = robot.column_names if poses else robot.joint_names
    known = tuple(meanings(table.header, [""] * len(table.header), names))
    found = joints_of(MeasuredTable(table=table, known=known, robot=robot))
    if not found.get("joint_unit_stated", True):
        name = found["joint_columns"][int(np.argmin(robot.prismatic))]
        raise table.header_error(f"the unit is not stated; name the column {name}_deg or {name}_rad", name)
    return found.get("q")


def no_joint(robot: Robot, j: int) -> str:
    """Message on a table without a column for a joint."""
    units, joint = _units(robot.prismatic[j]), robot.joint_names[j]
    return (
        f"has no column for joint {joint} of {robot.name}; it needs one for each of "
        f"{', '.join(robot.joint_names)}, such as {joint}_{units[0]} or q{j + 1}_{units[1]}"
    )


def _units(slides: bool) -> tuple[str, str]:
    return ("mm", "m") if slides else ("deg", "rad")


def _together(table: Table, columns: Sequence[str], **how: Any) -> Float[np.ndarray, "rows columns"]:
    """Numbers of several columns, with the faults of all of them in one error."""
    faults = Faults()
    values = np.full((len(table), len(columns)), np.nan)
    for k, column in enumerate(columns):
        with faults.collecting():
            values[:, k] = table.numbers(column, **how)
    faults.raise_any()
    return values


def refuse_other_axes(measured: MeasuredTable) -> None:
    """See that no axis moved that the robot does not have: rails carry it, and what is left out would seem an error of it.

    Raises:
        FileError: one did.
    """
    faults, table, robot = Faults(), measured.table, measured.robot
    for name, meaning in zip(table.header, measured.known, strict=True):
        match = _OTHER_AXIS.fullmatch(split_unit(name)[0])
        if meaning is not None or match is None or (match["number"] and int(match["number"]) <= len(robot.joints)):
            continue
        try:
            values = table.numbers(name, empty=True, largest=np.inf)
        except FileError:
            continue
        seen = values[~np.isnan(values)]
        if len(seen) and np.ptp(seen) > MAX_STILL_RANGE:
            message = (
                f"is an axis that {robot.name} does not have, and it moves ({seen.min():g} to {seen.max():g}); describe the robot "
                "with it, or take rows in which it stands still"
            )
            with faults.collecting():
                raise table.header_error(message, name)
    faults.raise_any()


# Orientations as instruments write them: quaternions, matrices, and angles whose order must be known.

AngleForm = Literal[
    "abc", "wpr", "rpy-deg", "rpy-rad", "fixed-xyz-deg", "fixed-xyz-rad", "moving-xyz-deg", "moving-xyz-rad", "rotation-vector-rad",
    "rotation-vector-deg", "none",
]  # fmt: skip
"""What three angles mean: KUKA's A B C (moving z y x, degrees), FANUC's W P R (fixed x y z, degrees), roll, pitch and yaw (fixed
x y z), three angles about fixed or moving x y z, a rotation vector as Universal Robots writes it; or nothing is read of them."""

_MOVING = {"abc": "zyx", "moving-xyz": "xyz"}
"""About which moving axes the angles turn; all others are about fixed x, y, z."""

_CANDIDATES: dict[str, tuple[str, ...]] = {
    "wpr": ("wpr", "moving-xyz"),
    "abc": ("abc", "fixed-xyz", "moving-xyz"),
    "rpy": ("rpy", "moving-xyz"),
    "rxyz": ("fixed-xyz", "moving-xyz", "rotation-vector"),
}
"""What angles of each name are written for, the usual first: RoboDK heads angles about moving axes W P R, and Mitsubishi those
about fixed x y z A B C."""

MAX_RADIANS = 2.0 * np.pi
"""Angle, at most, that may be in radians: a turn."""

MAX_NOT_ORTHOGONAL = 1e-3
"""Largest departure of a matrix that is a rotation written with four decimals."""


@dataclass(frozen=True, eq=False, kw_only=True)
class OpenAngles:
    """Three angles whose names leave open what they mean."""

    columns: str
    """As the file names them."""
    assumed: str | None
    """What they usually mean; None where they are left out unless it is told."""
    meanings: Mapping[str, Float[np.ndarray, "rows 3 3"]]
    """The orientations by each `AngleForm` that they may follow."""

    def mapped(self, function: Callable[[np.ndarray], np.ndarray]) -> "OpenAngles":
        """With other orientations in place of each, such as some of the rows."""
        return replace(self, meanings={form: function(R) for form, R in self.meanings.items()})


def rotations_of(
    measured: MeasuredTable, points: Mapping[str, Float[np.ndarray, "rows 3"]], form: AngleForm | None = None
) -> dict[str, Any]:
    """Fields of `Readings` on the orientations of a table's rows, and on what is open of them.

    Args:
        measured: the cells.
        points: positions by target, NaN where it was not seen: only rows with one must have an orientation.
        form: what three angles mean, where their names do not say.

    Raises:
        FileError: columns are lacking, or a cell is not what it must be.
    """
    seen = {name.casefold(): ~np.isnan(values[:, 0]) for name, values in points.items()}
    needed = np.any(list(seen.values()), axis=0) if seen else np.ones(len(measured.table), dtype=bool)
    if quaternions := measured.by_target("quaternion"):
        return {
            "rotations": {
                next(iter(at.values()))[1].target: _of_quaternions(measured.table, at, seen.get(target, needed))
                for target, at in quaternions.items()
            }
        }
    matrix = {meaning.index: name for name, meaning in measured.of("matrix")}
    if len(matrix) >= 9:
        return {"rotations": {"": _of_matrices(measured.table, matrix, needed)}}
    angles = {meaning.index: (name, meaning) for name, meaning in measured.of("euler")}
    if angles and form != "none":
        return _of_angles(measured.table, [angles[i][0] for i in range(3)], angles[0][1], needed, form)
    return {}


def _of_quaternions(table: Table, at: Mapping[int, tuple[str, Meaning]], needed: np.ndarray) -> np.ndarray:
    for part in range(4):
        if part not in at:
            have, lacking = next(iter(at.values()))[0], f"q{'xyzw'[part]}"
            raise table.header_error(f"has '{have}' but no column '{lacking}'; a pose needs qx qy qz qw")
    columns = [at[part][0] for part in range(4)]
    return se3.from_quaternion(table.quaternions(columns, needed=needed, remedy="give a number"))


def _of_matrices(table: Table, at: Mapping[int, str], needed: np.ndarray) -> np.ndarray:
    """Nine of the elements, counted from 0 or from 1."""
    first = min(index % 10 for index in at)
    elements = [10 * (i + first) + j + first for i in range(3) for j in range(3)]
    lacking = [index for index in elements if index not in at]
    if lacking:
        element = f"row {lacking[0] // 10}, column {lacking[0] % 10}"
        raise table.header_error(f"has '{next(iter(at.values()))}' but lacks {element} of the matrix")
    names = [at[index] for index in elements]
    cells = table.side_by_side(names, empty=True)
    table.refuse_empty(cells, names, needed, "a pose needs all nine elements")
    R = cells.reshape(-1, 3, 3)
    R[~needed] = np.eye(3)
    off = np.abs(R @ R.transpose(0, 2, 1) - np.eye(3)).max(axis=(1, 2))
    for row in np.flatnonzero((off > MAX_NOT_ORTHOGONAL) | (np.linalg.det(R) < 0.0)):
        turned = "mirrors; is an axis or a sign swapped?" if np.linalg.det(R[row]) < 0 else "is not a rotation"
        raise table.error(f"the matrix {turned}", int(row), names[0])
    return se3.nearest_rotation(R)


def _of_angles(
    table: Table, names: Sequence[str], first: Meaning, needed: np.ndarray, form: AngleForm | None
) -> dict[str, Any]:
    cells = table.side_by_side(names, empty=True)
    table.refuse_empty(cells, names, needed, "a pose needs all three angles")
    cells[~needed] = 0.0
    if form is not None or first.form == "rotvec":
        return {"rotations": {"": _turned(cells, *_stated(first, form))}}
    unit = first.unit or {"abc": "deg", "wpr": "deg"}.get(first.form)
    largest = np.abs(cells).max(initial=0.0)
    if first.unit is None and unit is not None and 0.0 < largest <= np.pi:
        message = (
            f"no angle of {' '.join(names)} is beyond 3.14: they may be radians; name the columns {names[0]}_deg … or "
            f"{names[0]}_rad …"
        )
        raise table.header_error(message, names[0])
    units = [unit] if unit else ["deg", "rad"] if largest <= MAX_RADIANS else ["deg"]
    meant = {
        what if what in ("abc", "wpr") else f"{what}-{unit}": _turned(cells, what, unit)
        for unit in units
        for what in _CANDIDATES[first.form]
    }
    assumed = None if first.form == "rxyz" or unit is None else next(iter(meant))
    open_angles = OpenAngles(columns=" ".join(names), assumed=assumed, meanings=meant)
    return {"open_angles": open_angles, "rotations": {} if assumed is None else {"": meant[assumed]}}


def _turned(cells: Float[np.ndarray, "rows 3"], what: str, unit: str) -> Float[np.ndarray, "rows 3 3"]:
    angles = cells * ANGLES[unit]
    if what == "rotation-vector":
        return se3.exp(angles)
    if what in _MOVING:
        return se3.turns(_MOVING[what], angles)
    return se3.turns("zyx", angles[:, ::-1])


def _stated(first: Meaning, form: AngleForm | None) -> tuple[str, str]:
    """Meaning and unit of angles as the user states them, or of a rotation vector by its name."""
    if form is None:
        return "rotation-vector", first.unit or "rad"
    if form in ("abc", "wpr"):
        return form, first.unit or "deg"
    what, _, unit = form.rpartition("-")
    return what, first.unit or unit


# Positions as an instrument turns to them: an azimuth, an elevation or a zenith angle, and a range.

_DIRECTION_NAMES = {
    # seen from above, an azimuth turns counter-clockwise; what theodolites call Hz turns clockwise
    "azimuth": (
        "azimuth", "azimuth angle", "az", "azim", "azimut", "horizontal angle", "hor angle", "h angle", "horizontalwinkel",
    ),
    "clockwise": ("hz", "hz angle", "hz winkel"),
    "elevation": ("elevation", "elevation angle", "elev", "el", "höhenwinkel", "hoehenwinkel"),
    "zenith": ("zenith", "zenith angle", "zenitwinkel", "zenitdistanz", "zenithdistanz", "zenit", "ze"),
    # counted from the horizontal by some and from the zenith by others; beside Hz theodolites count it from the zenith
    "either": ("v", "vertical", "vertical angle", "v angle", "vertikalwinkel", "v winkel", "phi", "φ"),
    "range": (
        "range", "distance", "dist", "d", "r", "radius", "slope distance", "slope dist", "sd", "distanz", "entfernung",
        "schrägdistanz", "schraegdistanz", "schrägstrecke", "strecke",
    ),
    "theta": ("theta", "θ"),
}  # fmt: skip
"""Names of the columns that say where a point is seen, after the name of the target."""


def with_positions(table: Table) -> Table:
    """The table with columns ``x y z`` in place of angles and ranges; what was taken is noted.

    x points along azimuth zero and z upwards. An azimuth turns counter-clockwise seen from above; ``Hz`` clockwise.

    Raises:
        FileError: the unit of an angle is not stated, or whether it is counted from the horizontal.
    """
    if not any(table.header):
        return table
    parted = [split_unit(name) for name in table.header]
    if any(text in ("x", "x coordinate", "x koordinate") or text.endswith(" x") for text, _ in parted):
        return table
    units = [unit or UNITS.get(under) for (_, unit), under in zip(parted, table.units, strict=True)]
    for target, at in _directed([text for text, _ in parted]).items():
        turned = at.get("azimuth", at.get("clockwise"))
        polar = at.get("elevation", at.get("zenith", at.get("either") if "clockwise" in at else None))
        if "range" not in at:
            continue
        if turned is not None and polar is not None:
            table = _with_position(table, target, at, (turned, polar, at["range"]), units)
        elif "either" in at and (turned is not None or "theta" in at):
            name = table.header[at["either"]]
            message = (
                "is counted from the horizontal by some instruments and from the zenith by others; name it elevation or zenith, "
                "the angle about the vertical azimuth"
            )
            raise table.header_error(f"'{name}' {message}", name)
    return table


def _directed(texts: Sequence[str]) -> dict[str, dict[str, int]]:
    """Column of each part of a direction, by target."""
    by_target: dict[str, dict[str, int]] = {}
    for k, text in enumerate(texts):
        for kind, names in _DIRECTION_NAMES.items():
            name = next((n for n in sorted(names, key=len, reverse=True) if text == n or text.endswith(f" {n}")), None)
            if name is not None:
                by_target.setdefault(text[: len(text) - len(name)].strip(), {}).setdefault(kind, k)
                break
    return by_target


def _with_position(
    table: Table, target: str, at: Mapping[str, int], columns: tuple[int, int, int], units: Sequence[str | None]
) -> Table:
    """The table with one target's position in place of its angles and range."""
    header, angle = table.header, stated_units(table.preamble).angle
    scales: list[float] = []
    for k in columns[:2]:
        unit = units[k] or angle
        if unit not in ANGLES:
            what = "the unit of the angle is not stated" if unit is None else f"'{unit}' is no unit of an angle"
            raise table.header_error(f"{what}; name the column {header[k]}_deg, _rad or _gon", header[k])
        scales.append(ANGLES[unit])
    unit = units[columns[2]]
    if unit is not None and unit not in LENGTHS:
        raise table.header_error(f"'{unit}' is no unit of length; known: {', '.join(LENGTHS)}", header[columns[2]])
    azimuth, polar, distance = (table.numbers(header[k], empty=True) for k in columns)
    clockwise, from_zenith = "azimuth" not in at, "elevation" not in at
    turned, polar = (-1.0 if clockwise else 1.0) * azimuth * scales[0], polar * scales[1]
    elevation = np.pi / 2 - polar if from_zenith else polar
    level = distance * np.cos(elevation)
    points = np.stack([level * np.cos(turned), level * np.sin(turned), distance * np.sin(elevation)], axis=1)
    points[distance == 0.0] = np.nan
    names = {
        k: f"{target} {axis}".strip() + (f" {unit}" if unit else "") for k, axis in zip(columns, "xyz", strict=True)
    }
    cells = {
        k: ["" if np.isnan(value) else repr(value) for value in points[:, i].tolist()] for i, k in enumerate(columns)
    }
    note = (
        f"{', '.join(header[k] for k in columns)} are read as an azimuth that turns "
        f"{'clockwise' if clockwise else 'counter-clockwise'} seen from above, an angle from the "
        f"{'zenith' if from_zenith else 'horizontal'} and a range"
    )
    return replace(
        table,
        header=tuple(names.get(k, name) for k, name in enumerate(header)),
        rows=table.cells.with_columns(cells),
        units=tuple("" if k in names else under for k, under in enumerate(table.units)),
    ).noted(note)


# Rows that sum others up, and cells that stand for what was not seen.


def without_summaries(measured: MeasuredTable) -> MeasuredTable:
    """The table without rows whose id is the name of a statistic, such as ``Mean``; a note says which."""
    table = measured.table
    summing: dict[int, str] = {}
    for name, _ in measured.of("id"):
        summing |= {row: text for row, text in enumerate(table.texts(name)) if is_statistic(text)}
    if not summing:
        return measured
    summing = dict(sorted(summing.items()))
    listed = footer_note([int(table.lines[row]) for row in summing], [(text,) for text in summing.values()])
    rest = table.take(np.array([row not in summing for row in range(len(table))]))
    return replace(measured, table=rest.noted(f"rows that sum others up are left out: {listed}"))


_LOST = re.compile(
    r"nan|nil|none|null|n/?a|#n/a|#nv|#value!|-+|–|—|\?+|\*+|inf|lost|no data|beam lost|invalid|[+-]?9{4,}(?:\.[09]*)?",
    re.ASCII | re.IGNORECASE,
)
"""What is written in place of a point that was not seen; all three cells of a target are the same."""

_FLAG = ("valid", "is valid", "visible", "tracked", "measured ok", "point ok", "gültig", "gueltig")
_YES = frozenset({"1", "true", "yes", "y", "ja", "j", "ok", "valid", "x", "wahr", "1.0", "checked"})
_NO = frozenset({"0", "false", "no", "n", "nein", "nok", "nio", "invalid", "falsch", "0.0", "unchecked"})


def is_lost(cell: str) -> bool:
    """Whether a cell is empty, or holds what stands for a lost beam."""
    return not cell or _LOST.fullmatch(cell) is not None


def rows_not_valid(table: Table) -> tuple[list[int], tuple[str, ...]]:
    """Rows that a column such as ``valid`` calls not valid, and a note of them."""
    for name in table.header:
        if " ".join(name.casefold().replace("_", " ").split()) not in _FLAG:
            continue
        said = [text.casefold() for text in table.texts(name)]
        rows = [row for row, text in enumerate(said) if text in _NO]
        if rows and set(said) <= _YES | _NO:
            flag = shown(name, 40)
            return rows, (f"what was measured is taken for lost where '{flag}' says so ({_listed(table, rows)})",)
    return [], ()


def _listed(table: Table, rows: Sequence[int]) -> str:
    """The first lines of some rows, in words."""
    return f"line {', '.join(str(table.lines[row]) for row in rows[:5])}{', …' if len(rows) > 5 else ''}"


def without_lost(table: Table, columns: Sequence[str]) -> tuple[Table, tuple[str, ...]]:
    """A table whose cells of a target are empty where all three hold one word, or the nines, for a beam that was lost.

    Args:
        table: the cells.
        columns: of the target's axes.

    Returns:
        The table, and a note of what was taken for a lost beam.
    """
    by_axis = [table.texts(column) for column in columns]
    lost = {
        row: cells[0]
        for row, cells in enumerate(zip(*by_axis, strict=True))
        if cells[0] and len(set(cells)) == 1 and _LOST.fullmatch(cells[0])
    }
    if not lost:
        return table, ()
    for cells in by_axis:
        for row in lost:
            cells[row] = ""
    axes = [table.header.index(column) for column in columns]
    rows = table.cells.with_columns(dict(zip(axes, by_axis, strict=True)))
    words = ", ".join(f"'{shown(word, 20)}'" for word in dict.fromkeys(lost.values()))
    note = f"{words} for {columns[0]} … is taken for a lost beam ({_listed(table, list(lost))})"
    return replace(table, rows=rows), (note,)


# Positions of targets in a table of measurements: columns for each target, or a row for each.

MAX_UNCERTAINTY_M = 0.01
"""Standard uncertainty, metres, at most, under a name that positions have too. A convention: no instrument that calibrates
robots has as much."""

MAX_UNCERTAINTY_SHARE = 0.01
"""Uncertainty over the largest coordinate, at most, where the unit of both is unknown. A convention: 10 mm on a metre."""

LEAVE_EMPTY = "give a number, or leave all the target's cells empty"

MAX_TARGETS = 100
"""On one tool; plates for trackers carry up to a dozen reflectors, and the fit's matrices grow with the square."""

_OFF = re.compile(
    r"(?:^|[\s_.\-])(?:dif|diff|difference|dev|deviation|delta|err|error|residual|abw|abweichung)(?:$|[\s_.\-])", re.I
)
"""Names of how far the robot was off."""


def targets_of(measured: MeasuredTable) -> tuple[dict[str, Any], tuple[str, ...]]:
    """Fields of `Readings` on the positions of a table's rows and how sure they are, and notes of what was decided on the way.

    Raises:
        FileError: an axis is lacking or given twice, only some have a unit, or a cell is not what it must be.
    """
    table, places = measured.table, measured.by_target("position")
    names: dict[str, str] = {}
    met: dict[tuple[str, int], str] = {}
    for column, meaning in measured.of("position"):
        low = meaning.target.casefold()
        names.setdefault(low, meaning.target)
        if (low, meaning.index) in met:
            twice = f"'{met[low, meaning.index]}' and '{column}'"
            raise table.header_error(f"{twice} are both the {'xyz'[meaning.index]} of one target; keep one")
        met[low, meaning.index] = column
    _refuse_goals(measured, places)
    if len(places) > 10 * MAX_TARGETS:
        raise table.header_error(f"names {len(places)} targets; Taskcal fits {MAX_TARGETS} at most: choose some")
    units = {low: _unit(table, names[low], axes) for low, axes in places.items()}
    stated = {unit is not None for unit in units.values()}
    if len(stated) > 1:
        without = next(low for low, unit in units.items() if unit is None)
        column = places[without][0][0]
        raise table.header_error(f"the unit is not stated; name the column {column}_mm", column)
    points: dict[str, np.ndarray] = {}
    notes: list[str] = []
    faults = Faults()
    for low, axes in places.items():
        columns = [axes[i][0] for i in range(3)]
        table, lost = without_lost(table, columns)
        notes += lost
        with faults.collecting():
            points[names[low] or "tool"] = _positions(table, columns, units[low])
    uncertainty: dict[str, np.ndarray] = {}
    in_metres: frozenset[str] = frozenset()
    with faults.collecting():
        farthest = max((float(np.nanmax(np.abs(values), initial=0.0)) for values in points.values()), default=0.0)
        largest = MAX_UNCERTAINTY_SHARE * farthest
        uncertainty, in_metres = _uncertainty(replace(measured, table=table), set(units.values()), largest)
    unread = {measured.table.header[k] for k in _unused(measured.known)}
    short = [name for name, meaning in measured.of("uncertainty") if meaning.form and name not in unread]
    if short and uncertainty:
        notes.append(f"{shown(', '.join(short))} are read as standard uncertainties")
    faults.raise_any()
    invalid, said = rows_not_valid(table) if points else ([], ())
    for values in points.values():
        values[invalid] = np.nan
    fields = {
        "points": points,
        "length_unit_stated": stated != {False},
        "uncertainty": uncertainty,
        "uncertainty_stated": in_metres,
    }
    return fields, (*notes, *said)


def _refuse_goals(measured: MeasuredTable, places: Mapping[str, object]) -> None:
    """Goals, and how far the robot was off them, are not what was measured, though it follows from both."""
    off = [name for name, _ in measured.of("nominal") if _OFF.search(name)]
    if off and places and places.keys() <= CALCULATED:
        message = (
            f"has goals ('{shown(measured.of('position')[0][0])}') and differences from them ('{shown(off[0])}'), not points; add "
            "columns of what was measured"
        )
        raise measured.table.header_error(message)


def _unit(table: Table, name: str, axes: Mapping[int, tuple[str, Meaning]]) -> str | None:
    """The unit of a target's axes, all of which must be there and in the same."""
    have = next(iter(axes.values()))[0]
    for axis in range(3):
        if axis not in axes:
            spelled = have[: len(have) - len("x_mm")] if have.lower().endswith("_mm") else (f"{name}_" if name else "")
            raise table.header_error(f"has '{have}' but no column '{spelled}{'xyz'[axis]}_mm'")
    columns = {column: meaning.unit for column, meaning in axes.values()}
    units = set(columns.values())
    if units == {None}:
        return None
    if None in units:
        bare = next(column for column, unit in columns.items() if unit is None)
        raise table.header_error(f"the unit is not stated; name the column {bare}_mm", bare)
    if len(units) > 1:
        listed = ", ".join(f"'{column}' ({unit})" for column, unit in columns.items())
        raise table.header_error(f"the axes of one target have different units: {listed}; give all three in one unit")
    unit = units.pop()
    if unit not in LENGTHS:
        raise table.header_error(f"'{unit}' is no unit of length; known: {', '.join(LENGTHS)}", have)
    return unit


def _positions(table: Table, columns: Sequence[str], unit: str | None) -> np.ndarray:
    largest = MAX_COORDINATE_M / LENGTHS[unit or "mm"]
    points = _together(table, columns, empty=True, remedy=LEAVE_EMPTY, largest=largest)
    faults, blank = Faults(), np.isnan(points)
    for row in np.flatnonzero(blank.any(axis=1) & ~blank.all(axis=1)):
        with faults.collecting():
            message = "the cell is empty while its target's others are not; leave all three empty for a lost beam, or drop the row"
            raise table.error(message, int(row), columns[int(np.argmax(blank[row]))])
    faults.raise_any()
    points[(points == 0.0).all(axis=1)] = np.nan
    return points * (LENGTHS[unit] if unit else 1.0)


def _uncertainty(
    measured: MeasuredTable, units: set[str | None], largest: float
) -> tuple[dict[str, Float[np.ndarray, " rows"]], frozenset[str]]:
    """Standard uncertainty by target, of three axes the root mean square, and the targets for which it is in metres.

    Without a unit of its own it is as the positions are, if these are in millimetres.
    """
    if not units and not measured.of("observed"):
        return {}, frozenset()
    table, out, in_metres = measured.table, dict[str, np.ndarray](), set[str]()
    for target, at in measured.by_target("uncertainty").items():
        chosen = [at[3]] if 3 in at else [at[i] for i in range(3) if i in at]
        if 3 not in at and len(chosen) < 3:
            continue
        first, own = chosen[0][0], {meaning.unit for _, meaning in chosen}
        unit = next(iter(own)) or ("mm" if units == {"mm"} else None)
        if len(own) > 1:
            raise table.header_error("the axes of one uncertainty have different units", first)
        if unit is None and units != {None}:
            raise table.header_error(f"the unit is not stated; name the column {first}_mm", first)
        if unit is not None and unit not in LENGTHS:
            raise table.header_error(f"'{unit}' is not a unit of length; known: {', '.join(LENGTHS)}", first)
        scale = 1.0 if unit is None else LENGTHS[unit]
        squares = np.zeros(len(table))
        for name, meaning in chosen:
            values = table.numbers(name)
            if meaning.form == "s":
                _refuse_positions(table, name, values, largest if unit is None else MAX_UNCERTAINTY_M / scale)
            for row in np.flatnonzero(values <= 0.0):
                message = f"{values[row]:g} is not a standard uncertainty; give one above zero"
                raise table.error(message, int(row), name)
            squares += (values * scale) ** 2
        out[target] = np.sqrt(squares / len(chosen))
        in_metres |= {target} if unit is not None else set()
    return out, frozenset(in_metres)


def _refuse_positions(table: Table, column: str, values: np.ndarray, largest: float) -> None:
    """See that values under a name such as ``sx`` are uncertainties, not positions of a sphere, a socket or a set-point."""
    row = int(np.argmax(np.abs(values))) if len(values) else 0
    if len(values) and not (values.min() > 0.0 and values[row] <= largest):
        message = (
            f"{values[row]:g} is not a standard uncertainty; give one named u_mm, or name the columns of a position for its "
            "target, as in sphere_x_mm"
        )
        raise table.error(message, row, column)


# Names for the columns of a file that has none, where their number and their cells leave one reading.

_COUNT = re.compile(r"\d{1,9}", re.ASCII)

_NAMES = ("collection", "group", "id")
"""Of points, the outermost first, as SpatialAnalyzer writes them."""

_SAMPLED = 500
"""Rows that tell numbers from texts. A convention that bounds the time."""

_COMPARED, _COMPARED_COLUMNS = 40, 200
"""Rows, and columns of numbers, in which a second block of positions is looked for."""

_ALIKE = 0.8
"""Correlation at least of the distances between points of two blocks that may be the same points, in any frames and units. A
convention: angles and uncertainties stay below."""

_NEAR = 0.1
"""Distance of two blocks over the scatter of one, at most, where they are the same points in one frame. A convention."""


def name_columns(table: Table, robot: Robot) -> Table:
    """The table with names: as it has them, or an id, the robot's joints and a position, as many of these as it has columns.

    A first column of whole numbers or words is the id where the rest has a reading. Several columns of words are the collection,
    group and name of a point, but for those with one word throughout. Words behind the numbers, such as a date, are left out.
    What was decided is noted.

    Raises:
        FileError: it names no columns, and they can be read in no way, or in several.
    """
    if any(table.header):
        return table
    table = _without_numbering(table)
    width, joints, position = len(table.header), list(robot.joint_names), ["x", "y", "z"]
    readings = {len(joints): joints, 3: position, len(joints) + 3: [*joints, *position]}
    leading, numbers = _words_and_numbers(table)
    names = _names_of_words([[row[k] for row in table.rows] for k in range(leading)])
    counts = numbers > 0 and all(_COUNT.fullmatch(row[leading]) for row in table.rows)
    options: list[list[str]] = []
    if counts and numbers - 1 in readings and len(names) < len(_NAMES) and not (names and _whole(table, leading)):
        options.append([*_with_count(names), *readings[numbers - 1]])
    if numbers in readings and not (options and counts):
        options.append([*names, *readings[numbers]])
    if (
        names
        and not options
        and not counts
        and numbers > 3
        and not _may_begin_with_joints(table, robot, leading, numbers)
    ):
        options.append([*names, *position, *["-"] * (numbers - 3)])
    if len(options) != 1 or (names and "id" not in options[0]):
        example = shown(" ".join(table.rows[0]), 60)
        message = (
            f"names no columns, and its {width} columns (line {table.lines[0]}: {example}) are not the {len(joints)} joints of "
            f'{robot.name}, a position, or both; name them: --columns "{" ".join(["id", *joints, "x_mm", "y_mm", "z_mm"])}"'
        )
        raise FileError(table.path, message)
    (own,) = options
    named = [*own, *["-"] * (width - len(own))]
    _refuse_two_blocks(table, named, leading, numbers)
    header = tuple(name if name != "-" else f"column {k}" for k, name in enumerate(named, start=1))
    note = f"the file names no columns; they are read as {' '.join(named)} (--columns states others)"
    return replace(table, header=header).noted(note)


def _may_begin_with_joints(table: Table, robot: Robot, first: int, count: int) -> bool:
    """Whether joints and a position may come first of more numbers: within the robot's limits, in degrees or radians."""
    width = len(robot.joints)
    if count <= width + 3:
        return False
    rows = [row[first : first + width] for row in table.rows]
    q = np.array([[float(cell) for cell in row] for row in rows if all(map(NUMBER.fullmatch, row))])
    return len(q) > 0 and not robot.outside_limits(q * np.where(robot.prismatic, LENGTHS["mm"], ANGLES["deg"]))


def _without_numbering(table: Table) -> Table:
    """Without a first row that only numbers the columns, as programs write that know no names."""
    width = len(table.header)
    numbering = [tuple(str(k + first) for k in range(width)) for first in (0, 1)]
    if width < 3 or len(table) < 2 or table.rows[0] not in numbering:
        return table
    note = f"line {table.lines[0]} numbers the columns, and is left out"
    return table.take(slice(1, None)).noted(note)


def _words_and_numbers(table: Table) -> tuple[int, int]:
    """Number of leading columns of words, with counts between them, and of the columns of numbers that follow.

    A first column with a word in it is one of words, any other where most of its cells are.
    """
    rows = table.rows
    sample = rows[:_SAMPLED]
    words = [
        2 * sum(not (NUMBER.fullmatch(row[k]) or is_lost(row[k])) for row in sample) > len(sample)
        for k in range(len(table.header))
    ]
    words[0] = not all(NUMBER.fullmatch(row[0]) for row in rows)
    leading = words.index(False) if False in words else len(words)
    block = next((k for k in range(len(words) - 2) if not any(words[k : k + 3])), leading)
    if all(words[k] or all(_COUNT.fullmatch(row[k]) for row in rows) for k in range(block)):
        leading = block
    rest = words[leading:]
    return leading, rest.index(True) if True in rest else len(rest)


def _names_of_words(columns: Sequence[Sequence[str]]) -> list[str]:
    """Names of the columns of words: ``-`` where one word stands throughout and another column tells rows apart."""
    told = [k for k, cells in enumerate(columns) if len(set(cells)) > 1] or [*range(len(columns))][-1:]
    if len(told) > len(_NAMES):
        return ["-"] * len(columns)
    names = dict(zip(told, _NAMES[len(_NAMES) - len(told) :], strict=True))
    return [names.get(k, "-") for k in range(len(columns))]


def _with_count(names: Sequence[str]) -> list[str]:
    """Names of columns of words with a count of points behind them."""
    outer = iter(_NAMES[len(_NAMES) - 1 - sum(name != "-" for name in names) :])
    return [*(name if name == "-" else next(outer) for name in names), "id"]


def _whole(table: Table, first: int) -> bool:
    """Whether three columns behind one hold whole numbers only, so that any of the four may be a count."""
    return all(_COUNT.fullmatch(cell) for row in table.rows[:_SAMPLED] for cell in row[first + 1 : first + 4])


def _refuse_two_blocks(table: Table, named: Sequence[str], first: int, count: int) -> None:
    """See that only one block of three columns can be the measured position.

    Raises:
        FileError: two can.
    """
    step = max(1, len(table) // _COMPARED)
    rows = [row[first : first + min(count, _COMPARED_COLUMNS)] for row in table.rows[::step]]
    values = np.array([[float(cell) for cell in row] for row in rows if all(map(NUMBER.fullmatch, row))])
    # joints move in step with one another wherever a robot passes through its poses
    blocks = _two_blocks(values, positions=named[first] == "x") if len(values) and count > 5 else None
    if blocks is None:
        return
    one, other = (first + start + 1 for start in blocks)
    second = [f"{name}_mm" for name in "xyz"]
    example = [*["id"] * (first > 0), *["-"] * (other - 1 - (first > 0)), *second, *["-"] * (len(named) - other - 2)]
    message = (
        f"names no columns, and columns {one} to {one + 2} and columns {other} to {other + 2} "
        f"({shown(' '.join(table.rows[0]), 60)}) could both be the measured position; write a line of names above the table, "
        f'or state them: --columns "{" ".join(example)}" takes the second'
    )
    raise FileError(table.path, message, line=int(table.lines[0]))


def _two_blocks(values: Float[np.ndarray, "rows columns"], *, positions: bool) -> tuple[int, int] | None:
    """First columns of two blocks of three that may both be the measured position; None where there are none.

    They hold the same points, asked and measured, or two targets of one tool; or a later block scatters more than the first.

    Args:
        values: the numbers.
        positions: whether the first three are read as positions. Joints may move in step with one another, and only blocks that
            are the same points in one frame are then two.
    """
    starts = range(values.shape[1] - 2)
    blocks = [values[:, start : start + 3] for start in starts]
    scatter = [_size(block) for block in blocks]
    first, second = np.triu_indices(len(values), 1)
    apart = [np.linalg.norm(block[first] - block[second], axis=1) for block in blocks]
    for one in starts:
        alike: dict[int, float] = {}
        for other in starts[one + 3 :]:
            if scatter[one] > 0.0 and scatter[other] > 0.0:
                distance = float(np.sqrt(np.mean(np.sum((blocks[other] - blocks[one]) ** 2, axis=1))))
                near = distance < _NEAR * scatter[one]
                alike[other] = 1.0 if near else _correlation(apart[one], apart[other]) if positions else 0.0
        if alike and max(alike.values()) > _ALIKE:
            return one, max(alike, key=alike.__getitem__)
    wider = [start for start in starts[3::3] if scatter[start] > scatter[0]]
    return (0, wider[0]) if positions and wider else None


def _size(block: Float[np.ndarray, "rows 3"]) -> float:
    """Scatter of points; of a single one its distance from zero."""
    return float(np.linalg.norm(block.std(axis=0) if len(block) > 1 else block))


def _correlation(first: Float[np.ndarray, " pairs"], second: Float[np.ndarray, " pairs"]) -> float:
    """Correlation of distances; 0 for too few."""
    if len(first) < 6 or first.std() == 0.0 or second.std() == 0.0:
        return 0.0
    return float(np.corrcoef(first, second)[0, 1])


MIN_RANGE_M = 0.01
"""Range of a column of lengths that may be what was measured, metres: uncertainties and deviations vary by less."""

MAX_TIME_S = 1e7
"""No robot works so many seconds before it is measured; clocks count more."""

KNOWN = (
    "a campaign has id, joints ({joint}_deg …), targets (x_mm … or NAME_x_mm …), qx qy qz qw, u_mm, station, temp_C, time_s, "
    "{joint}_approach …"
)
"""What columns there may be."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Readings:
    """The rows of one file, or of two whose rows were paired."""

    path: Path
    lines: Int[np.ndarray, " n"]
    """Of the file, from 1."""
    ids: tuple[str, ...] | None = None
    """As the file names its rows, repeated where it repeats them; None where it does not."""
    groups: tuple[str, ...] | None = None
    """Of points that have names of their own in each; None where the file states none, or one throughout."""
    q: Float[np.ndarray, "n joints"] | None = None
    """Radians and metres; where `joint_unit_stated` is false, as in the file. None without joints."""
    joint_unit_stated: bool = True
    """False where no joint that turns has a unit."""
    joint_columns: tuple[str, ...] = ()
    """As the file names them, one for each joint."""
    points: Mapping[str, Float[np.ndarray, "n 3"]] = field(default_factory=dict[str, np.ndarray])
    """By target, ``tool`` where the file names none, metres; where `length_unit_stated` is false, as in the file. NaN for a lost
    beam."""
    length_unit_stated: bool = True
    """False where no position has a unit."""
    uncertainty: Mapping[str, Float[np.ndarray, " n"]] = field(default_factory=dict[str, np.ndarray])
    """Standard uncertainty per axis, by target in small letters, empty for all; as the points."""
    uncertainty_stated: frozenset[str] = frozenset()
    """Those of them that are in metres, whatever the points are in."""
    rotations: Mapping[str, Float[np.ndarray, "n 3 3"]] = field(default_factory=dict[str, np.ndarray])
    """By target, an empty name where their columns name none."""
    open_angles: OpenAngles | None = None
    """Where it is open what three angles mean."""
    temperature: Float[np.ndarray, " n"] | None = None
    """°C."""
    time: Float[np.ndarray, " n"] | None = None
    """Seconds."""
    approach: Float[np.ndarray, "n joints"] | None = None
    """1, −1, or 0 where it is unknown."""
    move: Float[np.ndarray, "n joints"] | None = None
    """Radians and metres."""
    targets_by_row: tuple[str, ...] | None = None
    """Whose position each row holds, where a column says."""
    stations: tuple[str, ...] | None = None
    """Where the tracker stood at each row, where a column says."""
    observed: ObservedColumns | None = None
    """Columns of kinds of observation that need no tracker; None where there are none."""
    preamble: tuple[str, ...] = ()
    """Lines above the table and comments."""
    left_lengths: tuple[str, ...] = ()
    """Columns of lengths that were left out and vary by more than `MIN_RANGE_M`."""
    notes: tuple[str, ...] = ()
    """What was decided on the way."""
    points_path: Path | None = None
    """File of the points, where that is another than that of the joints."""
    point_lines: Int[np.ndarray, " n"] | None = None
    """Its lines, from 1."""

    def points_error(self, message: str, row: int | None = None, column: str | None = None) -> FileError:
        """Error of the points, with their file: its header, or the line of a row."""
        line = 1 if row is None else int(self.lines_of_points[row])
        return FileError(self.points_path or self.path, message, line=line, column=column)

    @property
    def lines_of_points(self) -> Int[np.ndarray, " n"]:
        """Lines of the file that holds the points."""
        return self.lines if self.point_lines is None else self.point_lines

    @property
    def names(self) -> str:
        """Name of the file, or of both."""
        return self.path.name if self.points_path is None else f"{self.path.name} with {self.points_path.name}"

    def __len__(self) -> int:
        return len(self.lines)

    def noted(self, *notes: str) -> "Readings":
        """The readings with more notes."""
        return replace(self, notes=(*self.notes, *notes))

    def converted(self, robot: Robot, angle: str | None, lengths: Mapping[str, str]) -> "Readings":
        """With joints that turn in radians from a unit, and positions in metres from one for each target, where these are given.

        An uncertainty is as its target; one of all targets as the first.
        """
        scale = {name.casefold(): LENGTHS[unit] for name, unit in lengths.items()}
        first = next(iter(scale.values()), 1.0)
        q = self.q
        if angle is not None and q is not None:
            q = np.where(robot.prismatic, q, q * ANGLES[angle])
        return replace(
            self,
            q=q,
            joint_unit_stated=self.joint_unit_stated or angle is not None,
            points={name: values * scale.get(name.casefold(), 1.0) for name, values in self.points.items()},
            length_unit_stated=self.length_unit_stated or bool(lengths),
            uncertainty={
                name: values * (1.0 if name in self.uncertainty_stated else scale.get(name, first))
                for name, values in self.uncertainty.items()
            },
        )

    def take(self, rows: Int[np.ndarray, " k"]) -> "Readings":
        """Some of the rows."""

        def pick(value: Any) -> Any:
            if isinstance(value, np.ndarray):
                return value[rows]
            if isinstance(value, tuple):
                return tuple(value[i] for i in rows)
            if isinstance(value, Mapping):
                return {name: values[rows] for name, values in value.items()}
            if isinstance(value, OpenAngles):
                return value.mapped(lambda R: R[rows])
            return None if value is None else value.take(rows)

        return replace(self, **{name: pick(getattr(self, name)) for name in _BY_ROW})


_BY_ROW = (
    "ids", "groups", "lines", "q", "points", "uncertainty", "rotations", "open_angles", "temperature", "time", "approach", "move",
    "targets_by_row", "stations", "observed", "point_lines",
)  # fmt: skip
"""What readings hold for each row."""


def read_readings(
    path: str | Path | Table, robot: Robot, form: TableForm | None = None, angles: AngleForm | None = None
) -> Readings:
    """Read what one file says, whatever its form and its columns' names.

    Args:
        path: the file, or its table.
        robot: the robot that was measured.
        form: what is stated of the table.
        angles: what three angles of a pose mean, where their names do not say.

    Raises:
        FileError: with all that is wrong in it, the first twenty faults.
    """
    table = path if isinstance(path, Table) else read_table(path, form)
    table = with_positions(name_columns(table, robot))
    known = meanings(table.header, table.units, robot.joint_names, _numbered_parts(table))
    measured = without_summaries(MeasuredTable(table=table, known=tuple(known), robot=robot))
    table, faults = measured.table, Faults()
    for fault in table.faults:
        with faults.collecting():
            raise fault
    for name, under in zip(table.header, table.units, strict=True):
        if units := contradiction(name, under):
            with faults.collecting():
                message = f"the name states {units[0]}, the row of units {units[1]}; mend one of them"
                raise table.header_error(message, name)
    found: dict[str, Any] = {}
    notes: tuple[str, ...] = ()
    with faults.collecting():
        found |= joints_of(measured)
    with faults.collecting():
        targets, notes = targets_of(measured)
        found |= targets
    with faults.collecting():
        found |= rotations_of(measured, found.get("points", {}), angles)
    with faults.collecting():
        found["ids"] = _ids(measured)
    with faults.collecting():
        found |= {"temperature": _temperature(measured), "time": _time(measured)}
    with faults.collecting():
        found |= {"approach": _approaches(measured), "move": _moves(measured)}
    for refuse in (_refuse_nearly_known, refuse_other_axes, _refuse_unlabelled):
        with faults.collecting():
            refuse(measured)
    faults.raise_any()
    if not len(table):
        raise FileError(table.path, "has no measurements below its header")
    groups, observed = _groups(measured), _observed(measured)
    if found["ids"] is None:
        # of a group in which targets have names, or the rows none
        found["ids"], groups = groups, None
    if "q" not in found and not any(np.isfinite(points).any() for points in found["points"].values()):
        _refuse_nothing_measured(measured, observed)
    named = measured.of("target")
    stations = _stations(measured)
    left_numbers, left_texts, left_lengths = _left_out(measured)
    return Readings(
        path=table.path,
        lines=np.array(table.lines, dtype=np.int64),
        groups=groups,
        targets_by_row=tuple(table.texts(named[0][0])) if named else None,
        stations=stations,
        observed=observed,
        preamble=table.preamble,
        left_lengths=left_lengths,
        notes=(*left_numbers, *table.notes, *notes, *left_texts),
        **found,
    )


def _refuse_nothing_measured(measured: MeasuredTable, observed: ObservedColumns | None) -> None:
    """See that a file without joints and positions holds a number that was measured in another way.

    Raises:
        FileError: it does not.
    """
    if observed is not None and any(NUMBER.fullmatch(cell) for cells in observed.cells.values() for cell in cells):
        return
    columns = shown(", ".join(measured.table.header), 200)
    message = (
        f"holds no measured number: none of its columns ({columns}) is read as a joint of {measured.robot.name} or a position; "
        f"name them {measured.robot.joint_names[0]}_deg … and x_mm y_mm z_mm, in the file or with --columns"
    )
    raise measured.table.header_error(message)


def quantity_of(unit: str | None) -> tuple[Quantity, float] | None:
    """Quantity of a unit, and its factor to metres or radians."""
    if unit in LENGTHS:
        return "length", LENGTHS[unit]
    return ("angle", ANGLES[unit]) if unit in ANGLES else None


def _observed(measured: MeasuredTable) -> ObservedColumns | None:
    """Columns of kinds of observation that need no tracker."""
    at = {meaning.target: (name, meaning.unit) for name, meaning in measured.of("observed")}
    if not at:
        return None
    return ObservedColumns(
        path=measured.table.path,
        lines=np.array(measured.table.lines, dtype=np.int64),
        cells={column: tuple(measured.table.texts(name)) for column, (name, _) in at.items()},
        headers={column: name for column, (name, _) in at.items()},
        units={column: quantity_of(unit) for column, (_, unit) in at.items()},
    )


def _numbered_parts(table: Table) -> list[int]:
    """Columns ``Q0 … Q3`` or ``Q1 … Q4`` that hold a quaternion, the scalar first: its length is one in every row."""
    at = numbered_parts(table.header)
    rows = [row for row in zip(*(table.texts(table.header[k]) for k in at), strict=True) if all(row)]
    try:
        lengths = np.linalg.norm(np.array(rows, dtype=float).reshape(-1, 4), axis=1)
    except ValueError:
        return []
    return at if np.abs(lengths - 1.0).max(initial=0.0) <= UNIT_LENGTH and rows else []


def _refuse_unlabelled(measured: MeasuredTable) -> None:
    """See that positions in the frame of a sensor on the tool are not taken for those of a target.

    Raises:
        FileError: they lack the column that names what was seen.
    """
    for kind in kinds():
        words = {word for column in kind.needed for word in kind.columns[column]}
        for name, _ in measured.of("position"):
            if split_unit(name)[0] in words:
                message = (
                    f"what a sensor on the tool sees needs a column '{kind.label}' that names it; add one, or rename the columns, "
                    "as in smr_x_mm, if an instrument beside the robot measured them"
                )
                raise measured.table.header_error(message, name)


def _groups(measured: MeasuredTable) -> tuple[str, ...] | None:
    """The group of every row, of collections in which groups stand too; None where all rows are of one."""
    columns = [texts for name, _ in measured.of("group") if len(set(texts := measured.table.texts(name))) > 1]
    return tuple(map(" ".join, zip(*columns, strict=True))) if columns else None


def _ids(measured: MeasuredTable) -> tuple[str, ...] | None:
    """Names of the rows, from the surest column that names every row differently, or else from the surest.

    Raises:
        FileError: a row has no name.
    """
    columns = [name for name, _ in sorted(measured.of("id"), key=lambda column: column[1].index)]
    if not columns:
        return None
    texts = {column: measured.table.texts(column) for column in columns}
    full = [column for column in columns if all(texts[column])]
    own = next((c for c in full if len(set(texts[c])) == len(measured.table)), None)
    words = next((c for c in full if not all(re.fullmatch(r"\d+", text) for text in texts[c])), None)
    chosen = own or (columns[0] if len(columns) == 1 else words) or columns[0]
    faults = Faults()
    for row, text in enumerate(texts[chosen]):
        if not text:
            with faults.collecting():
                raise measured.table.error("the row has no id; give each row its own", row, chosen)
    faults.raise_any()
    return tuple(texts[chosen])


def _stations(measured: MeasuredTable) -> tuple[str, ...] | None:
    """Where the tracker stood at each row.

    Raises:
        FileError: a row does not say.
    """
    columns = measured.of("station")
    if not columns:
        return None
    texts, faults = measured.table.texts(columns[0][0]), Faults()
    for row in [row for row, text in enumerate(texts) if not text]:
        with faults.collecting():
            raise measured.table.error("the row has no station; name where the tracker stood", row, columns[0][0])
    faults.raise_any()
    return tuple(texts)


def _temperature(measured: MeasuredTable) -> np.ndarray | None:
    columns = measured.of("temperature")
    return measured.table.numbers(columns[0][0], empty=True) if columns else None


def _time(measured: MeasuredTable) -> np.ndarray | None:
    """Seconds since the robot began to work."""
    columns = [(name, TIMES[m.unit]) for name, m in measured.of("time") if m.unit in TIMES]
    if not columns:
        return None
    column, scale = columns[0]
    time = measured.table.numbers(column, empty=True, largest=np.inf) * scale
    wrong = np.flatnonzero((time < 0.0) | (time > MAX_TIME_S))
    if len(wrong):
        message = f"{time[wrong[0]]:g} s is not a time since the robot began to work; subtract the time when it did"
        raise measured.table.error(message, int(wrong[0]), column)
    return time


def _approaches(measured: MeasuredTable) -> np.ndarray | None:
    columns = [name for name, _ in _of_every_joint(measured, "approach", "_approach", "_approach")]
    if not columns:
        return None
    approach = measured.table.side_by_side(columns, remedy="give 1, -1, or 0 where it is unknown")
    for row, j in zip(*np.nonzero(~np.isin(approach, (-1.0, 0.0, 1.0))), strict=True):
        message = f"{approach[row, j]:g} is not a way of approach; give 1 (the joint's value grew), -1 (it fell) or 0 (unknown)"
        raise measured.table.error(message, int(row), columns[j])
    return approach


def _moves(measured: MeasuredTable) -> np.ndarray | None:
    columns = _of_every_joint(measured, "move", "_move_deg", "_move_mm")
    if not columns:
        return None
    scale: list[float] = []
    for (column, meaning), slides in zip(columns, measured.robot.prismatic, strict=True):
        units = LENGTHS if slides else ANGLES
        if meaning.unit not in units:
            wanted = f"{column}_{'mm' if slides else 'deg'}"
            raise measured.table.header_error(f"the unit is not stated; name the column {wanted}", column)
        scale.append(units[meaning.unit])
    remedy = "give the last move, or 0 where it is unknown"
    return measured.table.side_by_side([name for name, _ in columns], remedy=remedy) * scale


def _of_every_joint(measured: MeasuredTable, kind: Kind, turning: str, sliding: str) -> list[tuple[str, Meaning]]:
    """The column of each joint; none where no joint has one.

    Args:
        measured: the cells.
        kind: of the columns.
        turning: what follows the name of a joint that turns.
        sliding: what follows that of one that slides.
    """
    at = measured.by_joint(kind)
    for j, (name, slides) in enumerate(zip(measured.robot.joint_names, measured.robot.prismatic, strict=True)):
        if at and j not in at:
            have, lacking = next(iter(at.values()))[0], name + (sliding if slides else turning)
            raise measured.table.header_error(
                f"has '{have}' but no column '{lacking}'; give it, with 0 where it is unknown"
            )
    return [at[j] for j in sorted(at)]


def _refuse_nearly_known(measured: MeasuredTable) -> None:
    """A column that begins or ends as one that is read, and is none, was meant to be read."""
    for name, meaning in zip(measured.table.header, measured.known, strict=True):
        if meaning is None and re.search(r"_(approach|move_\w+|u_mm|[xyz]_\w+|deg|rad)$", name, re.IGNORECASE):
            known = KNOWN.format(joint=measured.robot.joint_names[0])
            raise measured.table.header_error(f"unknown column '{shown(name)}'; {known}")


def _left_out(measured: MeasuredTable) -> tuple[tuple[str, ...], tuple[str, ...], tuple[str, ...]]:
    """Columns that mean nothing to a campaign.

    Returns:
        A note of them beside what was measured, where numbers are among them, as these may have been meant; a note where all are
        texts; and those of lengths that might be what was measured.
    """
    table, known = measured.table, measured.known
    unused = _unused(known)
    left = [
        (name, split_unit(name)[1] or UNITS.get(under))
        for k, (name, under, meaning) in enumerate(zip(table.header, table.units, known, strict=True))
        if (meaning is None or meaning.kind == "nominal" or k in unused) and not re.fullmatch(r"column \d+|-", name)
    ]
    if not left:
        return (), (), ()
    ranges = {name: _range(table, name) for name, _ in left}
    taken = [name for name, m in zip(table.header, known, strict=True) if m and m.kind in ("position", "observed")]
    numbers = any(span is not None for span in ranges.values())
    beside = f"; measured: {shown(', '.join(taken))}" if taken and numbers else ""
    note = f"column{'s' if len(left) > 1 else ''} left out: {shown(', '.join(name for name, _ in left))}{beside}"
    if not numbers:
        return (), (note,), ()
    with_meaning = {name for name, meaning in zip(table.header, known, strict=True) if meaning is not None}
    return (
        (note,),
        (),
        tuple(
            name
            for name, unit in left
            if unit in LENGTHS and name not in with_meaning and LENGTHS[unit] * (ranges[name] or 0.0) > MIN_RANGE_M
        ),
    )


def _unused(known: Sequence[Meaning | None]) -> set[int]:
    """Columns of known meaning that are not read: parts of an uncertainty, rotations beside others, times without a unit."""
    at: dict[str, list[tuple[int, Meaning]]] = {}
    parts: dict[str, set[int]] = {}
    for k, meaning in enumerate(known):
        if meaning is not None:
            at.setdefault(meaning.kind, []).append((k, meaning))
            if meaning.kind == "uncertainty":
                parts.setdefault(meaning.target.casefold(), set()).add(meaning.index)
    out: set[int] = set()
    for k, meaning in at.get("uncertainty", []):
        own = parts[meaning.target.casefold()]
        out |= {k} if meaning.index != 3 and (3 in own or len(own) < 3) else set()
    quaternion, matrix = "quaternion" in at, len(at.get("matrix", [])) >= 9
    if quaternion or not matrix:
        out |= {k for k, _ in at.get("matrix", [])}
    if quaternion or matrix:
        out |= {k for k, _ in at.get("euler", [])}
    for kind in ("time", "temperature"):
        read = [k for k, meaning in at.get(kind, []) if kind == "temperature" or meaning.unit in TIMES]
        out |= {k for k, _ in at.get(kind, [])} - set(read[:1])
    return out


def _range(table: Table, column: str) -> float | None:
    """Range of a column's numbers; None where a cell is none."""
    try:
        return float(np.ptp(np.array([float(text) for text in table.texts(column) if text])))
    except ValueError:
        return None
