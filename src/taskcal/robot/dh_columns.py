"""Columns of Denavit–Hartenberg tables as people name them, with their units stated or told by size."""

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from taskcal.errors import FileError, TaskcalError, shown
from taskcal.repeated import repeated
from taskcal.robot.dh_units import NEARLY_PARALLEL_DEG, ROUNDING_RAD, SMALLEST_ROBOT_MM, TWO_PI, USUAL_ANGLES_RAD
from taskcal.tabular.table import Table

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

LARGEST_IN_METRES = 20.0
SMALLEST_IN_MILLIMETRES = 100.0
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
    lengths = [c for c in bare if c.stands_for.endswith("_mm")]
    angles = [c for c in bare if c.stands_for.endswith("_deg")]
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
            for row, value in enumerate(table.numbers(column.header)):
                cells[row][k] = repr(float(value) * TO_FILE[unit])
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


def _told(
    table: Table,
    columns: Sequence[_Column],
    unit_of: Callable[[Float[np.ndarray, "rows k"]], str | None],
    choice: str,
    remarks: list[str],
) -> str:
    """The unit of columns by the size of their numbers."""
    values = np.stack([table.numbers(column.header) for column in columns], axis=1)
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
    if total >= max(SMALLEST_IN_MILLIMETRES, SMALLEST_ROBOT_MM):
        return "mm"
    return "m" if total <= LARGEST_IN_METRES else None


def _unit_of_angles(values: Float[np.ndarray, "rows k"]) -> str | None:
    size = np.abs(values)
    if not size.any() or size.max() > TWO_PI * (1.0 + ROUNDING_RAD):
        return "deg"
    usual = np.abs(size[..., None] - USUAL_ANGLES_RAD).min(axis=-1) < ROUNDING_RAD
    return "rad" if usual.any() else None
