"""A path in CSV: its table, what its rows mean, and where they stand in the text."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from taskcal.errors import FileError
from taskcal.geometry import se3
from taskcal.programs.csv_path.columns import Columns, columns_of
from taskcal.programs.csv_path.lexer import Row, locate_rows
from taskcal.programs.program import MoveKind
from taskcal.programs.source import Place, Source
from taskcal.programs.tool_axis import with_axis
from taskcal.robot.robot import Robot
from taskcal.tabular.column_groups import ColumnGroups
from taskcal.tabular.csv_form import parse_csv
from taskcal.tabular.table import Table

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
