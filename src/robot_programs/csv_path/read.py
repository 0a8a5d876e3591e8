"""Paths in CSV: their columns, motions and numbers, read and rewritten."""

import csv
import io
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float

from robot_programs.core import se3
from robot_programs.core.errors import Faults, FileError, InputError, shown
from robot_programs.core.program import (
    Composition,
    Diagnostic,
    Frame,
    Motion,
    MotionKind,
    Paths,
    Program,
    Target,
    Waypoint,
    with_axis,
)
from robot_programs.core.robot import Robot
from robot_programs.core.source import Place, Source, TextEdit, numeral, renumbered

# The cells of a table in CSV, as text and where they stand, so that single ones can be rewritten.

MAX_COLUMNS = 20_000
"""A spreadsheet holds 16 384."""

MAX_NUMBER = 1e6
"""Of any number: 1 km in millimetres, or 2800 turns in degrees."""

_SEPARATOR_LINE = re.compile(r"\Asep=.[ \t]*(?=\r?\n)", re.IGNORECASE)
"""What a spreadsheet writes first to say how it separates."""

_LINE = re.compile(r"[^\r\n]+")

_NUMBER = re.compile(r"[+-]?(\d+(?:\.\d*)?|\.\d+)(e[+-]?\d+)?", re.ASCII | re.IGNORECASE)
"""Python also reads 1_000 and the digits of other scripts, which nobody writes."""

_NOT_FINITE = re.compile(r"[+-]?(nan|inf(inity)?)", re.IGNORECASE)


@dataclass(frozen=True, kw_only=True)
class Row:
    """A row of a table in its text."""

    line: int
    """In which it ends, counted from 1."""
    start: int
    """First character of its line."""
    end: int
    """Behind the last character of its line, before the line end."""
    next: int
    """First character of the line that follows."""
    cells: tuple[tuple[int, int], ...]
    """First character of each cell, and behind its last one, without quotes and blanks around it."""
    texts: tuple[str, ...]
    """Of the cells."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Table:
    """Rows below one that names the columns."""

    source: Source
    header: tuple[str, ...]
    header_line: int
    delimiter: str
    rows: tuple[Row, ...]

    def __len__(self) -> int:
        return len(self.rows)

    @property
    def names(self) -> dict[str, str]:
        """Columns as the file writes them, by their small letters."""
        return {name.lower(): name for name in self.header}

    def error(self, message: str, row: int, column: str | None = None) -> FileError:
        """An error that points at a cell or a line."""
        return FileError(self.source.path, message, line=self.rows[row].line, column=column)

    def refusal(self, message: str, column: str | None = None) -> FileError:
        """An error that points at the header."""
        return FileError(self.source.path, message, line=self.header_line, column=column)

    def numbers(self, columns: Sequence[str]) -> Float[np.ndarray, "rows columns"]:
        """The numbers of columns; NaN for empty cells.

        Raises:
            FileError: a cell is not a finite number, or one beyond ±`MAX_NUMBER`.
        """
        out = np.full((len(self), len(columns)), np.nan)
        for k, column in enumerate(columns):
            at, faults = self.header.index(column), Faults()
            for number, row in enumerate(self.rows):
                if row.texts[at]:
                    with faults.collecting():
                        out[number, k] = self._number(row.texts[at], number, column)
            faults.raise_any()
        return out

    def _number(self, text: str, row: int, column: str) -> float:
        number = float(text) if _NUMBER.fullmatch(text) else math.nan
        if abs(number) <= MAX_NUMBER:
            return number
        if not math.isnan(number):
            message = f"'{shown(text)}' is beyond ±{MAX_NUMBER:g}; check the cell and its unit"
        elif _NOT_FINITE.fullmatch(text):
            message = f"'{shown(text)}' is not a finite number; give a number"
        else:
            message = f"'{shown(text)}' is not a number; give a number such as 12.5"
        raise self.error(message, row, column)

    def together(self, columns: Sequence[str]) -> tuple[str, ...]:
        """Columns that only make sense together, as the file writes them; none where it has none of them.

        Raises:
            FileError: it has some of them only, or they lack their unit.
        """
        names = self.names
        given = tuple(names[name] for name in columns if name in names)
        lacking = [name for name in columns if name not in names]
        if given and lacking:
            raise self.refusal(f"has '{given[0]}' but no column '{lacking[0]}'")
        for name in lacking:
            bare = name.removesuffix("_mm")
            if bare != name and bare in names:
                raise self.refusal(f"the unit is not stated; name the column {names[bare]}_mm", names[bare])
        return given


def parse_table(source: Source) -> Table:
    """The table that a file's text holds, taken as it is written.

    Raises:
        FileError: there is nothing in it, two columns have one name, or there are too many; a line has more or fewer fields than
            the header.
    """
    text = source.text.removeprefix("\ufeff")
    delimiter = _delimiter_of(text)
    rows = [row for row in _scan(source, delimiter) if _counts(row)]
    if not rows:
        raise FileError(source.path, "is empty; its first line must name the columns")
    first, *rows = rows
    # every line may end with a separator
    width = len(first.texts) if first.texts[-1] else max(_filled(row) for row in (first, *rows))
    names = first.texts[:width]
    table = Table(
        source=source,
        header=tuple(name or f"column {k}" for k, name in enumerate(names, start=1)),
        header_line=first.line,
        delimiter=delimiter,
        rows=tuple(rows),
    )
    _check_names(table)
    faults = Faults()
    for number, row in enumerate(rows):
        if len(row.texts) < width or _filled(row) > width:
            hint = "; is it written with decimal commas?" if delimiter == "," and len(row.texts) > width else ""
            with faults.collecting():
                raise table.error(f"the line has {len(row.texts)} fields, the header {width}{hint}", number)
    faults.raise_any()
    return table


def _check_names(table: Table) -> None:
    lowered = [name.lower() for name in table.header]
    for names, but in ((table.header, "; column names must differ"), (lowered, " but for letter case; keep one")):
        if twice := {name for name in names if names.count(name) > 1} if len(set(names)) < len(names) else None:
            raise table.refusal(f"two columns are named '{shown(min(twice))}'{but}")


def _check_quotes(table: Table) -> None:
    """See that quotes stand around whole cells only, so that a cell's text is what it means.

    Raises:
        FileError: one does not, or does not end.
    """
    source = table.source
    for row in table.rows:
        text = source.text[row.start : row.end]
        if '"' not in text:
            continue
        try:
            meant = next(csv.reader(io.StringIO(text, newline=""), delimiter=table.delimiter))
        except csv.Error:
            meant = []
        if [cell.strip() for cell in meant] != list(row.texts):
            raise FileError(source.path, "has quotes inside cells; write numbers and names without them")
        if text.count('"') % 2:
            message = "has a quote that does not end; write the cell without it"
            raise FileError(source.path, message, line=source.line(row.start))


def _delimiter_of(text: str) -> str:
    # one after another: of a large file all lines take far more memory than its text
    lines = (line[0] for line in _LINE.finditer(_SEPARATOR_LINE.sub("", text, count=1)))
    header = next((line for line in lines if line.strip() and not line.startswith("#")), "")
    return max(",;\t", key=header.count)


def _counts(row: Row) -> bool:
    """Whether a row belongs to the table: it is neither blank, nor a comment, nor the line that names the separator."""
    named = row.start <= 1 and row.texts[0].lower().startswith("sep=")
    return any(row.texts) and not row.texts[0].startswith("#") and not named


def _filled(row: Row) -> int:
    """Number of cells of a row up to its last filled one."""
    return next((k for k in range(len(row.texts), 0, -1) if row.texts[k - 1]), 0)


def _scan(source: Source, delimiter: str) -> Iterator[Row]:
    text = source.text
    form = re.compile(rf'"(?P<quoted>[^"]*)(?:"[^{delimiter}\r\n]*)?|(?P<plain>[^{delimiter}\r\n]*)')
    position = 1 if text.startswith("\ufeff") else 0
    while position < len(text):
        start, cells = position, list[tuple[int, int]]()
        while True:
            cell, position = _cell(text, position, form)
            cells.append(cell)
            if len(cells) > MAX_COLUMNS:
                message = f"has more than {MAX_COLUMNS} columns; is it a table?"
                raise FileError(source.path, message, line=source.line(start))
            if position < len(text) and text[position] == delimiter:
                position += 1
            else:
                break
        end = position
        position += 2 if text.startswith("\r\n", position) else 1
        if text[end:position] == "\r" and position < len(text):
            message = "has a carriage return alone; end lines with line feeds"
            raise FileError(source.path, message, line=source.line(end))
        yield Row(
            line=source.line(min(end, len(text) - 1)),
            start=start,
            end=end,
            next=min(position, len(text)),
            cells=tuple(cells),
            texts=tuple(text[a:b] for a, b in cells),
        )


def _cell(text: str, position: int, form: re.Pattern[str]) -> tuple[tuple[int, int], int]:
    """A cell from its first character on, without quotes and blanks around it, and the position behind it."""
    found = form.match(text, position)
    assert found is not None
    assert found.lastgroup is not None
    content = found[found.lastgroup]
    start = found.start(found.lastgroup) + len(content) - len(content.lstrip())
    return (start, start + len(content.strip())), found.end()


# What the columns of a path in CSV mean.

POSITION = ("x_mm", "y_mm", "z_mm")
QUATERNION = ("qx", "qy", "qz", "qw")
AXIS = ("i", "j", "k")
WORDS = ("id", "name", "move", "speed_mm_s", "stop", "tool", "frame")

JOINT_UNITS = {"deg": np.pi / 180, "rad": 1.0, "mm": 1e-3, "m": 1.0}
"""What a joint's number is multiplied by for radians or metres."""

UNIT_TOLERANCE = 1e-3
"""How far the length of a quaternion or a direction may be from one: files round to a few digits."""

_NUMBERED = re.compile(r"[jq](\d+)_(deg|rad|mm|m)$")


@dataclass(frozen=True, kw_only=True)
class Columns:
    """Which columns a path has; names as the file writes them."""

    position: tuple[str, ...]
    """x, y, z; empty where the path has joint positions only."""
    rotation: tuple[str, ...]
    """Four of a quaternion, or three of the tool's axis."""
    joints: tuple[str, ...]
    """In the robot's order; empty where there are none."""
    joint_scale: tuple[float, ...]
    """What a joint's number is multiplied by for radians or metres."""
    words: Mapping[str, str]
    """The others: names in the file by their meaning."""

    @property
    def only_axis(self) -> bool:
        """The rotation about the tool's axis is left open."""
        return len(self.rotation) == 3

    @property
    def pose(self) -> tuple[str, ...]:
        """Columns of a pose."""
        return self.position + self.rotation


def columns_of(table: Table, robot: Robot | None) -> Columns:
    """The columns of a path.

    Raises:
        FileError: one is not known, is lacking, or its unit is not stated; two mean the same.
    """
    joints = _numbered_joints(table) if robot is None else _joints_of(table, robot)
    position, quaternion, axis = (table.together(names) for names in (POSITION, QUATERNION, AXIS))
    words = {word: column for word in WORDS for column in table.together([word])}
    used = {*joints, *position, *quaternion, *axis, *words.values()}
    unknown = [name for name in table.header if name not in used]
    if unknown:
        named = shown(", ".join(map(repr, unknown)))
        raise table.refusal(
            f"unknown column{'s' if len(unknown) > 1 else ''} {named}; a path has {' '.join(POSITION)} with {' '.join(QUATERNION)} "
            f"or the tool axis {' '.join(AXIS)}, or joints such as J1_deg, and optionally {', '.join(WORDS)}"
        )
    if quaternion and axis:
        raise table.refusal("has both a quaternion and a tool axis; keep one of them")
    if position and not (quaternion or axis):
        raise table.refusal("has positions without the tool's orientation; add qx qy qz qw, or the tool axis i j k")
    if (quaternion or axis) and not position:
        raise table.refusal("has orientations without positions; add x_mm y_mm z_mm")
    if not position and not joints:
        raise table.refusal("has neither positions x_mm y_mm z_mm nor joints such as J1_deg")
    return Columns(
        position=position,
        rotation=quaternion or axis,
        joints=joints,
        joint_scale=tuple(JOINT_UNITS[joint.lower().rpartition("_")[2]] for joint in joints),
        words=words,
    )


def _column(joint: str, number: int) -> str:
    """A joint's name in columns: by its number where it is called as a part of the position."""
    return f"q{number}" if f"{joint.lower()}_mm" in POSITION else joint


def _joints_of(table: Table, robot: Robot) -> tuple[str, ...]:
    """A column for each of the robot's joints; none where the table has none of them.

    Raises:
        FileError: only some joints have a column, or one has two.
    """
    names, columns, lacking = table.names, list[str](), list[str]()
    for number, (joint, slides) in enumerate(zip(robot.joint_names, robot.prismatic, strict=True), start=1):
        units = ("mm", "m") if slides else ("deg", "rad")
        spellings = dict.fromkeys(spelling.lower() for spelling in (_column(joint, number), f"J{number}", f"q{number}"))
        candidates = [f"{spelling}_{unit}" for spelling in spellings for unit in units]
        found = [names[column] for column in candidates if column in names]
        if len(found) > 1:
            raise table.refusal(f"joint {joint} is given twice, by '{found[0]}' and '{found[1]}'; keep one")
        columns += found
        lacking += [] if found else [f"{_column(joint, number)}_{units[0]}"]
    if columns and lacking:
        raise table.refusal(f"has '{columns[0]}' but no column '{lacking[0]}' of {robot.name}")
    return tuple(columns)


def _numbered_joints(table: Table) -> tuple[str, ...]:
    """The joints' columns in the order of their numbers, where no robot is known."""
    numbered = {int(match[1]): name for lower, name in table.names.items() if (match := _NUMBERED.match(lower))}
    lacking = [i for i in range(1, max(numbered, default=0) + 1) if i not in numbered]
    if lacking:
        raise table.refusal(f"has no column for joint {lacking[0]}, such as J{lacking[0]}_deg")
    return tuple(numbered[i] for i in sorted(numbered))


# What the rows of a path mean.

_MOVES: dict[str, MotionKind] = {"joint": "joint", "linear": "linear", "circular": "circular", "via": "circular"}


@dataclass(frozen=True, eq=False, kw_only=True)
class PathTable(Table):
    """A table with what was read from it, a row each."""

    columns: Columns
    T: Float[np.ndarray, "rows 4 4"]
    """Poses of the tool in the part's frame, metres; NaN where a row has none."""
    q: Float[np.ndarray, "rows joints"]
    """Radians or metres; NaN where a row has none."""
    speed: Float[np.ndarray, " rows"]
    """Metres per second; NaN where a row has none."""

    def place(self, row: int) -> Place:
        """Place of a row."""
        return Place(path=self.source.path, line=self.rows[row].line)

    def cell(self, row: int, column: str) -> tuple[int, int]:
        """First character of a cell, and behind its last one."""
        return self.rows[row].cells[self.header.index(column)]

    def word(self, row: int, meaning: str) -> str:
        """A cell that holds a word; empty where the column is lacking."""
        name = self.columns.words.get(meaning)
        return "" if name is None else self.rows[row].texts[self.header.index(name)]

    def kind(self, row: int) -> MotionKind:
        """The motion of which a row holds the end, or the point on the way."""
        word = self.word(row, "move").lower()
        if np.isnan(self.T[row]).any():
            if word not in ("", "axes", "joint"):
                raise self.error(f"'{word}' needs a pose; joint positions are approached by axes", row, "move")
            return "axes"
        if word and word not in _MOVES:
            raise self.error(f"'{word}' is not a motion to a pose; write {', '.join(_MOVES)}", row, "move")
        return _MOVES.get(word, "linear")

    def is_via(self, row: int) -> bool:
        """Whether a row holds the point on the way of an arc."""
        return self.kind(row) == "circular" and self.word(row, "move").lower() == "via"


def read_path_table(source: Source, robot: Robot | None) -> PathTable:
    """Read the rows of a path.

    Raises:
        FileError: it cannot be read as a path.
    """
    table = parse_table(source)
    columns = columns_of(table, robot)
    pose, joints = table.numbers(columns.pose), table.numbers(columns.joints)
    for row in range(len(table)):
        _check_complete(table, columns, row, np.isnan(pose[row]), np.isnan(joints[row]))
    T = np.full((len(table), 4, 4), np.nan)
    posed = np.asarray(~np.isnan(pose).any(axis=1))
    if columns.pose and posed.any():
        rotation = pose[:, 3:]
        _check_lengths(table, columns, rotation, posed)
        R = with_axis(rotation[posed]) if columns.only_axis else se3.from_quaternion(rotation[posed])
        T[posed] = se3.pose(R, pose[posed, :3] * 1e-3)
    _check_quotes(table)
    return PathTable(
        **vars(table),
        columns=columns,
        T=T,
        q=joints * np.array(columns.joint_scale),
        speed=_speeds(table, columns),
    )


def _check_complete(table: Table, columns: Columns, row: int, pose: np.ndarray, joints: np.ndarray) -> None:
    """See that a row has a pose or joint positions, and all of it."""
    given = [name for name, blank in ((columns.pose, pose), (columns.joints, joints)) if name and not blank.all()]
    if not given:
        raise table.error("the row has no target; give a pose or joint positions, or leave out the row", row)
    if len(given) > 1:
        raise table.error("the row has a pose and joint positions; leave one of them empty", row)
    blank = pose if given[0] == columns.pose else joints
    if blank.any():
        raise table.error(
            "the cell is empty while its others are not; give a number", row, given[0][int(blank.argmax())]
        )


def _check_lengths(
    table: Table, columns: Columns, vectors: Float[np.ndarray, "rows k"], needed: Bool[np.ndarray, " rows"]
) -> None:
    """See that quaternions, or axes of the tool, have length one.

    Raises:
        FileError: one has not.
    """
    what, hint = ("tool axis", "") if columns.only_axis else ("quaternion", " (is qw last?)")
    lengths = np.linalg.norm(vectors, axis=1)
    for row in np.flatnonzero(needed & (np.abs(lengths - 1.0) > UNIT_TOLERANCE)):
        raise table.error(
            f"the {what} has length {lengths[row]:.4f}; it must be 1{hint}", int(row), columns.rotation[0]
        )


def _speeds(table: Table, columns: Columns) -> Float[np.ndarray, " rows"]:
    name = columns.words.get("speed_mm_s")
    if name is None:
        return np.full(len(table), np.nan)
    values = table.numbers([name])[:, 0]
    for row in np.flatnonzero(values <= 0):
        message = f"{values[row]:g} is not a speed; give one above zero, or leave the cell empty"
        raise table.error(message, int(row), name)
    return values * 1e-3


# Rewriting motions of a path in CSV: their cells, and rows where one motion becomes several.


MM, DEGREES, UNITS = 6, 9, 10
"""Decimals written of lengths, of angles, and of quaternions and directions."""


@dataclass(frozen=True, kw_only=True)
class Written:
    """The rows of a motion."""

    row: int
    """Of its end."""
    via: int | None
    """Of the via point, of an arc."""


def rewrite(path_table: PathTable, written: Written, path: Sequence[Waypoint]) -> list[TextEdit]:
    """Edits that give one motion its waypoints: a row for each, and one more for the via point of an arc."""
    first = written.row if written.via is None else written.via
    ahead = "".join(
        _copied(path_table, row, edits)
        for waypoint in path[:-1]
        for row, edits in _rows_for(path_table, written, waypoint)
    )
    start = path_table.rows[first].start
    out = [TextEdit(start=start, end=start, text=ahead)] if ahead else []
    if written.via is not None and path[-1].via is None:
        out.append(TextEdit(start=start, end=path_table.rows[first].next, text=""))
    return out + [edit for _, edits in _rows_for(path_table, written, path[-1]) for edit in edits]


def _copied(path_table: PathTable, row: int, edits: Sequence[TextEdit]) -> str:
    source, place = path_table.source, path_table.rows[row]
    return source.piece(place.start, place.end, edits) + source.newline


def _rows_for(path_table: PathTable, written: Written, waypoint: Waypoint) -> list[tuple[int, list[TextEdit]]]:
    if waypoint.via is None:
        return [(written.row, _edits(path_table, written.row, waypoint, waypoint.kind))]
    if written.via is None:
        raise _lacking(path_table, written.row, "an arc needs a row for the via point")
    return [
        (written.via, _edits(path_table, written.via, waypoint.via, "via")),
        (written.row, _edits(path_table, written.row, waypoint, "circular")),
    ]


def _edits(path_table: PathTable, row: int, waypoint: Waypoint, word: str) -> list[TextEdit]:
    columns = path_table.columns
    values: dict[str, tuple[float, float, int]] = {}
    if word == "axes":
        if np.isnan(path_table.q[row]).any() or not columns.joints:
            raise _lacking(path_table, row, "the row holds a pose, not joint positions")
        for j, (name, scale) in enumerate(zip(columns.joints, columns.joint_scale, strict=True)):
            decimals = MM if name.lower().endswith("_mm") else DEGREES
            values[name] = path_table.q[row, j] / scale, waypoint.q[j] / scale, decimals
    else:
        if waypoint.T is None or np.isnan(path_table.T[row]).any():
            raise _lacking(path_table, row, "the row holds joint positions, not a pose")
        was, now = path_table.T[row], waypoint.T
        values |= {name: (was[a, 3] * 1e3, now[a, 3] * 1e3, MM) for a, name in enumerate(columns.position)}
        before, after = (_axis(was), _axis(now)) if columns.only_axis else _alike(path_table, row, now)
        values |= {name: (before[a], after[a], UNITS) for a, name in enumerate(columns.rotation)}
    out = [_edit(path_table, row, name, was, now, decimals) for name, (was, now, decimals) in values.items()]
    if word == _word(path_table, row):
        return out
    if "move" not in columns.words:
        raise _lacking(path_table, row, f"without a column 'move' a motion cannot become '{word}'")
    start, end = path_table.cell(row, columns.words["move"])
    return [*out, TextEdit(start=start, end=end, text=word)]


def _word(path_table: PathTable, row: int) -> str:
    """Content of a row's column 'move', or its meaning where it is empty."""
    return path_table.word(row, "move").lower() if path_table.kind(row) == "circular" else path_table.kind(row)


def _axis(T: np.ndarray) -> np.ndarray:
    return -T[:3, 2]


def _alike(path_table: PathTable, row: int, T: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The quaternion in the file, of unit length, and that of a pose with its sign."""
    cells = [path_table.rows[row].texts[path_table.header.index(name)] for name in path_table.columns.rotation]
    was = np.array([float(cell) for cell in cells])
    now = se3.to_quaternion(T[:3, :3])
    return was / np.linalg.norm(was), now if now @ was >= 0 else -now


def _edit(path_table: PathTable, row: int, column: str, was: float, now: float, decimals: int) -> TextEdit:
    start, end = path_table.cell(row, column)
    return TextEdit(start=start, end=end, text=renumbered(path_table.source.text[start:end], was, now, decimals))


def _lacking(path_table: PathTable, row: int, message: str) -> InputError:
    return InputError(f"{path_table.place(row)}: {message}; write the program in another language")


# A new path in CSV of given motions.


def compose_csv_path(program: Composition) -> Source:
    """A path of its own, ``name.csv``, a row for each motion and for the via point of each arc.

    Raises:
        InputError: there are several tools or frames, which the file does not say.
    """
    robot, motions = program.robot, program.motions
    for k, move in enumerate(motions):
        if (
            not (_alike_moves(move.tool.T, motions[0].tool.T) and _alike_moves(move.part.T, motions[0].part.T))
            or move.part_in_hand
        ):
            raise InputError(f"motion {k} has another tool or frame than the first; a path in CSV has one of each")
    posed = any(move.end.T is not None for move in motions)
    jointed = not posed or any(move.end.q is not None for move in motions)
    units = ["mm" if slides else "deg" for slides in robot.prismatic]
    names = [_column(joint, number) for number, joint in enumerate(robot.joint_names, start=1)]
    joints = [f"{name}_{unit}" for name, unit in zip(names, units, strict=True)] if jointed else []
    pose = [*POSITION, *QUATERNION] if posed else []
    rows: list[list[str]] = []
    for k, move in enumerate(motions):
        targets = [(move.end, move.kind)] if move.via is None else [(move.via, "via"), (move.end, move.kind)]
        for target, word in targets:
            note = target.name or (program.notes[k] if program.notes else "")
            speed = "" if move.speed is None else numeral(move.speed * 1e3, MM)
            cells = _pose(target, len(pose)) + _joints(target, robot, len(joints))
            rows.append([note, word, *cells, speed, "yes" if move.stops else "no"])
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows([["name", "move", *pose, *joints, "speed_mm_s", "stop"], *rows])
    return Source(path=Path(f"{program.name}.csv"), text=text.getvalue(), encoding="utf-8")


def _alike_moves(a: np.ndarray, b: np.ndarray) -> bool:
    return np.allclose(a, b, rtol=0.0, atol=1e-9)


def _pose(target: Target, columns: int) -> list[str]:
    if target.T is None or not columns:
        return [""] * columns
    position = [numeral(float(v), MM) for v in target.T[:3, 3] * 1e3]
    return position + [numeral(float(v), UNITS) for v in se3.to_quaternion(target.T[:3, :3])]


def _joints(target: Target, robot: Robot, columns: int) -> list[str]:
    if target.q is None or not columns:
        return [""] * columns
    shown = np.where(robot.prismatic, target.q * 1e3, np.degrees(target.q))
    decimals = np.where(robot.prismatic, MM, DEGREES)
    return [numeral(float(v), int(d)) for v, d in zip(shown, decimals, strict=True)]


# What the rows of a path table mean: motions, with their tools and frames.

_YES, _NO = ("1", "yes", "true"), ("", "0", "no", "false")


def unknown_frame(path_table: PathTable, row: int, tool: Frame, part: Frame) -> str:
    """Why a row's tool or frame is not known; empty where both are."""
    for meaning, frame in (("tool", tool), ("frame", part)):
        name = path_table.word(row, meaning)
        if name and name != frame.name:
            return f"{meaning} '{name}' is not known; only '{frame.name}' was given, so the motion stays as it is"
    return ""


def resolve_move(
    path_table: PathTable, row: int, via: int | None, tool: Frame, part: Frame, before: int | None
) -> Motion:
    """The motion of which a row holds the end.

    Raises:
        FileError: an arc has no via point, or another motion has one; or whether it stops is not said by yes or no.
    """
    kind = path_table.kind(row)
    if (kind == "circular") != (via is not None):
        message = "a row 'via' with the via point must stand before the end of an arc, and 'circular' at its end"
        raise path_table.error(message, row, "move")
    return Motion(
        kind=kind,
        end=_target(path_table, row),
        via=None if via is None else _target(path_table, via),
        tool=tool,
        part=part,
        speed=None if np.isnan(path_table.speed[row]) else float(path_table.speed[row]),
        stops=_stops(path_table, row),
        follows=before,
        routine=path_table.source.path.stem,
        place=path_table.place(row),
    )


def _target(path_table: PathTable, row: int) -> Target:
    posed = not np.isnan(path_table.T[row]).any()
    return Target(
        name=path_table.word(row, "name") or path_table.word(row, "id"),
        T=path_table.T[row] if posed else None,
        q=None if posed else path_table.q[row],
        posture=None,
        place=path_table.place(row),
        free_spin=posed and path_table.columns.only_axis,
    )


def _stops(path_table: PathTable, row: int) -> bool:
    word = path_table.word(row, "stop").lower()
    if word not in _YES + _NO:
        raise path_table.error(f"'{word}' is neither yes nor no", row, path_table.columns.words["stop"])
    return word in _YES


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class CsvProgram(Program):
    """Paths read from CSV."""

    path_tables: tuple[PathTable, ...]
    written: tuple[tuple[int, Written], ...]
    """Where each motion stands: number of its table, and rows."""

    def rewrite(self, robot: Robot, waypoints: Paths) -> tuple[Source, ...]:
        """The files with some motions rewritten; see `Program.rewrite`.

        Raises:
            InputError: a motion is to become something for which the file has no columns.
        """
        edits: list[list[TextEdit]] = [[] for _ in self.path_tables]
        for number, path in waypoints.items():
            s, written = self.written[number]
            edits[s] += rewrite(self.path_tables[s], written, path)
        return tuple(path_table.source.edited(e) for path_table, e in zip(self.path_tables, edits, strict=True))

    def speed_edit(self, number: int, speed: float) -> tuple[int, TextEdit]:
        """The cell of the column ``speed_mm_s``; see `Program.speed_edit`."""
        s, written = self.written[number]
        was = self.motions[number].speed or 0.0
        column = self.path_tables[s].columns.words["speed_mm_s"]
        return s, _edit(self.path_tables[s], written.row, column, was * 1e3, speed * 1e3, MM)


def read_csv_path(
    sources: Sequence[Source], *, robot: Robot | None = None, tool: Frame | None = None, part: Frame | None = None
) -> CsvProgram:
    """Read paths: ``x_mm y_mm z_mm`` with ``qx qy qz qw`` or the tool axis ``i j k``, or joint positions.

    Args:
        sources: the files, each a path of its own.
        robot: whose joints the columns name; without it they are numbered, ``J1_deg`` on.
        tool: what the positions are of; the robot's own tool by default.
        part: frame in which they are counted; the robot's base by default.

    Raises:
        FileError: with file, line, column, value and a remedy, for anything that cannot be read as a path.
    """
    part = part or Frame(name="", T=np.eye(4))
    path_tables = tuple(read_path_table(source, robot) for source in sources)
    motions: list[Motion] = []
    written: list[tuple[int, Written]] = []
    diagnostics: list[Diagnostic] = []
    for s, path_table in enumerate(path_tables):
        if path_table.columns.position and tool is None and robot is None:
            raise FileError(
                path_table.source.path, "does not say what its positions are of; give the tool, or the robot"
            )
        own = tool or Frame(name="", T=np.eye(4) if robot is None else robot.T_flange_tool)
        before: int | None = None
        via: int | None = None
        for row in range(len(path_table.rows)):
            if path_table.is_via(row):
                if via is not None or row + 1 == len(path_table.rows):
                    raise path_table.error("a via point must be followed by the end of its arc", row)
                via = row
                continue
            unknown = unknown_frame(path_table, row, own, part)
            if unknown:
                diagnostics.append(Diagnostic(place=path_table.place(row), text=unknown))
                before = None
            else:
                motions.append(resolve_move(path_table, row, via, own, part, before))
                written.append((s, Written(row=row, via=via)))
                before = len(motions) - 1
            via = None
    return CsvProgram(
        sources=tuple(sources),
        motions=tuple(motions),
        diagnostics=tuple(diagnostics),
        path_tables=path_tables,
        written=tuple(written),
        read=partial(read_csv_path, robot=robot, tool=tool, part=part),
    )
