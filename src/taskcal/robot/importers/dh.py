"""Robots from Denavit–Hartenberg tables in CSV files."""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np
from jaxtyping import Bool, Float

from taskcal.arguments import checked, repeated
from taskcal.errors import FileError, TaskcalError, UnknownName, printable, shown
from taskcal.robot.importers.base import RobotImporter
from taskcal.robot.robot import Robot
from taskcal.robot.robot_file import MAX_JOINTS, robot_from
from taskcal.tables.forms import read_csv
from taskcal.tables.table import Table

# Whether the numbers of a Denavit–Hartenberg table are in the units of its columns, as far as they tell.

LENGTHS = ("a_mm", "d_mm")
ANGLES = ("alpha_deg", "theta_offset_deg")
LIMITS = ("lower_deg", "upper_deg")

MIN_TOTAL_LENGTH_MM = 20.0
"""Millimetres that all links are long together: Mecademic's Meca500, among the smallest on the market, has 460; a table in
metres has 0.5 to 10."""

MAX_LENGTH_MM = 1e5
"""Millimetres: 100 m, the travel of the longest gantries."""

NEARLY_PARALLEL_DEG = 0.3
"""Between axes that were built parallel, and calibrated: their common normal, and with it a and d, may be anywhere."""

TWO_PI = 2.0 * np.pi

USUAL_ANGLES_RAD = np.radians([30.0, 45.0, 60.0, 90.0, 120.0, 135.0, 150.0, 180.0, 270.0, 360.0])
"""Angles that robots are built with; in radians nobody means them by degrees."""

ROUNDING_RAD = 2e-3
"""Of an angle in radians written with two or three digits."""

MAX_SMALL_TWIST = 0.7
"""A design's smallest twist in radians (40°); in degrees, one between this and 2π is no design's and too much for a defect."""


def check_units(columns: Table) -> None:
    """Refuse lengths and angles that no industrial robot has.

    Lengths are in metres where all of them together make no robot. Angles are in radians where none exceeds a turn in
    radians, and one is a twist, or a usual offset, in radians. A table of zeros, parallel or small twists passes.

    Raises:
        FileError: with line, column, value, the unit that was probably meant and what would work.
    """
    _lengths(columns)
    _angles(columns, ANGLES)
    if LIMITS[0] in columns:
        _angles(columns, LIMITS)


def _lengths(columns: Table) -> None:
    values = columns.side_by_side(LENGTHS)
    row, k = _largest(values)
    longest = abs(values[row, k])
    twist = np.abs(columns.numbers("alpha_deg"))
    if longest > MAX_LENGTH_MM and not np.any((twist > 0.0) & (twist < NEARLY_PARALLEL_DEG)):
        raise columns.error(
            f"{values[row, k]:g} mm is longer than any link of a robot; it is probably in micrometres: give millimetres",
            row,
            LENGTHS[k],
        )
    total = float(np.abs(values).sum())
    if 0.0 < total < MIN_TOTAL_LENGTH_MM:
        raise columns.error(
            f"{values[row, k]:g} mm is the longest of all lengths, which add up to {total:.3g} mm: too small for a robot; they are "
            f"probably in metres: give millimetres, here {values[row, k] * 1e3:g}",
            row,
            LENGTHS[k],
        )


def _angles(columns: Table, names: Sequence[str]) -> None:
    values = np.nan_to_num(columns.side_by_side(names, empty=names == LIMITS))
    row, k = _largest(values)
    if names == ANGLES and abs(values[row, k]) > 360.0:
        raise columns.error(
            f"{values[row, k]:g}° is more than a turn; is it in milliradians? Give degrees from -360 to 360",
            row,
            names[k],
        )
    if abs(values[row, k]) > TWO_PI * (1.0 + ROUNDING_RAD):
        return
    size = np.abs(values)
    usual: Bool[np.ndarray, "rows columns"] = np.any(np.abs(size[..., None] - USUAL_ANGLES_RAD) < ROUNDING_RAD, axis=2)
    radians = size > 0.0 if names == LIMITS else usual
    if names == ANGLES:
        radians[:, 0] |= size[:, 0] > MAX_SMALL_TWIST
    if not radians.any():
        return
    row, k = (int(i[0]) for i in np.nonzero(radians))
    raise columns.error(
        f"{values[row, k]:g} is probably in radians, as no angle of {' and '.join(names)} exceeds 2π: give degrees, here "
        f"{np.degrees(values[row, k]):.6g}",
        row,
        names[k],
    )


def _largest(values: Float[np.ndarray, "rows columns"]) -> tuple[int, int]:
    row, k = np.unravel_index(int(np.abs(values).argmax()), values.shape)
    return int(row), int(k)


# Columns of Denavit–Hartenberg tables as people name them, with their units stated or told by size.

SYNONYMS = {
    "joint": ("joint", "i", "axis", "link", "no", "no.", "#", "joint i", "link i"),
    "alpha_deg": ("alpha", "α", "twist", "link twist"),
    "a_mm": ("a", "r", "link length"),
    "d_mm": ("d", "link offset"),
    "theta_offset_deg": (
        *("theta offset", "theta", "θ", "theta0", "offset", "joint offset", "q offset"),
        *("angle offset", "joint angle", "joint angle offset"),
    ),
    "lower_deg": ("lower", "min", "lower limit"),
    "upper_deg": ("upper", "max", "upper limit"),
}
"""What columns are called, by what a table of Taskcal calls them; the unit may follow."""

UNITS = {"mm": "mm", "m": "m", "deg": "deg", "°": "deg", "degrees": "deg", "rad": "rad", "radians": "rad"}

TO_FILE = {"mm": 1.0, "m": 1e3, "deg": 1.0, "rad": 180.0 / np.pi}
"""What numbers are multiplied by for millimetres or degrees."""

MAX_TOTAL_IN_METRES = 20.0
MIN_TOTAL_IN_MILLIMETRES = 100.0
"""What all lengths of a table add up to: between the two it may be a very large robot in metres or a toy in millimetres."""

_HEADER = re.compile(
    rf"(?P<name>.*?)(?:(?:[\s_]+|\s*[\[(])(?P<unit>{'|'.join(map(re.escape, UNITS))})[\])]?)?",
    re.IGNORECASE | re.DOTALL,
)


_SUBSCRIPT = re.compile(r"[\s_]+(?:i|\{i\}|\{?i ?- ?1\}?)$")
"""Behind the name of a parameter, as textbooks have it: that of the joint or of the one before."""

_VARIABLE = re.compile(r"\s*(?:θ|theta|q)[\s_]*\d*\*?\s*(?P<offset>[+\-−]\s*\d+(?:\.\d+)?)?\s*°?\s*", re.IGNORECASE)
"""A joint's angle by its letter, with what is added to it."""


@dataclass(frozen=True)
class _Column:
    """A column of a file."""

    header: str
    stands_for: str
    unit: str | None


def in_own_terms(table: Table, units: str | None = None) -> tuple[Table, tuple[str, ...]]:
    """A table with Taskcal's names of columns, in millimetres and degrees, and what was told by size of the units.

    Args:
        table: as the file has it.
        units: of columns that do not say theirs, such as ``mm,deg``; told by size by default.

    Raises:
        FileError: a unit is neither stated nor told by size, or two columns are the same.
        TaskcalError: `units` names none.
    """
    stated = _stated(units)
    columns = [_column(header) for header in table.header]
    table = _without_variables(table, columns)
    names = [column.stands_for for column in columns]
    if twice := repeated(names):
        both = " and ".join(f"'{shown(c.header, 40)}'" for c in columns if c.stands_for == twice[0])
        raise FileError(table.path, f"two columns are {twice[0]}: {both}; keep one", line=1)
    remarks: list[str] = []
    length, angle = stated.get("length"), stated.get("angle")
    bare = [column for column in columns if column.unit is None]
    lengths = [c for c in bare if c.stands_for in LENGTHS]
    angles = [c for c in bare if c.stands_for in (*ANGLES, *LIMITS)]
    if angles and angle is None:
        angle = _told(table, angles, _unit_of_angles, "deg or rad", remarks)
    if lengths and length is None:
        length = _told(
            table, lengths, lambda v: _unit_of_lengths(v, table, columns, angle or "deg"), "mm or m", remarks
        )
    cells = [list(row) for row in table.rows]
    for k, column in enumerate(columns):
        unit = column.unit or (length if column in lengths else angle if column in angles else None)
        if unit is not None and TO_FILE[unit] != 1.0:
            for row, value in enumerate(_numbers(table, column)):
                cells[row][k] = "" if np.isnan(value) else repr(float(value) * TO_FILE[unit])
    if "joint" not in names:
        names, cells = ["joint", *names], [[str(i), *row] for i, row in enumerate(cells, start=1)]
    return replace(table, header=tuple(names), rows=tuple(tuple(row) for row in cells)), tuple(remarks)


def _stated(units: str | None) -> dict[str, str]:
    out: dict[str, str] = {}
    for word in [] if units is None else units.replace(",", " ").split():
        unit = UNITS.get(word.lower())
        if unit is None:
            raise TaskcalError(f"'{shown(word, 40)}' is not a unit of a table; state such as mm,deg or m,rad")
        out["length" if unit in ("mm", "m") else "angle"] = unit
    return out


def _column(header: str) -> _Column:
    match = _HEADER.fullmatch(header.strip())
    assert match is not None, "any text is a name without a unit"
    name = re.sub(r"[\s_]+", " ", match["name"]).strip().lower()
    name = _SUBSCRIPT.sub("", name) or name
    unit = None if match["unit"] is None else UNITS[match["unit"].lower()]
    for own, others in SYNONYMS.items():
        if name in others and (unit is None or (unit in ("mm", "m")) == own.endswith("_mm")):
            return _Column(header, own, unit)
    return _Column(header, header, None)


def _without_variables(table: Table, columns: Sequence[_Column]) -> Table:
    """Offsets alone in place of a joint's angle written as ``θ2 - 90``."""

    def offset(cell: str) -> str:
        match = _VARIABLE.fullmatch(cell)
        return cell if match is None else re.sub(r"\s", "", match["offset"] or "0").replace("−", "-")

    at = {k for k, column in enumerate(columns) if column.stands_for == "theta_offset_deg"}
    rows = tuple(tuple(offset(cell) if k in at else cell for k, cell in enumerate(row)) for row in table.rows)
    return replace(table, rows=rows)


def _numbers(table: Table, column: _Column) -> Float[np.ndarray, " rows"]:
    """The numbers of a column; NaN for limits that are not stated."""
    return table.numbers(column.header, empty=column.stands_for in LIMITS)


def _told(
    table: Table,
    columns: Sequence[_Column],
    unit_of: Callable[[Float[np.ndarray, "rows k"]], str | None],
    choice: str,
    remarks: list[str],
) -> str:
    """The unit of columns by the size of their numbers."""
    values = np.nan_to_num(np.stack([_numbers(table, column) for column in columns], axis=1))
    named = ", ".join(column.header for column in columns)
    unit = unit_of(values)
    if unit is None:
        message = (
            f"the unit of {shown(named)} is not stated, and their numbers do not tell it; state it ({choice}) with --units, such "
            "as --units mm,deg"
        )
        raise FileError(table.path, message, line=1)
    if values.any():
        remarks.append(f"{shown(named)} taken for {unit}, by size")
    return unit


def _unit_of_lengths(
    values: Float[np.ndarray, "rows k"], table: Table, columns: Sequence[_Column], angle: str
) -> str | None:
    total = float(np.abs(values).sum())
    if total == 0.0:
        return "mm"
    twist = next((c for c in columns if c.stands_for == "alpha_deg"), None)
    if twist is not None:
        degrees = np.abs(table.numbers(twist.header)) * TO_FILE[twist.unit or angle]
        if np.any((degrees > 0.0) & (degrees < NEARLY_PARALLEL_DEG)):
            return None  # a calibrated table, whose common normals may be hundreds of metres away
    if total >= max(MIN_TOTAL_IN_MILLIMETRES, MIN_TOTAL_LENGTH_MM):
        return "mm"
    return "m" if total <= MAX_TOTAL_IN_METRES else None


def _unit_of_angles(values: Float[np.ndarray, "rows k"]) -> str | None:
    size = np.abs(values)
    if not size.any() or size.max() > TWO_PI * (1.0 + ROUNDING_RAD):
        return "deg"
    usual = np.abs(size[..., None] - USUAL_ANGLES_RAD).min(axis=-1) < ROUNDING_RAD
    return "rad" if usual.any() else None


Convention = Literal["dh", "mdh"]

_NUMBERS = ("alpha_deg", "a_mm", "d_mm", "theta_offset_deg")
_OPTIONAL = ("theta_from_controller", "type", "lower_deg", "upper_deg")


def describe_dh_table(
    path: str | Path, convention: str, name: str | None = None, units: str | None = None
) -> dict[str, Any]:
    """A robot file's content from a table: ``joint, alpha_deg, a_mm, d_mm, theta_offset_deg``.

    Columns may be called otherwise, such as ``alpha [rad]``, ``r`` or ``theta``. Where a unit is not stated, it is told by the
    size of the numbers, which the robot's ``source`` then says.

    Optional columns: ``theta_from_controller``, a linear expression in joint names such as -(J2+J3); ``type``,
    revolute or prismatic; ``lower_deg`` and ``upper_deg``, limits.

    Args:
        path: the CSV.
        convention: ``dh`` for Rz(θ)·Tz(d)·Tx(a)·Rx(α), ``mdh`` for Rx(α)·Tx(a)·Rz(θ)·Tz(d); in any letter case.
        name: the robot's name; the file's by default.
        units: of columns that do not state theirs, such as ``m,rad``.

    Raises:
        FileError: a column is missing or unknown, or a cell is not what its column holds, or is in another unit, or a unit is
            neither stated nor told by size.
        UnknownName: a convention that does not exist.
    """
    if convention.lower() not in get_args(Convention):
        raise UnknownName("convention", convention, get_args(Convention), "of Denavit–Hartenberg tables")
    rows = read_csv(path)
    if len(rows) > MAX_JOINTS:
        raise FileError(rows.path, f"has {len(rows)} rows, one for each joint; a robot has up to {MAX_JOINTS}")
    before = next((name for name in rows.header if re.search(r"i ?- ?1", name)), None)
    if before is not None and convention.lower() == "dh":
        message = (
            f"'{shown(before, 40)}' is of the joint before, as modified tables have it; import it with --convention mdh"
        )
        raise FileError(rows.path, message, line=1)
    table, told = in_own_terms(rows, units)
    columns = table
    joint_names = columns.texts("joint")
    numbers = {column: columns.numbers(column) for column in _NUMBERS}
    given = {column: columns.texts(column) for column in _OPTIONAL if column in columns}
    columns.refuse_unused(f"a table has the columns {', '.join(('joint', *_NUMBERS, *_OPTIONAL))}")
    if not len(columns):
        raise columns.error("has no joints; give a line for each")
    if ("lower_deg" in columns) != ("upper_deg" in columns):
        raise columns.header_error("gives one limit only; lower_deg and upper_deg go together")
    check_units(columns)
    limits = columns.side_by_side(LIMITS, empty=True) if "lower_deg" in columns else np.full((len(columns), 2), np.nan)
    joints: list[dict[str, Any]] = []
    for i, text in enumerate(joint_names):
        joint: dict[str, Any] = {"name": f"J{text}" if text.isdigit() else text}
        if "type" in given and given["type"][i]:
            joint["type"] = given["type"][i]
        joint[convention.lower()] = {key: float(numbers[key][i]) for key in ("alpha_deg", "a_mm", "d_mm")}
        if numbers["theta_offset_deg"][i]:
            joint["offset_deg"] = float(numbers["theta_offset_deg"][i])
        if "theta_from_controller" in given and given["theta_from_controller"][i]:
            joint["angle"] = given["theta_from_controller"][i]
        if np.isfinite(limits[i]).any():
            joint["limits_deg"] = _limits(columns, limits, i, slides=joint.get("type") == "prismatic")
        joints.append(joint)
    path = columns.path
    source = [f"imported from {printable(path.name)}", *told]
    described = {"name": name or printable(path.stem), "source": source, "joint": joints}
    try:
        robot_from(described)
    except TaskcalError as error:
        raise FileError(path, str(error)) from error
    return described


def _limits(columns: Table, limits: Float[np.ndarray, "rows 2"], row: int, *, slides: bool) -> list[float]:
    """Limits of a joint, degrees.

    Raises:
        FileError: one is stated only, or the joint slides.
    """
    stated = np.isfinite(limits[row])
    if slides:
        raise columns.error(
            "the joint slides and has no limits in degrees: leave them empty, and write limits_mm into the robot file",
            row,
            LIMITS[int(np.argmax(stated))],
        )
    if not stated.all():
        raise columns.error("the cell is empty; state both limits or neither", row, LIMITS[int(np.argmin(stated))])
    return limits[row].tolist()


@checked
def read_dh_table(path: str | Path, convention: str, name: str | None = None, units: str | None = None) -> Robot:
    """The robot of a Denavit–Hartenberg table; arguments and errors as `describe_dh_table`."""
    return robot_from(describe_dh_table(path, convention, name, units))


def _described(path: Path, options: Mapping[str, Any]) -> dict[str, Any]:
    if "convention" not in options:
        raise FileError(path, "is a table; state its convention, --convention dh or --convention mdh")
    return describe_dh_table(path, options["convention"], options.get("name"), options.get("units"))


DH_TABLE = RobotImporter(
    name="Denavit–Hartenberg table",
    suffixes=(".csv", ".txt"),
    options=("convention", "units"),
    describe=_described,
    whole=False,
)
