"""What one file of measurements says: joints, points, or both, before they are a campaign."""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from taskcal.errors import Faults, FileError, shown
from taskcal.geometry import se3
from taskcal.observations import ObservedColumns, kinds
from taskcal.observations.base import Quantity
from taskcal.reading.columns import (
    ANGLES,
    CALCULATED,
    FARTHEST,
    LENGTHS,
    TIMES,
    UNITS,
    Meaning,
    contradiction,
    meanings,
    numbered_parts,
    split_unit,
    stated_units,
)
from taskcal.robot.robot import Robot
from taskcal.tables.forms import TableForm, read_table
from taskcal.tables.table import LEAVE_OUT, UNIT_LENGTH, Table
from taskcal.tables.text import footer_note, is_statistic

# Joint positions in a table of measurements.

_OTHER_AXIS = re.compile(
    r"(?:e|ext|eax|external|external axis|zusatzachse) ?[1-6]|(?:linear axis|linearachse|rail|track)"
    r"|(?:j|joint|a|axis|achse|q) ?(?P<number>\d{1,2})"
)
"""Axes beside the robot's own, as controllers call them."""

_STILL = 1e-3
"""Range of an axis, at most, that stands still, in any unit. A convention: what an encoder flickers."""


@dataclass(frozen=True, kw_only=True, eq=False)
class JointColumns:
    """The joints of a table's rows."""

    columns: tuple[str, ...]
    """As the file names them, one for each joint."""
    values: Float[np.ndarray, "rows joints"]
    """Radians and metres where units are stated; as in the file where none is."""
    unit_stated: bool
    """False where no joint that turns has a unit."""


def joint_columns(table: Table, meanings: Sequence[Meaning | None], robot: Robot) -> JointColumns | None:
    """The joints of a table's rows; None where it has no column of a joint.

    Raises:
        FileError: a joint has no column, or two, or a joint too many, only some have a unit, or a cell is not a number.
    """
    at: dict[int, int] = {}
    for k, meaning in enumerate(meanings):
        if meaning is None or meaning.kind != "joint":
            continue
        if meaning.index >= len(robot.joints):
            count = len(robot.joints)
            message = f"is a joint that {robot.name} does not have; it has {count}: is it the right robot?"
            raise table.header_error(f"'{table.header[k]}' {message}")
        if meaning.index in at:
            twice = f"by '{table.header[at[meaning.index]]}' and '{table.header[k]}'"
            raise table.header_error(f"joint {robot.joint_names[meaning.index]} is given twice, {twice}; keep one")
        at[meaning.index] = k
    if not at:
        return None
    for number, (name, slides) in enumerate(zip(robot.joint_names, robot.prismatic, strict=True)):
        if number not in at:
            units = ("mm", "m") if slides else ("deg", "rad")
            raise table.header_error(
                f"has no column for joint {name} of {robot.name}; it needs one for each of {', '.join(robot.joint_names)}, such "
                f"as {name}_{units[0]} or q{number + 1}_{units[1]}"
            )
    return _values(table, meanings, robot, at)


def _values(table: Table, meanings: Sequence[Meaning | None], robot: Robot, at: dict[int, int]) -> JointColumns:
    stated = {number for number, k in at.items() if (m := meanings[k]) is not None and m.unit}
    turning = {number for number, slides in enumerate(robot.prismatic) if not slides}
    scale = np.ones(len(at))
    for number, slides in enumerate(robot.prismatic):
        name, meaning = table.header[at[number]], meanings[at[number]]
        assert meaning is not None
        known = LENGTHS if slides else ANGLES
        if meaning.unit in known:
            scale[number] = known[meaning.unit]
        elif meaning.unit is not None or slides or stated & turning:
            bare = robot.joint_names[number] if meaning.unit is not None else name
            wanted = " or ".join(f"{bare}_{unit}" for unit in (("mm", "m") if slides else ("deg", "rad")))
            what = f"'{meaning.unit}' is no unit of this joint" if meaning.unit else "the unit is not stated"
            raise table.header_error(f"{what}; name the column {wanted}", name)
    faults = Faults()
    values = np.full((len(table), len(at)), np.nan)
    for number, k in sorted(at.items()):
        with faults.collecting():
            values[:, number] = table.numbers(table.header[k], remedy=LEAVE_OUT)
    faults.raise_any()
    columns = tuple(table.header[at[number]] for number in range(len(at)))
    return JointColumns(columns=columns, values=values * scale, unit_stated=bool(stated & turning) or not turning)


def refuse_other_axes(table: Table, meanings: Sequence[Meaning | None], robot: Robot) -> None:
    """See that no axis moved that the robot does not have: rails carry it, and what is left out would seem an error of it.

    Raises:
        FileError: one did.
    """
    faults = Faults()
    for name, meaning in zip(table.header, meanings, strict=True):
        match = _OTHER_AXIS.fullmatch(split_unit(name)[0])
        if meaning is not None or match is None or (match["number"] and int(match["number"]) <= len(robot.joints)):
            continue
        try:
            values = table.numbers(name, empty=True, largest=np.inf)
        except FileError:
            continue
        seen = values[~np.isnan(values)]
        if len(seen) and np.ptp(seen) > _STILL:
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

_LARGEST_RADIANS = 2.0 * np.pi

_NOT_ORTHOGONAL = 1e-3
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


@dataclass(frozen=True, eq=False, kw_only=True)
class RotationColumns:
    """The orientations of a table's rows."""

    rotations: Float[np.ndarray, "rows 3 3"] | None = None
    """None where there are none."""
    rotated: str = ""
    """Whose they are, where their columns say."""
    others: Mapping[str, Float[np.ndarray, "rows 3 3"]] = field(default_factory=dict[str, np.ndarray])
    """Of further targets, by their names."""
    open_angles: OpenAngles | None = None
    notes: tuple[str, ...] = ()
    """What was decided of them."""


def rotations(
    table: Table,
    meanings: Sequence[Meaning | None],
    needed: Mapping[str, Bool[np.ndarray, " rows"]],
    form: AngleForm | None = None,
) -> RotationColumns:
    """The orientations of a table's rows.

    Args:
        table: the cells.
        meanings: of its columns.
        needed: rows that must have one, by target in small letters, empty for any; the others may be empty.
        form: what three angles mean, where their names do not say.

    Raises:
        FileError: columns are lacking, or a cell is not what it must be.
    """
    quaternions: dict[str, dict[int, int]] = {}
    for k, m in enumerate(meanings):
        if m and m.kind == "quaternion":
            quaternions.setdefault(m.target.casefold(), {})[m.index] = k
    matrix = {m.index: k for k, m in enumerate(meanings) if m and m.kind == "matrix"}
    angles = {m.index: k for k, m in enumerate(meanings) if m and m.kind == "euler"}
    if quaternions:
        turned: dict[str, np.ndarray] = {}
        for target, at in quaternions.items():
            first = meanings[next(iter(at.values()))]
            assert first is not None
            turned[first.target] = _of_quaternions(table, at, needed.get(target, needed[""]))
        rotated = next(iter(turned))
        return RotationColumns(rotations=turned.pop(rotated), rotated=rotated, others=turned)
    if len(matrix) >= 9:
        return RotationColumns(rotations=_of_matrices(table, matrix, needed[""]))
    if angles:
        return _of_angles(table, meanings, angles, needed[""], form)
    return RotationColumns()


def _of_quaternions(table: Table, at: dict[int, int], needed: np.ndarray) -> np.ndarray:
    header = table.header
    for part in range(4):
        if part not in at:
            have = header[next(iter(at.values()))]
            lacking = f"q{'xyzw'[part]}"
            raise table.header_error(f"has '{have}' but no column '{lacking}'; a pose needs qx qy qz qw")
    cells = np.stack([table.numbers(header[at[part]], empty=True) for part in range(4)], axis=1)
    _refuse_empty(table, cells, [header[at[part]] for part in range(4)], needed, "a pose needs all of qx qy qz qw")
    lengths = np.linalg.norm(cells, axis=1)
    for row in np.flatnonzero(needed & (np.abs(lengths - 1.0) > UNIT_LENGTH)):
        message = f"the quaternion has length {lengths[row]:.4f}; it must be 1 (is qw last?)"
        raise table.error(message, int(row), header[at[0]])
    cells[~needed] = (0.0, 0.0, 0.0, 1.0)
    return se3.from_quaternion(cells)


def _of_matrices(table: Table, at: dict[int, int], needed: np.ndarray) -> np.ndarray:
    """Nine of the elements, counted from 0 or from 1."""
    first = min(index % 10 for index in at)
    elements = [10 * (i + first) + j + first for i in range(3) for j in range(3)]
    lacking = [index for index in elements if index not in at]
    if lacking:
        have = table.header[next(iter(at.values()))]
        raise table.header_error(
            f"has '{have}' but lacks row {lacking[0] // 10}, column {lacking[0] % 10} of the matrix"
        )
    names = [table.header[at[index]] for index in elements]
    cells = np.stack([table.numbers(name, empty=True) for name in names], axis=1)
    _refuse_empty(table, cells, names, needed, "a pose needs all nine elements")
    R = cells.reshape(-1, 3, 3)
    R[~needed] = np.eye(3)
    off = np.abs(R @ R.transpose(0, 2, 1) - np.eye(3)).max(axis=(1, 2))
    for row in np.flatnonzero((off > _NOT_ORTHOGONAL) | (np.linalg.det(R) < 0.0)):
        turned = "mirrors; is an axis or a sign swapped?" if np.linalg.det(R[row]) < 0 else "is not a rotation"
        raise table.error(f"the matrix {turned}", int(row), names[0])
    return se3.nearest_rotation(R)


def _of_angles(
    table: Table, meanings: Sequence[Meaning | None], at: dict[int, int], needed: np.ndarray, form: AngleForm | None
) -> RotationColumns:
    names = [table.header[at[i]] for i in range(3)]
    first = meanings[at[0]]
    if form == "none" or first is None:
        return RotationColumns()
    cells = np.stack([table.numbers(name, empty=True) for name in names], axis=1)
    _refuse_empty(table, cells, names, needed, "a pose needs all three angles")
    cells[~needed] = 0.0
    if form is not None or first.form == "rotvec":
        what, unit = _stated(first, form)
        return RotationColumns(rotations=_turned(cells, what, unit))
    unit = first.unit or {"abc": "deg", "wpr": "deg"}.get(first.form)
    largest = np.abs(cells).max(initial=0.0)
    if first.unit is None and unit is not None and 0.0 < largest <= np.pi:
        message = (
            f"no angle of {' '.join(names)} is beyond 3.14: they may be radians; name the columns {names[0]}_deg … or "
            f"{names[0]}_rad …"
        )
        raise table.header_error(message, names[0])
    units = [unit] if unit else ["deg", "rad"] if largest <= _LARGEST_RADIANS else ["deg"]
    meant = {
        what if what in ("abc", "wpr") else f"{what}-{unit}": _turned(cells, what, unit)
        for unit in units
        for what in _CANDIDATES[first.form]
    }
    assumed = None if first.form == "rxyz" or unit is None else next(iter(meant))
    return RotationColumns(
        rotations=None if assumed is None else meant[assumed],
        open_angles=OpenAngles(columns=" ".join(names), assumed=assumed, meanings=meant),
    )


def _turned(cells: Float[np.ndarray, "rows 3"], what: str, unit: str) -> Float[np.ndarray, "rows 3 3"]:
    angles = cells * ANGLES[unit]
    if what == "rotation-vector":
        return se3.exp(angles)
    if what in _MOVING:
        return se3.turns(_MOVING[what], angles)
    return se3.turns("zyx", angles[:, ::-1])


def _stated(first: Meaning, form: AngleForm | None) -> tuple[str, str]:
    """What angles mean and their unit, by the user's word, or by their name where they are a rotation vector."""
    if form is None:
        return "rotation-vector", first.unit or "rad"
    if form in ("abc", "wpr"):
        return form, first.unit or "deg"
    what, _, unit = form.rpartition("-")
    return what, first.unit or unit


def _refuse_empty(table: Table, cells: np.ndarray, names: Sequence[str], needed: np.ndarray, why: str) -> None:
    for row, k in np.argwhere(np.isnan(cells) & needed[:, None]).tolist():
        raise table.error(f"the cell is empty while the position is there; {why}", row, names[k])


# Positions as an instrument turns to them: an azimuth, an elevation or a zenith angle, and a range.

_AZIMUTH = (
    "azimuth",
    "azimuth angle",
    "az",
    "azim",
    "azimut",
    "horizontal angle",
    "hor angle",
    "h angle",
    "horizontalwinkel",
)
_CLOCKWISE = ("hz", "hz angle", "hz winkel")
"""What theodolites turn, clockwise seen from above."""
_ELEVATION = ("elevation", "elevation angle", "elev", "el", "höhenwinkel", "hoehenwinkel")
_ZENITH = ("zenith", "zenith angle", "zenitwinkel", "zenitdistanz", "zenithdistanz", "zenit", "ze")
_EITHER = ("v", "vertical", "vertical angle", "v angle", "vertikalwinkel", "v winkel", "phi", "φ")
"""Counted from the horizontal by some and from the zenith by others; beside Hz theodolites count it from the zenith."""
_RANGE = (
    "range", "distance", "dist", "d", "r", "radius", "slope distance", "slope dist", "sd", "distanz", "entfernung",
    "schrägdistanz", "schraegdistanz", "schrägstrecke", "strecke",
)  # fmt: skip
_THETA = ("theta", "θ")


@dataclass(frozen=True, kw_only=True)
class _Directed:
    """The columns of one target."""

    target: str
    azimuth: int
    clockwise: bool
    polar: int
    from_zenith: bool
    range: int


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
    directed = _directed(table, [text for text, _ in parted])
    for columns in directed:
        units = [parted[k][1] or UNITS.get(table.units[k]) for k in (columns.azimuth, columns.polar, columns.range)]
        table = _replaced(table, columns, units)
    return table


def _directed(table: Table, texts: Sequence[str]) -> list[_Directed]:
    """The columns of each target that has all three."""
    by_target: dict[str, dict[str, int]] = {}
    for k, text in enumerate(texts):
        for kind, names in (
            ("azimuth", _AZIMUTH), ("clockwise", _CLOCKWISE), ("elevation", _ELEVATION), ("zenith", _ZENITH), ("either", _EITHER),
            ("range", _RANGE), ("theta", _THETA),
        ):  # fmt: skip
            name = next((n for n in sorted(names, key=len, reverse=True) if text == n or text.endswith(f" {n}")), None)
            if name is not None:
                by_target.setdefault(text[: len(text) - len(name)].strip(), {}).setdefault(kind, k)
                break
    out: list[_Directed] = []
    for target, at in by_target.items():
        turned = at.get("azimuth", at.get("clockwise"))
        if "range" not in at:
            continue
        polar = next((at[kind] for kind in ("elevation", "zenith") if kind in at), None)
        if polar is None and "clockwise" in at:
            polar = at.get("either")
        if turned is not None and polar is not None:
            zenith = "elevation" not in at
            clockwise = "azimuth" not in at
            out.append(
                _Directed(
                    target=target,
                    azimuth=turned,
                    clockwise=clockwise,
                    polar=polar,
                    from_zenith=zenith,
                    range=at["range"],
                )
            )
        elif "either" in at and (turned is not None or "theta" in at):
            name = table.header[at["either"]]
            message = (
                "is counted from the horizontal by some instruments and from the zenith by others; name it elevation or zenith, "
                "the angle about the vertical azimuth"
            )
            raise table.header_error(f"'{name}' {message}", name)
    return out


def _replaced(table: Table, columns: _Directed, units: Sequence[str | None]) -> Table:
    """The table with one target's position in place of its angles and range."""
    header = table.header
    angle = stated_units(table.preamble).angle
    scales: list[float] = []
    for k, unit in zip((columns.azimuth, columns.polar), units[:2], strict=True):
        unit = unit or angle
        if unit not in ANGLES:
            what = "the unit of the angle is not stated" if unit is None else f"'{unit}' is no unit of an angle"
            raise table.header_error(f"{what}; name the column {header[k]}_deg, _rad or _gon", header[k])
        scales.append(ANGLES[unit])
    if units[2] is not None and units[2] not in LENGTHS:
        raise table.header_error(
            f"'{units[2]}' is no unit of length; known: {', '.join(LENGTHS)}", header[columns.range]
        )
    cells = [table.numbers(header[k], empty=True) for k in (columns.azimuth, columns.polar, columns.range)]
    points = _cartesian(columns, cells[0] * scales[0], cells[1] * scales[1], cells[2])
    prefix, unit = columns.target and f"{columns.target} ", f" {units[2]}" if units[2] else ""
    names = dict(
        zip((columns.azimuth, columns.polar, columns.range), (f"{prefix}{a}{unit}" for a in "xyz"), strict=True)
    )
    axis = {k: i for i, k in enumerate(names)}
    rows = table.cells.with_columns({k: [_text(x) for x in points[:, i]] for k, i in axis.items()})
    note = (
        f"{', '.join(header[k] for k in names)} are read as an azimuth that turns "
        f"{'clockwise' if columns.clockwise else 'counter-clockwise'} seen from above, an angle from the "
        f"{'zenith' if columns.from_zenith else 'horizontal'} and a range"
    )
    return replace(
        table,
        header=tuple(names.get(k, name) for k, name in enumerate(header)),
        rows=rows,
        units=tuple("" if k in names else under for k, under in enumerate(table.units)),
    ).noted(note)


def _cartesian(
    columns: _Directed, azimuth: np.ndarray, polar: np.ndarray, distance: np.ndarray
) -> Float[np.ndarray, "rows 3"]:
    """x, y and z in the unit of the range; NaN where the beam was lost."""
    elevation = np.pi / 2 - polar if columns.from_zenith else polar
    turned = -azimuth if columns.clockwise else azimuth
    level = distance * np.cos(elevation)
    points = np.stack([level * np.cos(turned), level * np.sin(turned), distance * np.sin(elevation)], axis=1)
    points[distance == 0.0] = np.nan
    return points


def _text(value: float) -> str:
    return "" if np.isnan(value) else repr(float(value))


# Rows that sum others up, which spreadsheets and instruments write below their tables.


def without_summaries(table: Table, meanings: Sequence[Meaning | None]) -> Table:
    """The table without rows whose id is the name of a statistic, such as ``Mean``; a note says which.

    Args:
        table: whose rows they are.
        meanings: of its columns.
    """
    named = [k for k, meaning in enumerate(meanings) if meaning is not None and meaning.kind == "id"]
    summing = {row: cells[k] for row, cells in enumerate(table.rows) for k in named if is_statistic(cells[k])}
    if not summing:
        return table
    listed = footer_note([int(table.lines[row]) for row in summing], [(text,) for text in summing.values()])
    rest = table.take(np.array([row not in summing for row in range(len(table))]))
    return rest.noted(f"rows that sum others up are left out: {listed}")


# What instruments and programs write in place of a point that they did not see.

_LOST = re.compile(
    r"nan|nil|none|null|n/?a|#n/a|#nv|#value!|-+|–|—|\?+|\*+|inf|lost|no data|beam lost|invalid|[+-]?9{4,}(?:\.[09]*)?",
    re.ASCII | re.IGNORECASE,
)
"""All three cells of a target are the same."""


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
            lines = ", ".join(str(table.lines[row]) for row in rows[:5]) + (", …" if len(rows) > 5 else "")
            return rows, (f"what was measured is taken for lost where '{shown(name, 40)}' says so (line {lines})",)
    return [], ()


def without_lost(table: Table, columns: Sequence[str]) -> tuple[Table, tuple[str, ...]]:
    """A table whose cells of a target are empty where all three hold one word, or the nines, for a beam that was lost.

    Args:
        table: the cells.
        columns: of the target's axes.

    Returns:
        The table, and a note of what was taken for a lost beam.
    """
    axes = [table.header.index(column) for column in columns]
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
    rows = table.cells.with_columns(dict(zip(axes, by_axis, strict=True)))
    words = ", ".join(f"'{shown(word, 20)}'" for word in dict.fromkeys(lost.values()))
    lines = ", ".join(str(table.lines[row]) for row in list(lost)[:5]) + (", …" if len(lost) > 5 else "")
    return replace(table, rows=rows), (f"{words} for {columns[0]} … is taken for a lost beam (line {lines})",)


# Positions of targets in a table of measurements: columns for each target, or a row for each.

MAX_UNCERTAINTY = 0.01
"""Standard uncertainty, metres, at most, under a name that positions have too. A convention: no instrument that calibrates
robots has as much."""

SMALL = 0.01
"""Uncertainty over the largest coordinate, at most, where the unit of both is unknown. A convention: 10 mm on a metre."""

LEAVE_EMPTY = "give a number, or leave all the target's cells empty"

MAX_TARGETS = 100
"""On one tool; plates for trackers carry up to a dozen reflectors, and the fit's matrices grow with the square."""

_OFF = re.compile(
    r"(?:^|[\s_.\-])(?:dif|diff|difference|dev|deviation|delta|err|error|residual|abw|abweichung)(?:$|[\s_.\-])", re.I
)
"""Names of how far the robot was off."""


class _Uncertainty(NamedTuple):
    """Of one target."""

    values: Float[np.ndarray, " rows"]
    stated: bool
    """Whether it has a unit, and is in metres."""


@dataclass(frozen=True, kw_only=True, eq=False)
class TargetColumns:
    """The positions of a table's rows."""

    points: dict[str, Float[np.ndarray, "rows 3"]]
    """By target, ``tool`` where the file names none; NaN for a lost beam. Metres, or as in the file where no unit is stated."""
    uncertainty: dict[str, Float[np.ndarray, " rows"]]
    """Standard uncertainty per axis, by the target whose it is, empty for all; units as of the points, or metres."""
    uncertainty_stated: frozenset[str] = frozenset()
    """Those of them that are in metres, whatever the points are in."""
    unit_stated: bool
    """False where no position has a unit."""
    notes: tuple[str, ...] = ()
    """What was decided on the way."""


def target_columns(table: Table, meanings: Sequence[Meaning | None]) -> TargetColumns:
    """The positions of a table's rows, and how sure they are.

    Raises:
        FileError: an axis is lacking or given twice, only some have a unit, or a cell is not what it must be.
    """
    places: dict[str, dict[int, int]] = {}
    names: dict[str, str] = {}
    for k, meaning in enumerate(meanings):
        if meaning is None or meaning.kind != "position":
            continue
        axes = places.setdefault(meaning.target.casefold(), {})
        names.setdefault(meaning.target.casefold(), meaning.target)
        if meaning.index in axes:
            twice = f"'{table.header[axes[meaning.index]]}' and '{table.header[k]}'"
            raise table.header_error(f"{twice} are both the {'xyz'[meaning.index]} of one target; keep one")
        axes[meaning.index] = k
    _refuse_goals(table, meanings, places)
    if len(places) > 10 * MAX_TARGETS:
        raise table.header_error(f"names {len(places)} targets; Taskcal fits {MAX_TARGETS} at most: choose some")
    units = {low: _unit(table, meanings, names[low], axes) for low, axes in places.items()}
    stated = {unit is not None for unit in units.values()}
    if len(stated) > 1:
        without = next(low for low, unit in units.items() if unit is None)
        column = table.header[places[without][0]]
        raise table.header_error(f"the unit is not stated; name the column {column}_mm", column)
    points: dict[str, np.ndarray] = {}
    notes: list[str] = []
    faults = Faults()
    for low, axes in places.items():
        table, lost = without_lost(table, [table.header[axes[i]] for i in range(3)])
        notes += lost
        with faults.collecting():
            points[names[low] or "tool"] = _positions(table, [table.header[axes[i]] for i in range(3)], units[low])
    uncertainty: dict[str, _Uncertainty] = {}
    with faults.collecting():
        farthest = max((float(np.nanmax(np.abs(values), initial=0.0)) for values in points.values()), default=0.0)
        uncertainty = _uncertainty(table, meanings, set(units.values()), SMALL * farthest)
    short = [table.header[k] for k, m in enumerate(meanings) if m and m.kind == "uncertainty" and m.form]
    if short and uncertainty:
        notes.append(f"{shown(', '.join(short))} are read as standard uncertainties")
    faults.raise_any()
    invalid, said = rows_not_valid(table) if points else ([], ())
    for values in points.values():
        values[invalid] = np.nan
    notes += said
    return TargetColumns(
        points=points,
        uncertainty={name: one.values for name, one in uncertainty.items()},
        uncertainty_stated=frozenset(name for name, one in uncertainty.items() if one.stated),
        unit_stated=stated != {False},
        notes=tuple(notes),
    )


def _refuse_goals(table: Table, meanings: Sequence[Meaning | None], places: dict[str, dict[int, int]]) -> None:
    """Goals, and how far the robot was off them, are not what was measured, though it follows from both."""
    if not places or not places.keys() <= CALCULATED:
        return
    off = [
        name for name, m in zip(table.header, meanings, strict=True) if m and m.kind == "nominal" and _OFF.search(name)
    ]
    if off:
        goal = table.header[min(k for axes in places.values() for k in axes.values())]
        message = (
            f"has goals ('{shown(goal)}') and differences from them ('{shown(off[0])}'), not points; add columns of what was "
            "measured"
        )
        raise table.header_error(message)


def _unit(table: Table, meanings: Sequence[Meaning | None], name: str, axes: dict[int, int]) -> str | None:
    """The unit of a target's axes, all of which must be there and in the same."""
    have = table.header[next(iter(axes.values()))]
    for axis in range(3):
        if axis not in axes:
            spelled = have[: len(have) - len("x_mm")] if have.lower().endswith("_mm") else (f"{name}_" if name else "")
            raise table.header_error(f"has '{have}' but no column '{spelled}{'xyz'[axis]}_mm'")
    columns = {table.header[k]: m.unit for k in axes.values() if (m := meanings[k]) is not None}
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
    faults = Faults()
    largest = FARTHEST / LENGTHS[unit or "mm"]
    points = np.full((len(table), 3), np.nan)
    for axis, column in enumerate(columns):
        with faults.collecting():
            points[:, axis] = table.numbers(column, empty=True, remedy=LEAVE_EMPTY, largest=largest)
    faults.raise_any()
    blank = np.isnan(points)
    for row in np.flatnonzero(blank.any(axis=1) & ~blank.all(axis=1)):
        with faults.collecting():
            message = "the cell is empty while its target's others are not; leave all three empty for a lost beam, or drop the row"
            raise table.error(message, int(row), columns[int(np.argmax(blank[row]))])
    faults.raise_any()
    points[(points == 0.0).all(axis=1)] = np.nan
    return points * (LENGTHS[unit] if unit else 1.0)


def _uncertainty(
    table: Table, meanings: Sequence[Meaning | None], units: set[str | None], largest: float
) -> dict[str, _Uncertainty]:
    """By target; of three axes the root mean square. Without a unit of its own it is as the positions are, if these are in mm."""
    if not units and not any(m and m.kind == "observed" for m in meanings):
        return {}
    columns: dict[str, dict[int, int]] = {}
    for k, meaning in enumerate(meanings):
        if meaning is not None and meaning.kind == "uncertainty":
            columns.setdefault(meaning.target.casefold(), {})[meaning.index] = k
    out: dict[str, _Uncertainty] = {}
    for target, at in columns.items():
        chosen = [at[3]] if 3 in at else [at[i] for i in range(3) if i in at]
        if 3 not in at and len(chosen) < 3:
            continue
        own = {m.unit for k in chosen if (m := meanings[k])}
        unit = next(iter(own)) or ("mm" if units == {"mm"} else None)
        if len(own) > 1:
            raise table.header_error("the axes of one uncertainty have different units", table.header[chosen[0]])
        if unit is None and units != {None}:
            bare = table.header[chosen[0]]
            raise table.header_error(f"the unit is not stated; name the column {bare}_mm", bare)
        if unit is not None and unit not in LENGTHS:
            message = f"'{unit}' is not a unit of length; known: {', '.join(LENGTHS)}"
            raise table.header_error(message, table.header[chosen[0]])
        scale = 1.0 if unit is None else LENGTHS[unit]
        squares = np.zeros(len(table))
        for k in chosen:
            meaning, values = meanings[k], table.numbers(table.header[k])
            if meaning and meaning.form == "s":
                _refuse_positions(table, table.header[k], values, largest if unit is None else MAX_UNCERTAINTY / scale)
            for row in np.flatnonzero(values <= 0.0):
                message = f"{values[row]:g} is not a standard uncertainty; give one above zero"
                raise table.error(message, int(row), table.header[k])
            squares += (values * scale) ** 2
        out[target] = _Uncertainty(np.sqrt(squares / len(chosen)), unit is not None)
    return out


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
_UNNAMED_NUMBER = re.compile(r"[+-]?(\d+(?:\.\d*)?|\.\d+)(e[+-]?\d+)?", re.ASCII | re.IGNORECASE)

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
    named = [*options[0], *["-"] * (width - len(options[0]))]
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
    q = np.array([[float(cell) for cell in row] for row in rows if all(map(_UNNAMED_NUMBER.fullmatch, row))])
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
    """How many columns of words come first, counts between them included, and how many of numbers follow them.

    A first column with a word in it is one of words, any other where most of its cells are.
    """
    rows = table.rows
    sample = rows[:_SAMPLED]
    words = [
        2 * sum(not (_UNNAMED_NUMBER.fullmatch(row[k]) or is_lost(row[k])) for row in sample) > len(sample)
        for k in range(len(table.header))
    ]
    words[0] = not all(_UNNAMED_NUMBER.fullmatch(row[0]) for row in rows)
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
    values = np.array([[float(cell) for cell in row] for row in rows if all(map(_UNNAMED_NUMBER.fullmatch, row))])
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
    """Of distances; 0 of too few."""
    if len(first) < 6 or first.std() == 0.0 or second.std() == 0.0:
        return 0.0
    return float(np.corrcoef(first, second)[0, 1])


LEAST_RANGE = 0.01
"""Of a column of lengths that may be what was measured, metres: uncertainties and deviations vary by less."""

MAX_TIME_S = 1e7
"""No robot works so many seconds before it is measured; clocks count more."""

_NUMBER = re.compile(r"[+-]?(?:\d+(?:\.\d*)?|\.\d+)(?:e[+-]?\d+)?", re.ASCII | re.IGNORECASE)

KNOWN = (
    "a campaign has id, joints ({joint}_deg …), targets (x_mm … or NAME_x_mm …), qx qy qz qw, u_mm, temp_C, time_s, "
    "{joint}_approach …"
)
"""What columns there may be."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Readings:
    """The rows of one file."""

    path: Path
    ids: tuple[str, ...] | None
    """As the file names its rows, repeated where it repeats them; None where it does not."""
    groups: tuple[str, ...] | None
    """Of points that have names of their own in each; None where the file states none, or one throughout."""
    lines: Int[np.ndarray, " n"]
    """Of the file, from 1."""
    q: Float[np.ndarray, "n joints"] | None
    """Radians and metres; where `joint_unit_stated` is false, as in the file."""
    joint_unit_stated: bool
    joint_columns: tuple[str, ...]
    """As the file names them."""
    points: Mapping[str, Float[np.ndarray, "n 3"]]
    """By target, metres; where `length_unit_stated` is false, as in the file. NaN for a lost beam."""
    length_unit_stated: bool
    uncertainty: Mapping[str, Float[np.ndarray, " n"]]
    """By target in small letters, empty for all; as the points."""
    uncertainty_stated: frozenset[str]
    """Those of them that are in metres, whatever the points are in."""
    rotations: Float[np.ndarray, "n 3 3"] | None
    open_angles: OpenAngles | None
    """Where it is open what three angles mean."""
    rotated: str
    """Whose rotations they are, where their columns say."""
    other_rotations: Mapping[str, Float[np.ndarray, "n 3 3"]]
    """Of further targets, by their names."""
    temperature: Float[np.ndarray, " n"] | None
    """°C."""
    time: Float[np.ndarray, " n"] | None
    """Seconds."""
    approach: Float[np.ndarray, "n joints"] | None
    """1, −1, or 0 where it is unknown."""
    move: Float[np.ndarray, "n joints"] | None
    """Radians and metres."""
    targets_by_row: tuple[str, ...] | None
    """Whose position each row holds, where a column says."""
    observed: ObservedColumns | None
    """Columns of kinds of observation that need no tracker; None where there are none."""
    preamble: tuple[str, ...]
    """Lines above the table and comments."""
    left_lengths: tuple[str, ...]
    """Columns of lengths that were left out and vary by more than `LEAST_RANGE`."""
    notes: tuple[str, ...]
    """What was decided on the way."""

    def __len__(self) -> int:
        return len(self.lines)

    def take(self, rows: Int[np.ndarray, " k"]) -> "Readings":
        """Some of the rows."""

        def pick(value: np.ndarray | None) -> np.ndarray | None:
            return None if value is None else value[rows]

        return replace(
            self,
            ids=None if self.ids is None else tuple(self.ids[i] for i in rows),
            groups=None if self.groups is None else tuple(self.groups[i] for i in rows),
            lines=self.lines[rows],
            q=pick(self.q),
            points={name: points[rows] for name, points in self.points.items()},
            uncertainty={name: u[rows] for name, u in self.uncertainty.items()},
            rotations=pick(self.rotations),
            other_rotations={name: R[rows] for name, R in self.other_rotations.items()},
            open_angles=None if self.open_angles is None else self.open_angles.mapped(lambda R: R[rows]),
            temperature=pick(self.temperature),
            time=pick(self.time),
            approach=pick(self.approach),
            move=pick(self.move),
            targets_by_row=None if self.targets_by_row is None else tuple(self.targets_by_row[i] for i in rows),
            observed=None if self.observed is None else self.observed.take(rows),
        )


def read_readings(
    path: str | Path, robot: Robot, form: TableForm | None = None, angles: AngleForm | None = None
) -> Readings:
    """Read what one file says, whatever its form and its columns' names.

    Args:
        path: the file.
        robot: the robot that was measured.
        form: what is stated of the table.
        angles: what three angles of a pose mean, where their names do not say.

    Raises:
        FileError: with all that is wrong in it, the first twenty faults.
    """
    table = with_positions(name_columns(read_table(path, form), robot))
    known = meanings(table.header, table.units, robot.joint_names, _numbered_parts(table))
    table = without_summaries(table, known)
    faults = Faults()
    for fault in table.faults:
        with faults.collecting():
            raise fault
    _refuse_two_units(table, faults)
    joints: JointColumns | None = None
    with faults.collecting():
        joints = joint_columns(table, known, robot)
    targets = TargetColumns(points={}, uncertainty={}, unit_stated=True)
    with faults.collecting():
        targets = target_columns(table, known)
    turned = RotationColumns()
    with faults.collecting():
        turned = rotations(table, known, _posed(targets, len(table)), angles)
    ids, targets_by_row = None, _texts(table, known, "target")
    with faults.collecting():
        ids = _ids(table, known)
    groups = _groups(table, known)
    if ids is None and groups is not None:
        # of a group in which targets have names, or the rows none
        ids, groups = groups, None
    temperature = time = approach = move = None
    with faults.collecting():
        temperature, time = _temperature(table, known), _time(table, known)
    with faults.collecting():
        approach, move = _approaches(table, known, robot), _moves(table, known, robot)
    with faults.collecting():
        _refuse_nearly_known(table, known, robot)
    with faults.collecting():
        refuse_other_axes(table, known, robot)
    with faults.collecting():
        _refuse_unlabelled(table, known)
    faults.raise_any()
    if not len(table):
        raise FileError(table.path, "has no measurements below its header")
    observed = _observed(table, known)
    if joints is None and not any(np.isfinite(points).any() for points in targets.points.values()):
        _refuse_nothing_measured(table, observed, robot)
    left = _left_out(table, known)
    return Readings(
        path=table.path,
        ids=ids,
        groups=groups,
        lines=np.array(table.lines, dtype=np.int64),
        q=None if joints is None else joints.values,
        joint_unit_stated=joints is None or joints.unit_stated,
        joint_columns=() if joints is None else joints.columns,
        points=targets.points,
        length_unit_stated=targets.unit_stated,
        uncertainty=targets.uncertainty,
        uncertainty_stated=targets.uncertainty_stated,
        rotations=turned.rotations,
        open_angles=turned.open_angles,
        rotated=turned.rotated,
        other_rotations=turned.others,
        temperature=temperature,
        time=time,
        approach=approach,
        move=move,
        targets_by_row=targets_by_row,
        observed=observed,
        preamble=table.preamble,
        left_lengths=left.lengths,
        notes=(*left.numbers, *table.notes, *targets.notes, *turned.notes, *left.notes),
    )


def _refuse_nothing_measured(table: Table, observed: ObservedColumns | None, robot: Robot) -> None:
    """See that a file without joints and positions holds a number that was measured in another way.

    Raises:
        FileError: it does not.
    """
    if observed is not None and any(_NUMBER.fullmatch(cell) for cells in observed.cells.values() for cell in cells):
        return
    joint = robot.joint_names[0]
    columns = shown(", ".join(table.header), 200)
    message = (
        f"holds no measured number: none of its columns ({columns}) is read as a joint of {robot.name} or a position; "
        f"name them {joint}_deg … and x_mm y_mm z_mm, in the file or with --columns"
    )
    raise FileError(table.path, message, line=table.header_line)


def _quantity(unit: str | None) -> tuple[Quantity, float] | None:
    """Quantity of a unit, and its factor to metres or radians."""
    if unit in LENGTHS:
        return "length", LENGTHS[unit]
    return ("angle", ANGLES[unit]) if unit in ANGLES else None


def _observed(table: Table, known: Sequence[Meaning | None]) -> ObservedColumns | None:
    """Columns of kinds of observation that need no tracker."""
    at = {m.target: (table.header[k], m.unit) for k, m in enumerate(known) if m is not None and m.kind == "observed"}
    if not at:
        return None
    return ObservedColumns(
        path=table.path,
        lines=np.array(table.lines, dtype=np.int64),
        cells={column: tuple(table.texts(name)) for column, (name, _) in at.items()},
        headers={column: name for column, (name, _) in at.items()},
        units={column: _quantity(unit) for column, (_, unit) in at.items()},
    )


def _refuse_two_units(table: Table, faults: Faults) -> None:
    """Note columns whose names state one unit and the row of units another."""
    for name, under in zip(table.header, table.units, strict=True):
        if units := contradiction(name, under):
            message = f"the name states {units[0]}, the row of units {units[1]}; mend one of them"
            with faults.collecting():
                raise table.header_error(message, name)


def _posed(targets: TargetColumns, rows: int) -> dict[str, Bool[np.ndarray, " rows"]]:
    """Rows with a position, which need a rotation too: by target in small letters, and of any."""
    seen = {name.casefold(): ~np.isnan(points[:, 0]) for name, points in targets.points.items()}
    return {**seen, "": np.any(list(seen.values()), axis=0) if seen else np.ones(rows, dtype=bool)}


def _numbered_parts(table: Table) -> list[int]:
    """Columns ``Q0 … Q3`` or ``Q1 … Q4`` that hold a quaternion, the scalar first: its length is one in every row."""
    at = numbered_parts(table.header)
    rows = [row for row in zip(*(table.texts(table.header[k]) for k in at), strict=True) if all(row)]
    try:
        lengths = np.linalg.norm(np.array(rows, dtype=float).reshape(-1, 4), axis=1)
    except ValueError:
        return []
    return at if np.abs(lengths - 1.0).max(initial=0.0) <= UNIT_LENGTH and rows else []


def _refuse_unlabelled(table: Table, known: Sequence[Meaning | None]) -> None:
    """See that positions in the frame of a sensor on the tool are not taken for those of a target.

    Raises:
        FileError: they lack the column that names what was seen.
    """
    for kind in kinds():
        words = {word for column in kind.needed for word in kind.columns[column]}
        for name, meaning in zip(table.header, known, strict=True):
            if meaning is not None and meaning.kind == "position" and split_unit(name)[0] in words:
                message = (
                    f"what a sensor on the tool sees needs a column '{kind.label}' that names it; add one, or rename the columns, "
                    "as in smr_x_mm, if an instrument beside the robot measured them"
                )
                raise table.header_error(message, name)


def _texts(table: Table, known: Sequence[Meaning | None], kind: str) -> tuple[str, ...] | None:
    at = [k for k, meaning in enumerate(known) if meaning is not None and meaning.kind == kind]
    return tuple(table.texts(table.header[at[0]])) if at else None


def _groups(table: Table, known: Sequence[Meaning | None]) -> tuple[str, ...] | None:
    """The group of every row, of collections in which groups stand too; None where all rows are of one."""
    at = [k for k, meaning in enumerate(known) if meaning is not None and meaning.kind == "group"]
    columns = [texts for k in at if len(set(texts := table.texts(table.header[k]))) > 1]
    return tuple(map(" ".join, zip(*columns, strict=True))) if columns else None


def _ids(table: Table, known: Sequence[Meaning | None]) -> tuple[str, ...] | None:
    """From the surest column of names that names every row differently, or else from the surest that is there.

    Raises:
        FileError: a row has no name.
    """
    at = sorted((m.index, k) for k, m in enumerate(known) if m is not None and m.kind == "id")
    if not at:
        return None
    columns = [table.header[k] for _, k in at]
    texts = {column: table.texts(column) for column in columns}
    own = next((c for c in columns if all(texts[c]) and len(set(texts[c])) == len(table)), None)
    words = next((c for c in columns if all(texts[c]) and not all(re.fullmatch(r"\d+", t) for t in texts[c])), None)
    chosen = own or (columns[0] if len(columns) == 1 else words) or columns[0]
    faults = Faults()
    for row, text in enumerate(texts[chosen]):
        if not text:
            with faults.collecting():
                raise table.error("the row has no id; give each row its own", row, chosen)
    faults.raise_any()
    return tuple(texts[chosen])


def _temperature(table: Table, known: Sequence[Meaning | None]) -> np.ndarray | None:
    at = [k for k, m in enumerate(known) if m is not None and m.kind == "temperature"]
    return table.numbers(table.header[at[0]], empty=True) if at else None


def _time(table: Table, known: Sequence[Meaning | None]) -> np.ndarray | None:
    """Seconds since the robot began to work."""
    at = [k for k, m in enumerate(known) if m is not None and m.kind == "time" and m.unit in TIMES]
    if not at:
        return None
    meaning, column = known[at[0]], table.header[at[0]]
    assert meaning is not None
    assert meaning.unit is not None
    time = table.numbers(column, empty=True, largest=np.inf) * TIMES[meaning.unit]
    wrong = np.flatnonzero((time < 0.0) | (time > MAX_TIME_S))
    if len(wrong):
        message = f"{time[wrong[0]]:g} s is not a time since the robot began to work; subtract the time when it did"
        raise table.error(message, int(wrong[0]), column)
    return time


def _approaches(table: Table, known: Sequence[Meaning | None], robot: Robot) -> np.ndarray | None:
    columns = _of_every_joint(table, known, robot, "approach", [f"{name}_approach" for name in robot.joint_names])
    if not columns:
        return None
    approach = np.stack([table.numbers(c, remedy="give 1, -1, or 0 where it is unknown") for c in columns], axis=1)
    for row, j in zip(*np.nonzero(~np.isin(approach, (-1.0, 0.0, 1.0))), strict=True):
        message = f"{approach[row, j]:g} is not a way of approach; give 1 (the joint's value grew), -1 (it fell) or 0 (unknown)"
        raise table.error(message, int(row), columns[j])
    return approach


def _moves(table: Table, known: Sequence[Meaning | None], robot: Robot) -> np.ndarray | None:
    endings = [
        f"{name}_move_{'mm' if slides else 'deg'}"
        for name, slides in zip(robot.joint_names, robot.prismatic, strict=True)
    ]
    columns = _of_every_joint(table, known, robot, "move", endings)
    if not columns:
        return None
    scale: list[float] = []
    for column, slides in zip(columns, robot.prismatic, strict=True):
        meaning = known[table.header.index(column)]
        units = LENGTHS if slides else ANGLES
        if meaning is None or meaning.unit not in units:
            raise table.header_error(
                f"the unit is not stated; name the column {column}_{'mm' if slides else 'deg'}", column
            )
        scale.append(units[meaning.unit])
    return (
        np.stack([table.numbers(c, remedy="give the last move, or 0 where it is unknown") for c in columns], axis=1)
        * scale
    )


def _of_every_joint(
    table: Table, known: Sequence[Meaning | None], robot: Robot, kind: str, usual: Sequence[str]
) -> list[str]:
    """The column of each joint; none where no joint has one."""
    at: dict[int, str] = {}
    for k, meaning in enumerate(known):
        if meaning is not None and meaning.kind == kind:
            if meaning.index in at:
                twice = f"by '{at[meaning.index]}' and '{table.header[k]}'"
                raise table.header_error(f"joint {robot.joint_names[meaning.index]} is given twice, {twice}; keep one")
            at[meaning.index] = table.header[k]
    for j, column in enumerate(usual):
        if at and j not in at:
            raise table.header_error(
                f"has '{next(iter(at.values()))}' but no column '{column}'; give it, with 0 where it is unknown"
            )
    return [at[j] for j in sorted(at)]


def _refuse_nearly_known(table: Table, known: Sequence[Meaning | None], robot: Robot) -> None:
    """A column that begins or ends as one that is read, and is none, was meant to be read."""
    for name, meaning in zip(table.header, known, strict=True):
        if meaning is None and re.search(r"_(approach|move_\w+|u_mm|[xyz]_\w+|deg|rad)$", name, re.IGNORECASE):
            raise table.header_error(f"unknown column '{shown(name)}'; {KNOWN.format(joint=robot.joint_names[0])}")


class _Left(NamedTuple):
    """Columns that mean nothing to a campaign."""

    numbers: tuple[str, ...] = ()
    """In a line with what was measured, where numbers are among them: these may have been meant."""
    notes: tuple[str, ...] = ()
    """In a line, where they are texts."""
    lengths: tuple[str, ...] = ()
    """Those of lengths that might be what was measured."""


def _left_out(table: Table, known: Sequence[Meaning | None]) -> _Left:
    unused = _unused(known)
    left = [
        (name, split_unit(name)[1] or UNITS.get(under))
        for k, (name, under, meaning) in enumerate(zip(table.header, table.units, known, strict=True))
        if (meaning is None or meaning.kind == "nominal" or k in unused) and not re.fullmatch(r"column \d+|-", name)
    ]
    if not left:
        return _Left()
    ranges = {name: _range(table, name) for name, _ in left}
    taken = [name for name, m in zip(table.header, known, strict=True) if m and m.kind in ("position", "observed")]
    numbers = any(span is not None for span in ranges.values())
    beside = f"; measured: {shown(', '.join(taken))}" if taken and numbers else ""
    nominal = {table.header[k] for k, m in enumerate(known) if m is not None}
    lengths = [
        name
        for name, unit in left
        if unit in LENGTHS and name not in nominal and LENGTHS[unit] * (ranges[name] or 0.0) > LEAST_RANGE
    ]
    note = f"column{'s' if len(left) > 1 else ''} left out: {shown(', '.join(name for name, _ in left))}{beside}"
    return _Left((note,), (), tuple(lengths)) if numbers else _Left((), (note,))


def _unused(known: Sequence[Meaning | None]) -> set[int]:
    """Columns of known meaning that are not read: parts of an uncertainty, rotations beside others, times without a unit."""
    at: dict[str, dict[str, list[int]]] = {}
    for k, m in enumerate(known):
        if m is not None:
            at.setdefault(m.kind, {}).setdefault(m.target.casefold(), []).append(k)
    out: set[int] = set()
    for columns in at.get("uncertainty", {}).values():
        parts = {m.index for k in columns if (m := known[k])}
        out |= {k for k in columns if (m := known[k]) and m.index != 3 and (3 in parts or len(parts) < 3)}
    matrices = [k for columns in at.get("matrix", {}).values() for k in columns]
    turned = "quaternion" in at
    if turned or len(matrices) < 9:
        out |= set(matrices)
    if turned or len(matrices) >= 9:
        out |= {k for columns in at.get("euler", {}).values() for k in columns}
    for kind in ("time", "temperature"):
        times = [k for columns in at.get(kind, {}).values() for k in columns]
        read = [k for k in times if kind == "temperature" or ((m := known[k]) and m.unit in TIMES)]
        out |= set(times) - set(read[:1])
    return out


def _range(table: Table, column: str) -> float | None:
    """Range of a column's numbers; None where a cell is none."""
    try:
        return float(np.ptp(np.array([float(text) for text in table.texts(column) if text])))
    except ValueError:
        return None
