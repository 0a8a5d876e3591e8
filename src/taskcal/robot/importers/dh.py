"""Robots from Denavit–Hartenberg tables in CSV files."""

import ast
import itertools
import operator
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
from taskcal.tables.table import NUMBER, Table, number_of

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
    "joint": ("joint", "i", "axis", "link", "no", "no.", "#", "joint i", "link i", "kinematics", "frame"),
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

_DYNAMICS = re.compile(r"dynamics|mass\b.*|cent(?:er|re) of (?:mass|gravity)\b.*|co[mg]\b.*|inertia\b.*", re.IGNORECASE)
"""Columns beside the dimensions, as makers print them, which a table's robot has no use for."""

# Cells that are no plain numbers: sums, parts of π, a joint's angle by its letter.

_VARIABLE = re.compile(r"(?P<sign>^|[+-])(?:θ|ϑ|theta|q)_?\{?(?P<number>\d*)\}?\*?(?=$|[+-])", re.IGNORECASE)
"""A joint's angle by its letter, in a cell without blanks."""

_EXPRESSION = re.compile(r"(?:[\d.+\-*/()π]|pi|(?<=\d)e(?=[+-]?\d)){1,60}", re.IGNORECASE)
"""A sum, product or part of numbers and π."""

_PARTED = re.compile(r"[\d.]\s+[\d.]")
"""Two numbers with nothing but a blank between them."""

_PI = re.compile(r"π|pi", re.IGNORECASE)


def _plain(cell: str) -> str:
    """A cell without blanks, and with the minus sign of programs."""
    return re.sub(r"[−–‒]", "-", re.sub(r"\s", "", cell))


def _evaluated(cell: str) -> str:
    """The number that an expression is, as text; any other text as it is."""
    text = _plain(cell)
    if (
        NUMBER.fullmatch(cell)
        or _PARTED.search(cell)
        or not _EXPRESSION.fullmatch(text)
        or "**" in text
        or "//" in text
    ):
        return cell
    spelled = re.sub(r"(?<=[\d.)])(?=pi|\()", "*", _PI.sub("pi", text))
    try:
        return repr(_value(ast.parse(spelled, mode="eval").body))
    except (SyntaxError, ArithmeticError, KeyError, RecursionError):
        return cell


_OPERATIONS: dict[type, Callable[..., Any]] = {
    ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul, ast.Div: operator.truediv,
    ast.UAdd: operator.pos, ast.USub: operator.neg,
}  # fmt: skip


def _value(node: ast.expr) -> float:
    """The number that a parsed expression is.

    Raises:
        KeyError: it holds what is no number, π or sum, product or part of these.
        ArithmeticError: it has none.
    """
    match node:
        case ast.Constant(value=int() | float() as number):
            return float(number)
        case ast.Name(id="pi"):
            return np.pi
        case ast.BinOp(left=left, op=op, right=right):
            return _OPERATIONS[type(op)](_value(left), _value(right))
        case ast.UnaryOp(op=op, operand=operand):
            return _OPERATIONS[type(op)](_value(operand))
        case _:
            raise KeyError(type(node))


def _variable(cell: str) -> tuple[int | None, str] | None:
    """Number of a joint whose angle a cell writes by its letter, if it has one, and what is added; None of any other cell."""
    text = _plain(cell).replace("°", "")
    found = list(_VARIABLE.finditer(text))
    if len(found) != 1 or _PARTED.search(cell) or found[0]["sign"] == "-":
        return None
    rest = text[: found[0].start()] + text[found[0].end() :]
    return int(found[0]["number"]) if found[0]["number"] else None, rest or "0"


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
    written = table
    table, columns = _without_variables(table, columns)
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
        if unit != "rad" and column.stands_for in (*ANGLES, *LIMITS):
            _refuse_pi(written, column)
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


def _without_variables(table: Table, columns: Sequence[_Column]) -> tuple[Table, list[_Column]]:
    """Offsets alone in place of a joint's angle written as ``θ2 - π/2``, and numbers in place of sums and parts of π.

    Of a column of joints' angles beside one of their offsets only the latter is left.
    """

    def mended(cell: str, column: _Column) -> str:
        if column.stands_for not in (*LENGTHS, *ANGLES, *LIMITS):
            return cell
        by_letter = _variable(cell) if column.stands_for == "theta_offset_deg" else None
        return _evaluated(cell if by_letter is None else by_letter[1])

    rows = [tuple(map(mended, row, columns)) for row in table.rows]
    kept = list(range(len(columns)))
    angles = [k for k in kept if columns[k].stands_for == "theta_offset_deg"]
    if len(angles) == 2:
        by_letter = [k for k in angles if any(map(_variable, table.texts(columns[k].header)))]
        bare = [k for k in by_letter if not any(_is_not_zero(row[k]) for row in rows)]
        kept = [k for k in kept if k not in bare[:1]]
    table = replace(
        table, header=tuple(table.header[k] for k in kept), rows=tuple(tuple(row[k] for k in kept) for row in rows)
    )
    return table, [columns[k] for k in kept]


def _is_not_zero(cell: str) -> bool:
    return bool(cell) and number_of(cell) != 0.0


def _refuse_pi(table: Table, column: _Column) -> None:
    """See that angles in degrees have no π in them.

    Raises:
        FileError: one has.
    """
    for row, cell in enumerate(table.texts(column.header)):
        if _PI.search(_plain(cell)):
            raise table.error(
                f"'{shown(cell)}' is in radians, and its column is read in degrees; write all angles in one unit, and name it in "
                "the header",
                row,
                column.header,
            )


# Which rows are joints, and which are fixed parts behind them.

_FIXED = re.compile(
    r"(?:robot )?(?:flange|flansch|tool(?: ?0)?|tcp|ee|eef|end[ -]?effector|hand|gripper|fixed)(?: frame)?",
    re.IGNORECASE,
)
"""Names of rows that no joint has."""

_NUMBERED = re.compile(r"(?:(?:joint|axis|achse|gelenk|link|[jaqθ])[\s_-]*)?\d+", re.IGNORECASE)
_SPOKEN_NUMBER = re.compile(r"(?:joint|axis|achse|gelenk|link)[\s_-]*(\d+)", re.IGNORECASE)


def _are_joints(table: Table) -> list[bool]:
    """Whether each row of a table is of a joint; the others are fixed parts.

    Raises:
        FileError: a row is neither clearly, or joints' angles are not numbered in the order of the rows.
    """
    columns = [_column(header) for header in table.header]
    texts = {
        name: [table.texts(column.header) for column in columns if column.stands_for == name]
        for name in ("joint", "theta_offset_deg", "type")
    }
    count = len(table)
    names = texts["joint"][0] if texts["joint"] else [""] * count
    types = texts["type"][0] if texts["type"] else [""] * count
    angles = [next(filter(None, map(_variable, cells)), None) for cells in zip(*texts["theta_offset_deg"], strict=True)]
    angles = angles or [None] * count
    by_letter, numbered = any(angles), any(_NUMBERED.fullmatch(name) for name in names)
    out: list[bool] = []
    for row, (name, kind, angle) in enumerate(zip(names, types, angles, strict=True)):
        fixed = kind.casefold() == "fixed" or _FIXED.fullmatch(name) is not None
        is_joint = angle is not None or (not fixed and (bool(kind) or _NUMBERED.fullmatch(name) is not None))
        if not fixed and not is_joint:
            # of rows that are all named, or not at all
            fixed, is_joint = by_letter and numbered, not by_letter and not numbered
        without_angle = by_letter and angle is None and kind.casefold() != "prismatic"
        if fixed == is_joint or (is_joint and without_angle):
            angle_too = ", with θ and its number for its angle," if by_letter else ""
            message = (
                f"the row '{shown(name or str(row + 1), 40)}' is neither clearly a joint nor clearly a fixed part: call a joint by "
                f"its number{angle_too} and a fixed part Flange"
            )
            raise table.error(message, row)
        out.append(is_joint)
    if len({angle[0] - row for row, angle in enumerate(angles) if angle is not None and angle[0] is not None}) > 1:
        message = "the joints' angles are not numbered in the order of the rows; write a row for each joint, in order"
        raise table.error(message)
    if sum(out) > MAX_JOINTS:
        raise FileError(table.path, f"has {sum(out)} rows, one for each joint; a robot has up to {MAX_JOINTS}")
    if out != sorted(out, reverse=True):
        message = "is a fixed part before a joint, which a table has none of; write the robot file, with its steps"
        raise table.error(message, out.index(False))
    return out


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

    Cells may be sums and parts of π (``-π/2``), and a joint's angle its letter with what is added (``θ2 - π/2``). Rows behind the
    last joint that are called ``Flange`` or the like, or have a number where the joints' angles are letters, are fixed parts: the
    robot's flange and tool. Masses and their centres are left out.

    Optional columns: ``theta_from_controller``, a linear expression in joint names such as -(J2+J3); ``type``,
    revolute or prismatic; ``lower_deg`` and ``upper_deg``, limits.

    Args:
        path: the CSV.
        convention: ``dh`` for Rz(θ)·Tz(d)·Tx(a)·Rx(α), ``mdh`` for Rx(α)·Tx(a)·Rz(θ)·Tz(d); in any letter case.
        name: the robot's name; the file's by default.
        units: of columns that do not state theirs, such as ``m,rad``.

    Raises:
        FileError: a column is missing or unknown, or a cell is not what its column holds, or is in another unit, or a unit is
            neither stated nor told by size, or a row is neither clearly a joint nor clearly fixed.
        UnknownName: a convention that does not exist.
    """
    if convention.lower() not in get_args(Convention):
        raise UnknownName("convention", convention, get_args(Convention), "of Denavit–Hartenberg tables")
    rows = read_csv(path)
    are_joints = _are_joints(rows)
    before = next((name for name in rows.header if re.search(r"i ?- ?1", name)), None)
    if before is not None and convention.lower() == "dh":
        message = (
            f"'{shown(before, 40)}' is of the joint before, as modified tables have it; import it with --convention mdh"
        )
        raise FileError(rows.path, message, line=1)
    table, told = in_own_terms(_without_dynamics(rows, are_joints), units)
    if left := [name for name in rows.header if _DYNAMICS.fullmatch(name.strip())]:
        told = (*told, f"{shown(', '.join(left))} left out")
    columns = table
    joint_names = columns.texts("joint")
    numbers = {column: columns.numbers(column) for column in _NUMBERS}
    given = {column: columns.texts(column) for column in _OPTIONAL if column in columns}
    stated = {column: texts for column, texts in given.items() if column not in LIMITS}
    columns.refuse_unused(f"a table has the columns {', '.join(('joint', *_NUMBERS, *_OPTIONAL))}")
    if not len(columns):
        raise columns.error("has no joints; give a line for each")
    if ("lower_deg" in columns) != ("upper_deg" in columns):
        raise columns.header_error("gives one limit only; lower_deg and upper_deg go together")
    check_units(columns)
    limits = columns.side_by_side(LIMITS, empty=True) if "lower_deg" in columns else np.full((len(columns), 2), np.nan)
    joints: list[dict[str, Any]] = []
    _refuse_more_of_fixed(columns, stated, limits, sum(are_joints))
    for i, text in enumerate(joint_names[: sum(are_joints)]):
        spoken = _SPOKEN_NUMBER.fullmatch(text)
        text = spoken[1] if spoken else text
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
    _refuse_other_order(columns, [str(joint["name"]) for joint in joints])
    path = columns.path
    source = [f"imported from {printable(path.name)}", *told]
    described = {"name": name or printable(path.stem), "source": source, "joint": joints}
    of_rows = zip(*(numbers[column].tolist() for column in _NUMBERS), strict=True)
    fixed = [_steps(convention, *row) for row in list(of_rows)[len(joints) :]]
    if steps := [*itertools.chain(*fixed)]:
        described |= {"tool": steps, "flange": steps}
    try:
        robot_from(described)
    except TaskcalError as error:
        raise FileError(path, str(error)) from error
    return described


def _refuse_other_order(columns: Table, names: Sequence[str]) -> None:
    """See that joints that are numbered stand in the order of their numbers: the rows are the chain from base to flange.

    Raises:
        FileError: one has a smaller number than the one above.
    """
    parted = [re.fullmatch(r"(.*?)(\d+)", name) for name in names]
    numbered = [(one[1], int(one[2])) for one in parted if one is not None]
    if len(numbered) < len(names) or len({letters for letters, _ in numbered}) > 1:
        return
    for row, ((_, above), (_, number)) in enumerate(itertools.pairwise(numbered), start=1):
        if number < above:
            raise columns.error(
                f"'{shown(names[row], 40)}' stands below '{shown(names[row - 1], 40)}': the rows are the chain of joints from "
                "base to flange; put them in this order, or name the joints without numbers if they stand so in the chain",
                row,
                "joint",
            )


def _refuse_more_of_fixed(
    columns: Table, given: Mapping[str, Sequence[str]], limits: Float[np.ndarray, "rows 2"], first: int
) -> None:
    """See that fixed rows have nothing that only joints have.

    Raises:
        FileError: one has.
    """
    for row in range(first, len(columns)):
        if np.isfinite(limits[row]).any() or any(texts[row] for texts in given.values()):
            raise columns.error(
                "the row is a fixed part, which has no limits, type or angle; leave these cells empty", row
            )


def _without_dynamics(table: Table, are_joints: Sequence[bool]) -> Table:
    """The table without masses and the like; fixed parts without an angle have zero, and no type."""
    kept = [k for k, name in enumerate(table.header) if not _DYNAMICS.fullmatch(name.strip())]
    columns = [_column(table.header[k]) for k in kept]

    def cell(text: str, column: _Column, is_joint: bool) -> str:
        if is_joint:
            return text
        if column.stands_for == "type" and text.casefold() == "fixed":
            return ""
        return "0" if column.stands_for == "theta_offset_deg" and text in ("", "-", "–", "—") else text

    rows = tuple(
        tuple(cell(row[k], column, is_joint) for k, column in zip(kept, columns, strict=True))
        for row, is_joint in zip(table.rows, are_joints, strict=True)
    )
    return replace(table, header=tuple(table.header[k] for k in kept), rows=rows)


def _steps(convention: str, alpha_deg: float, a_mm: float, d_mm: float, theta_deg: float) -> list[dict[str, float]]:
    """The steps of a fixed row."""
    along_z = [{"rz_deg": theta_deg}, {"tz_mm": d_mm}]
    steps = [*along_z, {"tx_mm": a_mm}, {"rx_deg": alpha_deg}]
    if convention.lower() == "mdh":
        steps = [{"rx_deg": alpha_deg}, {"tx_mm": a_mm}, *along_z]
    return [step for step in steps if any(step.values())]


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
    suffixes=(".csv", ".tsv", ".txt"),
    options=("convention", "units"),
    describe=_described,
    whole=False,
)
