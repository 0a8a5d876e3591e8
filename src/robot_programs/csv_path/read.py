"""Paths in CSV: their columns, motions and numbers, read and rewritten."""

import csv
import io
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Literal

import numpy as np
from jaxtyping import Float

from robot_programs.core.program import (
    NUMBER,
    UNIT_TOLERANCE,
    Composition,
    Diagnostic,
    Frame,
    Motion,
    MotionKind,
    Paths,
    Program,
    Target,
    Waypoint,
    tool_of_points,
    with_axis,
)
from robot_programs.core.robot import NO_ROBOT, Robot
from robot_programs.core.source import Place, Source, TextEdit, numeral, renumbered
from taskcal_groundwork import se3
from taskcal_groundwork.errors import Faults, FileError, InputError, shown

# The cells of a table in CSV, as text and where they stand, so that single ones can be rewritten.

MAX_COLUMNS = 20_000
"""A spreadsheet holds 16 384."""

MAX_NUMBER = 1e6
"""Of any number: 1 km in millimetres, or 2800 turns in degrees."""

_SEPARATOR_LINE = re.compile(r"\Asep=.[ \t]*(?=\r?\n)", re.IGNORECASE)
"""What a spreadsheet writes first to say how it separates."""

_NUMBER = re.compile(NUMBER, re.ASCII)
"""Python also reads 1_000 and the digits of other scripts, which nobody writes."""


@dataclass(frozen=True, kw_only=True, slots=True)
class CsvRow:
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

    @property
    def filled(self) -> int:
        """Number of cells up to the last filled one."""
        return next((k for k in range(len(self.texts), 0, -1) if self.texts[k - 1]), 0)


@dataclass(frozen=True, eq=False, kw_only=True)
class CsvTable:
    """Rows below one that names the columns."""

    source: Source
    header: tuple[str, ...]
    header_line: int
    delimiter: str
    rows: tuple[CsvRow, ...]

    @property
    def names(self) -> dict[str, str]:
        """Columns as the file writes them, by their small letters."""
        return {name.lower(): name for name in self.header}

    def error(self, message: str, row: int | None = None, column: str | None = None) -> FileError:
        """An error that points at a cell or a line; without a row at the header."""
        line = self.header_line if row is None else self.rows[row].line
        return FileError(self.source.path, message, line=line, column=column)

    def numbers(self, columns: Sequence[str]) -> Float[np.ndarray, "rows columns"]:
        """The numbers of columns; NaN for empty cells.

        Raises:
            FileError: a cell is not a finite number, or one beyond ±`MAX_NUMBER`.
        """
        out = np.full((len(self.rows), len(columns)), np.nan)
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
            message = f"is beyond ±{MAX_NUMBER:g}; check the cell and its unit"
        elif re.fullmatch(r"[+-]?(nan|inf(inity)?)", text, re.IGNORECASE):
            message = "is not a finite number; give a number"
        else:
            message = "is not a number; give a number such as 12.5"
        raise self.error(f"'{shown(text)}' {message}", row, column)

    def together(self, columns: Sequence[str]) -> tuple[str, ...]:
        """Columns that only make sense together, as the file writes them; none where it has none of them.

        Raises:
            FileError: it has some of them only, or they lack their unit.
        """
        names = self.names
        given = tuple(names[name] for name in columns if name in names)
        lacking = [name for name in columns if name not in names]
        if given and lacking:
            raise self.error(f"has '{given[0]}' but no column '{lacking[0]}'")
        for name in lacking:
            bare = name.removesuffix("_mm")
            if bare != name and bare in names:
                message = f"the unit is not stated; name the column {names[bare]}_mm"
                raise self.error(message, column=names[bare])
        return given


def parse_table(source: Source) -> CsvTable:
    """The table that a file's text holds, taken as it is written.

    Raises:
        FileError: there is nothing in it, two columns have one name, or there are too many; a line has more or fewer fields than
            the header.
    """
    delimiter = _delimiter_of(source.text.removeprefix("\ufeff"))
    rows = tuple(row for row in _scan(source, delimiter) if _counts(row))
    if not rows:
        raise FileError(source.path, "is empty; its first line must name the columns")
    first = rows[0]
    # every line may end with a separator
    width = len(first.texts) if first.texts[-1] else max(row.filled for row in rows)
    header = tuple(name or f"column {k}" for k, name in enumerate(first.texts[:width], start=1))
    table = CsvTable(source=source, header=header, header_line=first.line, delimiter=delimiter, rows=rows[1:])
    for names, but in ((header, "; names must differ"), ([*map(str.lower, header)], " but for letter case; keep one")):
        if twice := {name for name in names if names.count(name) > 1} if len(set(names)) < len(names) else None:
            raise table.error(f"two columns are named '{shown(min(twice))}'{but}")
    faults = Faults()
    for number, row in enumerate(table.rows):
        if len(row.texts) < width or row.filled > width:
            commas = delimiter == "," and len(row.texts) > width
            hint = "is it written with decimal commas?" if commas else "write one for each column"
            with faults.collecting():
                raise table.error(f"the line has {len(row.texts)} fields, the header {width}; {hint}", number)
    faults.raise_any()
    return table


def _check_quotes(table: CsvTable) -> None:
    """See that quotes stand around whole cells only, so that a cell's text is what it means.

    Raises:
        FileError: one does not, or does not end.
    """
    path, whole = table.source.path, table.source.text
    for row in table.rows if '"' in whole else ():
        text = whole[row.start : row.end]
        if '"' not in text:
            continue
        try:
            meant = next(csv.reader(io.StringIO(text, newline=""), delimiter=table.delimiter))
        except csv.Error:
            meant = []
        if [cell.strip() for cell in meant] != list(row.texts):
            raise FileError(path, "has quotes inside cells; write numbers and names without them")
        if text.count('"') % 2:
            message = "has a quote that does not end; write the cell without it"
            raise FileError(path, message, line=table.source.line(row.start))


def _delimiter_of(text: str) -> str:
    # one after another: of a large file all lines take far more memory than its text
    lines = (line[0] for line in re.finditer(r"[^\r\n]+", _SEPARATOR_LINE.sub("", text, count=1)))
    header = next((line for line in lines if line.strip() and not line.startswith("#")), "")
    return max(",;\t", key=header.count)


def _counts(row: CsvRow) -> bool:
    """Whether a row belongs to the table: it is neither blank, nor a comment, nor the line that names the separator."""
    named = row.start <= 1 and row.texts[0].lower().startswith("sep=")
    return any(row.texts) and not row.texts[0].startswith("#") and not named


def _scan(source: Source, delimiter: str) -> Iterator[CsvRow]:
    """The rows of a text."""
    text, cells = source.text, list[tuple[int, int]]()
    start = 1 if text.startswith("\ufeff") else 0
    other = rf"[^{delimiter}\r\n]*+"
    form = re.compile(rf'(?:"([^"]*+)(?:"{other})?|({other}))({delimiter}|\r\n|[\r\n]|\Z)')
    for match in form.finditer(text, start):
        if start == len(text):
            return
        group = 2 if match[1] is None else 1
        content, end = match[group], match.start(3)
        first = match.start(group) + len(content) - len(content.lstrip())
        cells.append((first, first + len(content.strip())))
        if len(cells) > MAX_COLUMNS:
            message = f"has more than {MAX_COLUMNS} columns; is it a table?"
            raise FileError(source.path, message, line=source.line(start))
        if match[3] == delimiter:
            continue
        if match[3] == "\r" and match.end() < len(text):
            message = "has a carriage return alone; end lines with line feeds"
            raise FileError(source.path, message, line=source.line(end))
        texts = tuple(text[a:b] for a, b in cells)
        line = source.line(min(end, len(text) - 1))
        yield CsvRow(line=line, start=start, end=end, next=match.end(), cells=tuple(cells), texts=texts)
        start, cells = match.end(), []


# What the columns of a path in CSV mean.

POSITION = ("x_mm", "y_mm", "z_mm")
QUATERNION = ("qx", "qy", "qz", "qw")
AXIS = ("i", "j", "k")
WORDS = ("id", "name", "move", "speed_mm_s", "stop", "tool", "frame")

JOINT_UNITS = {"deg": np.pi / 180, "rad": 1.0, "mm": 1e-3, "m": 1.0}
"""What a joint's number is multiplied by for radians or metres."""

_NUMBERED = re.compile(r"[jq](\d+)_(deg|rad|mm|m)$")

MM, DEGREES, UNITS = 6, 9, 10
"""Decimals written of lengths, of angles, and of quaternions and directions."""


@dataclass(frozen=True, kw_only=True)
class CsvColumns:
    """Which columns a path has; names as the file writes them."""

    position: tuple[str, ...]
    """x, y, z; empty where the path has joint positions only."""
    rotation: tuple[str, ...]
    """Four of a quaternion, or three of the tool's axis."""
    joints: tuple[str, ...]
    """In the robot's order; empty where there are none."""
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


def _unit(joint: str) -> str:
    return joint.lower().rpartition("_")[2]


def columns_of(table: CsvTable, robot: Robot | None) -> CsvColumns:
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
        raise table.error(
            f"unknown column{'s' if len(unknown) > 1 else ''} {named}; a path has {' '.join(POSITION)} with {' '.join(QUATERNION)} "
            f"or the tool axis {' '.join(AXIS)}, or joints such as J1_deg, and optionally {', '.join(WORDS)}"
        )
    if quaternion and axis:
        raise table.error("has both a quaternion and a tool axis; keep one of them")
    if position and not (quaternion or axis):
        raise table.error("has positions without the tool's orientation; add qx qy qz qw, or the tool axis i j k")
    if (quaternion or axis) and not position:
        raise table.error("has orientations without positions; add x_mm y_mm z_mm")
    if not position and not joints:
        raise table.error("has neither positions x_mm y_mm z_mm nor joints such as J1_deg")
    return CsvColumns(position=position, rotation=quaternion or axis, joints=joints, words=words)


def _column(joint: str, number: int) -> str:
    """A joint's name in columns: by its number where it is called as a part of the position."""
    return f"q{number}" if f"{joint.lower()}_mm" in POSITION else joint


def _joints_of(table: CsvTable, robot: Robot) -> tuple[str, ...]:
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
            raise table.error(f"joint {joint} is given twice, by '{found[0]}' and '{found[1]}'; keep one")
        columns += found
        lacking += [] if found else [f"{_column(joint, number)}_{units[0]}"]
    if columns and lacking:
        raise table.error(f"has '{columns[0]}' but no column '{lacking[0]}' of {robot.name}")
    return tuple(columns)


def _numbered_joints(table: CsvTable) -> tuple[str, ...]:
    """The joints' columns in the order of their numbers, where no robot is known."""
    numbered = {int(match[1]): name for lower, name in table.names.items() if (match := _NUMBERED.match(lower))}
    lacking = [i for i in range(1, max(numbered, default=0) + 1) if i not in numbered]
    if lacking:
        raise table.error(f"has no column for joint {lacking[0]}, such as J{lacking[0]}_deg")
    return tuple(numbered[i] for i in sorted(numbered))


def _of_pose(T: np.ndarray, *, only_axis: bool = False, like: np.ndarray | None = None) -> list[tuple[float, int]]:
    """The numbers of a pose, with the decimals that are written of each; a quaternion has the sign of another one."""
    rotation = -T[:3, 2] if only_axis else se3.to_quaternion(T[:3, :3])
    if like is not None and not only_axis and rotation @ like < 0.0:
        rotation = -rotation
    return [(float(v), MM) for v in T[:3, 3] * 1e3] + [(float(v), UNITS) for v in rotation]


def _of_joints(q: np.ndarray, columns: Sequence[str]) -> list[tuple[float, int]]:
    """The numbers of joint positions, with their decimals."""
    units = map(_unit, columns)
    return [(float(v) / JOINT_UNITS[u], MM if u == "mm" else DEGREES) for v, u in zip(q, units, strict=True)]


# What the rows of a path mean: motions, with their tools and frames.

_MOVES = ("joint", "linear", "circular", "via")
_YES, _NO = ("1", "yes", "true"), ("", "0", "no", "false")


@dataclass(frozen=True, kw_only=True)
class MotionRows:
    """The rows of a motion."""

    row: int
    """Of its end."""
    via: int | None
    """Of the via point, of an arc."""


@dataclass(frozen=True, eq=False, kw_only=True)
class PathTable(CsvTable):
    """A table with what was read from it, a row each."""

    columns: CsvColumns
    T: Float[np.ndarray, "rows 4 4"]
    """Poses of the tool in the part's frame, metres; NaN where a row has none."""
    q: Float[np.ndarray, "rows joints"]
    """Radians or metres; NaN where a row has none."""
    speed: Float[np.ndarray, " rows"]
    """Metres per second; NaN where a row has none."""

    def place(self, row: int) -> Place:
        """Place of a row."""
        return Place(path=self.source.path, line=self.rows[row].line)

    def word(self, row: int, meaning: str) -> str:
        """A cell that holds a word; empty where the column is lacking."""
        name = self.columns.words.get(meaning)
        return "" if name is None else self.rows[row].texts[self.header.index(name)]

    def is_posed(self, row: int) -> bool:
        """Whether a row holds a pose."""
        return not math.isnan(self.T[row, 0, 0])

    def move(self, row: int) -> MotionKind | Literal["via"]:
        """The motion of which a row holds the end; ``via`` where it holds the point on the way of an arc."""
        word = self.word(row, "move").lower()
        if not self.is_posed(row):
            if word not in ("", "axes", "joint"):
                raise self.error(f"'{word}' needs a pose; joint positions are approached by axes", row, "move")
            return "axes"
        if word and word not in _MOVES:
            raise self.error(f"'{word}' is not a motion to a pose; write {', '.join(_MOVES)}", row, "move")
        return word or "linear"

    def unknown_frame(self, row: int, tool: Frame, part: Frame) -> str:
        """Why a row's tool or frame is not known; empty where both are."""
        for meaning, frame in (("tool", tool), ("frame", part)):
            name = self.word(row, meaning)
            if name and name != frame.name:
                return f"{meaning} '{name}' is not known; only '{frame.name}' was given, so the motion stays as it is"
        return ""

    def motion(self, written: MotionRows, tool: Frame, part: Frame, before: int | None) -> Motion:
        """The motion of some rows.

        Raises:
            FileError: an arc has no via point, or another motion has one; or whether it stops is not said by yes or no.
        """
        row, via = written.row, written.via
        kind, stop = self.move(row), self.word(row, "stop").lower()
        if kind == "via" or (kind == "circular") != (via is not None):
            message = "a row 'via' with the via point must stand before the end of an arc, and 'circular' at its end"
            raise self.error(message, row, "move")
        if stop not in _YES + _NO:
            raise self.error(f"'{stop}' is neither yes nor no", row, self.columns.words["stop"])
        return Motion(
            kind=kind,
            end=self._target(row),
            via=None if via is None else self._target(via),
            tool=tool,
            part=part,
            speed=None if math.isnan(self.speed[row]) else float(self.speed[row]),
            stops=stop in _YES,
            follows=before,
            routine=self.source.path.stem,
            place=self.place(row),
        )

    def _target(self, row: int) -> Target:
        posed = self.is_posed(row)
        return Target(
            name=self.word(row, "name") or self.word(row, "id"),
            T=self.T[row] if posed else None,
            q=None if posed else self.q[row],
            posture=None,
            place=self.place(row),
            free_spin=posed and self.columns.only_axis,
        )

    # Rewriting: cells, and rows where one motion becomes several.

    def edits(self, written: MotionRows, path: Sequence[Waypoint]) -> list[TextEdit]:
        """Edits that give one motion its waypoints: a row for each, and one more for the via point of an arc."""
        first = self.rows[written.row if written.via is None else written.via]
        ahead = "".join(
            self.source.piece(self.rows[row].start, self.rows[row].end, edits) + self.source.newline
            for waypoint in path[:-1]
            for row, edits in self._rows_for(written, waypoint)
        )
        out = [TextEdit(start=first.start, end=first.start, text=ahead)] if ahead else []
        if written.via is not None and path[-1].via is None:
            out.append(TextEdit(start=first.start, end=first.next, text=""))
        return out + [edit for _, edits in self._rows_for(written, path[-1]) for edit in edits]

    def _rows_for(self, written: MotionRows, waypoint: Waypoint) -> list[tuple[int, list[TextEdit]]]:
        """The rows that hold a waypoint, each with the edits that put it there."""
        end = written.row, self._row_edits(written.row, waypoint, "circular" if waypoint.via else waypoint.kind)
        if waypoint.via is None:
            return [end]
        if written.via is None:
            raise self._lacking(written.row, "an arc needs a row for the via point")
        return [(written.via, self._row_edits(written.via, waypoint.via, "via")), end]

    def _row_edits(self, row: int, waypoint: Waypoint, word: str) -> list[TextEdit]:
        columns = self.columns
        if word == "axes":
            if not columns.joints or self.is_posed(row):
                raise self._lacking(row, "the row holds a pose, not joint positions")
            names = columns.joints
            was, now = _of_joints(self.q[row], names), _of_joints(waypoint.q, names)
        else:
            if waypoint.T is None or not self.is_posed(row):
                raise self._lacking(row, "the row holds joint positions, not a pose")
            names = columns.pose
            like = np.array([float(self.rows[row].texts[self.header.index(name)]) for name in columns.rotation])
            was, now = (_of_pose(T, only_axis=columns.only_axis, like=like) for T in (self.T[row], waypoint.T))
        out = [self.edit(row, name, a, b, n) for name, (a, n), (b, _) in zip(names, was, now, strict=True)]
        if word == self.move(row):
            return out
        if "move" not in columns.words:
            raise self._lacking(row, f"without a column 'move' a motion cannot become '{word}'")
        start, end = self.rows[row].cells[self.header.index(columns.words["move"])]
        return [*out, TextEdit(start=start, end=end, text=word)]

    def edit(self, row: int, column: str, was: float, now: float, decimals: int) -> TextEdit:
        """A cell with another number."""
        start, end = self.rows[row].cells[self.header.index(column)]
        return TextEdit(start=start, end=end, text=renumbered(self.source.text[start:end], was, now, decimals))

    def _lacking(self, row: int, message: str) -> InputError:
        return InputError(f"{self.place(row)}: {message}; write the program in another language")


def read_path_table(source: Source, robot: Robot | None) -> PathTable:
    """Read the rows of a path.

    Raises:
        FileError: it cannot be read as a path.
    """
    table = parse_table(source)
    columns = columns_of(table, robot)
    pose, joints = table.numbers(columns.pose), table.numbers(columns.joints)
    filled = [(names, ~np.isnan(values)) for names, values in ((columns.pose, pose), (columns.joints, joints)) if names]
    for row in range(len(table.rows)):
        given = [(names, cells[row]) for names, cells in filled if cells[row].any()]
        if not given:
            raise table.error("the row has no target; give a pose or joint positions, or leave out the row", row)
        (names, cells), *others = given
        if others:
            raise table.error("the row has a pose and joint positions; leave one of them empty", row)
        if not cells.all():
            message = "the cell is empty while its others are not; give a number"
            raise table.error(message, row, names[int(cells.argmin())])
    T, posed = np.full((len(table.rows), 4, 4), np.nan), ~np.isnan(pose).any(axis=1)
    if columns.pose and posed.any():
        rotation = pose[:, 3:]
        what, hint = ("tool axis", "") if columns.only_axis else ("quaternion", " (is qw last?)")
        lengths = np.linalg.norm(rotation, axis=1)
        for row in np.flatnonzero(posed & (np.abs(lengths - 1.0) > UNIT_TOLERANCE)):
            message = f"the {what} has length {lengths[row]:.4f}; it must be 1{hint}"
            raise table.error(message, int(row), columns.rotation[0])
        R = with_axis(rotation[posed]) if columns.only_axis else se3.from_quaternion(rotation[posed])
        T[posed] = se3.pose(R, pose[posed, :3] * 1e-3)
    _check_quotes(table)
    scale = np.array([JOINT_UNITS[_unit(joint)] for joint in columns.joints])
    name, speed = columns.words.get("speed_mm_s"), np.full(len(table.rows), np.nan)
    if name is not None:
        speed = table.numbers([name])[:, 0]
        for row in np.flatnonzero(speed <= 0):
            message = f"{speed[row]:g} is not a speed; give one above zero, or leave the cell empty"
            raise table.error(message, int(row), name)
    return PathTable(**vars(table), columns=columns, T=T, q=joints * scale, speed=speed * 1e-3)


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class CsvProgram(Program):
    """Paths read from CSV."""

    path_tables: tuple[PathTable, ...]
    written: tuple[tuple[int, MotionRows], ...]
    """Where each motion stands: number of its table, and rows."""

    def rewrite(self, robot: Robot, waypoints: Paths) -> tuple[Source, ...]:
        """The files with some motions rewritten; see `Program.rewrite`.

        Raises:
            InputError: a motion is to become something for which the file has no columns.
        """
        edits: list[list[TextEdit]] = [[] for _ in self.path_tables]
        for number, path in waypoints.items():
            s, written = self.written[number]
            edits[s] += self.path_tables[s].edits(written, path)
        return tuple(path_table.source.edited(e) for path_table, e in zip(self.path_tables, edits, strict=True))

    def speed_edit(self, number: int, speed: float) -> tuple[int, TextEdit]:
        """The cell of the column ``speed_mm_s``; see `Program.speed_edit`."""
        s, written = self.written[number]
        was, table = self.motions[number].speed or 0.0, self.path_tables[s]
        return s, table.edit(written.row, table.columns.words["speed_mm_s"], was * 1e3, speed * 1e3, MM)


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
    motions, written, diagnostics = list[Motion](), list[tuple[int, MotionRows]](), list[Diagnostic]()
    for s, table in enumerate(path_tables):
        own = tool_of_points(table.source.path, robot if table.columns.position else robot or NO_ROBOT, tool)
        before, via = None, None
        for row in range(len(table.rows)):
            if table.move(row) == "via":
                if via is not None or row + 1 == len(table.rows):
                    raise table.error("a via point must be followed by the end of its arc", row)
                via = row
                continue
            if unknown := table.unknown_frame(row, own, part):
                diagnostics.append(Diagnostic(place=table.place(row), text=unknown, unread=True))
                before = None
            else:
                written.append((s, MotionRows(row=row, via=via)))
                motions.append(table.motion(written[-1][1], own, part, before))
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


# A new path in CSV of given motions.


def compose_csv_path(program: Composition) -> Source:
    """A path of its own, ``name.csv``, a row for each motion and for the via point of each arc.

    Raises:
        InputError: there are several tools or frames, which the file does not say.
    """
    robot, motions = program.robot, program.motions
    for k, move in enumerate(motions):
        pairs = (move.tool.T, motions[0].tool.T), (move.part.T, motions[0].part.T)
        if move.part_in_hand or not all(np.allclose(a, b, rtol=0.0, atol=1e-9) for a, b in pairs):
            raise InputError(f"motion {k} has another tool or frame than the first; a path in CSV has one of each")
    posed = any(move.end.T is not None for move in motions)
    jointed = not posed or any(move.end.q is not None for move in motions)
    names = [_column(joint, number) for number, joint in enumerate(robot.joint_names, start=1)]
    units = ["mm" if slides else "deg" for slides in robot.prismatic]
    joints = [f"{name}_{unit}" for name, unit in zip(names, units, strict=True)] if jointed else []
    pose = [*POSITION, *QUATERNION] if posed else []
    rows = [["name", "move", *pose, *joints, "speed_mm_s", "stop"]]
    for k, move in enumerate(motions):
        speed = "" if move.speed is None else numeral(move.speed * 1e3, MM)
        for target, word in ([] if move.via is None else [(move.via, "via")]) + [(move.end, move.kind)]:
            T, q = target.T if posed else None, target.q if jointed else None
            stated = [None] * len(pose) if T is None else _of_pose(T)
            stated = [*stated, *([None] * len(joints) if q is None else _of_joints(q, joints))]
            cells = ["" if one is None else numeral(*one) for one in stated]
            note = target.name or (program.notes[k] if program.notes else "")
            rows.append([note, word, *cells, speed, "yes" if move.stops else "no"])
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(rows)
    return Source(path=Path(f"{program.name}.csv"), text=text.getvalue(), encoding="utf-8")
