"""A path in CSV: its table, what its rows mean, and where they stand in the text."""

import re
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from robot_programs.core.program import MoveKind, with_axis
from robot_programs.core.source import Place, Source
from taskcal.errors import FileError
from taskcal.geometry import se3
from taskcal.robot.robot import Robot
from taskcal.tables.column_groups import POSITION, QUATERNION, ColumnGroups, joint_scale
from taskcal.tables.forms import parse_csv
from taskcal.tables.table import Table
from taskcal.tables.text import delimiter_of

# What the columns of a path in CSV mean.

AXIS = ("i", "j", "k")
WORDS = ("id", "name", "move", "speed_mm_s", "stop", "tool", "frame")

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
        """Those of a pose."""
        return self.position + self.rotation


def columns_of(groups: ColumnGroups, robot: Robot | None) -> Columns:
    """The columns of a path.

    Raises:
        FileError: one is not known, is lacking, or its unit is not stated; two mean the same.
    """
    joints = _numbered_joints(groups) if robot is None else groups.joint_columns(robot)
    position, quaternion, axis = (groups.together(names) for names in (POSITION, QUATERNION, AXIS))
    words = {word: column for word in WORDS for column in groups.together([word])}
    groups.refuse_unused(
        f"a path has {' '.join(POSITION)} with {' '.join(QUATERNION)} or the tool axis {' '.join(AXIS)}, or joints such as J1_deg, "
        f"and optionally {', '.join(WORDS)}"
    )
    if quaternion and axis:
        raise groups.refusal("has both a quaternion and a tool axis; keep one of them")
    if position and not (quaternion or axis):
        raise groups.refusal("has positions without the tool's orientation; add qx qy qz qw, or the tool axis i j k")
    if (quaternion or axis) and not position:
        raise groups.refusal("has orientations without positions; add x_mm y_mm z_mm")
    if not position and not joints:
        raise groups.refusal("has neither positions x_mm y_mm z_mm nor joints such as J1_deg")
    return Columns(
        position=position,
        rotation=quaternion or axis,
        joints=joints,
        joint_scale=tuple(joint_scale(joints).tolist()),
        words=words,
    )


def _numbered_joints(groups: ColumnGroups) -> tuple[str, ...]:
    """The joints' columns in the order of their numbers, where no robot is known."""
    numbered = {int(match[1]): name for lower, name in groups.names.items() if (match := _NUMBERED.match(lower))}
    lacking = [i for i in range(1, max(numbered, default=0) + 1) if i not in numbered]
    if lacking:
        raise groups.refusal(f"has no column for joint {lacking[0]}, such as J{lacking[0]}_deg")
    return groups.together([numbered[i] for i in sorted(numbered)])


# Where the cells of a CSV table stand in its text, so that single ones can be rewritten.


@dataclass(frozen=True, kw_only=True)
class Row:
    """A row of a table in its text."""

    start: int
    """First character of its line."""
    end: int
    """Behind the last character of its line, before the line end."""
    next: int
    """First character of the line that follows."""
    cells: tuple[tuple[int, int], ...]
    """First character of each cell, and behind its last one, without quotes and blanks around it."""


def locate_rows(source: Source, table: Table) -> tuple[Row, ...]:
    """The rows of a table in its source, without the header.

    Raises:
        FileError: quotes stand inside a cell, so that its text is not what it means, or one does not end.
    """
    text = source.text
    rows = [row for row in _scan(text, delimiter_of(text.removeprefix("\ufeff"))) if _counts(text, row)][1:]
    if [_texts(text, row) for row in rows] != [list(cells) for cells in table.rows]:
        raise FileError(source.path, "has quotes inside cells; write numbers and names without them")
    for row in rows:
        if text.count('"', row.start, row.end) % 2:
            raise FileError(
                source.path, "has a quote that does not end; write the cell without it", line=source.line(row.start)
            )
    return tuple(rows)


def _texts(text: str, row: Row) -> list[str]:
    return [text[start:end] for start, end in row.cells]


def _counts(text: str, row: Row) -> bool:
    """Whether a row belongs to the table: it is neither blank, nor a comment, nor the line that names the separator."""
    texts = _texts(text, row)
    return any(texts) and not texts[0].startswith("#") and not (row.start <= 1 and texts[0].lower().startswith("sep="))


def _scan(text: str, delimiter: str) -> list[Row]:
    rows: list[Row] = []
    position = 1 if text.startswith("\ufeff") else 0
    while position < len(text):
        start, cells = position, list[tuple[int, int]]()
        while True:
            cell, position = _cell(text, position, delimiter)
            cells.append(cell)
            if position < len(text) and text[position] == delimiter:
                position += 1
            else:
                break
        end = position
        position += 2 if text.startswith("\r\n", position) else 1
        rows.append(Row(start=start, end=end, next=min(position, len(text)), cells=tuple(cells)))
    return rows


def _cell(text: str, position: int, delimiter: str) -> tuple[tuple[int, int], int]:
    """A cell from its first character on, and the position behind it."""
    if text.startswith('"', position):
        start = end = position + 1
        while end < len(text) and text[end] != '"':
            end += 1
        position = end + 1
        while position < len(text) and text[position] not in (delimiter, "\r", "\n"):
            position += 1
    else:
        start = position
        while position < len(text) and text[position] not in (delimiter, "\r", "\n"):
            position += 1
        end = position
    while start < end and text[start].isspace():
        start += 1
    while start < end and text[end - 1].isspace():
        end -= 1
    return (start, end), min(position, len(text))


_MOVES: dict[str, MoveKind] = {"joint": "joint", "linear": "linear", "circular": "circular", "via": "circular"}


@dataclass(frozen=True, eq=False, kw_only=True)
class PathTable:
    """A table with its place in the text and what was read from it, a row each."""

    source: Source
    table: Table
    columns: Columns
    rows: tuple[Row, ...]
    T: Float[np.ndarray, "rows 4 4"]
    """Poses of the tool in the part's frame, metres; NaN where a row has none."""
    q: Float[np.ndarray, "rows joints"]
    """Radians or metres; NaN where a row has none."""
    speed: Float[np.ndarray, " rows"]
    """Metres per second; NaN where a row has none."""

    def error(self, message: str, row: int, column: str | None = None) -> FileError:
        """An error that points at a cell or a line."""
        return self.table.error(message, row, column)

    def place(self, row: int) -> Place:
        """Where a row stands."""
        return Place(path=self.source.path, line=self.table.lines[row])

    def cell(self, row: int, column: str) -> tuple[int, int]:
        """First character of a cell, and behind its last one."""
        return self.rows[row].cells[self.table.header.index(column)]

    def word(self, row: int, meaning: str) -> str:
        """A cell that holds a word; empty where the column is lacking."""
        name = self.columns.words.get(meaning)
        return "" if name is None else self.table.rows[row][self.table.header.index(name)]

    def kind(self, row: int) -> MoveKind:
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
    table = parse_csv(source.path, source.text.removeprefix("\ufeff"))
    groups = ColumnGroups(table)
    columns = columns_of(groups, robot)
    pose, joints = (groups.side_by_side(names, empty=True) for names in (columns.pose, columns.joints))
    for row in range(len(table)):
        _check_complete(table, columns, row, np.isnan(pose[row]), np.isnan(joints[row]))
    T = np.full((len(table), 4, 4), np.nan)
    posed = np.asarray(~np.isnan(pose).any(axis=1))
    if columns.pose and posed.any():
        rotation, what = pose[:, 3:], "tool axis" if columns.only_axis else "quaternion"
        groups.check_lengths(rotation, posed, columns.rotation[0], what)
        R = with_axis(rotation[posed]) if columns.only_axis else se3.from_quaternion(rotation[posed])
        T[posed] = se3.pose(R, pose[posed, :3] * 1e-3)
    return PathTable(
        source=source,
        table=table,
        columns=columns,
        rows=locate_rows(source, table),
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


def _speeds(table: Table, columns: Columns) -> Float[np.ndarray, " rows"]:
    name = columns.words.get("speed_mm_s")
    if name is None:
        return np.full(len(table), np.nan)
    values = table.numbers(name, empty=True)
    for row in np.flatnonzero(values <= 0):
        message = f"{values[row]:g} is not a speed; give one above zero, or leave the cell empty"
        raise table.error(message, int(row), name)
    return values * 1e-3
