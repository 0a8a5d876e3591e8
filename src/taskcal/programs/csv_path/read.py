"""Reading tool paths and joint paths in CSV."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from taskcal.errors import FileError
from taskcal.programs.csv_path.path_table import PathTable, read_path_table
from taskcal.programs.csv_path.resolve import resolve_move, unknown_frame
from taskcal.programs.csv_path.rewrite import Written, rewrite
from taskcal.programs.program import Diagnostic, Frame, Move, Program, Waypoint
from taskcal.programs.source import Edit, Source
from taskcal.robot.robot import Robot


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class CsvProgram(Program):
    """Paths read from CSV."""

    path_tables: tuple[PathTable, ...]
    written: tuple[tuple[int, Written], ...]
    """Where each motion stands: number of its table, and rows."""
    robot: Robot | None
    tool: Frame | None
    part: Frame

    def rewrite(self, robot: Robot, waypoints: Mapping[int, tuple[Waypoint, ...]]) -> tuple[Source, ...]:
        """The files with some motions rewritten; see `Program.rewrite`.

        Raises:
            TaskcalError: a motion is to become something for which the file has no columns.
        """
        edits: list[list[Edit]] = [[] for _ in self.path_tables]
        for number, path in waypoints.items():
            s, written = self.written[number]
            edits[s] += rewrite(self.path_tables[s], written, path)
        return tuple(path_table.source.edited(e) for path_table, e in zip(self.path_tables, edits, strict=True))

    def reread(self, sources: tuple[Source, ...]) -> "CsvProgram":
        """The program of other texts of the same files; see `Program.reread`."""
        return read_csv_path(sources, robot=self.robot, tool=self.tool, part=self.part)


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
    moves: list[Move] = []
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
                moves.append(resolve_move(path_table, row, via, own, part, before))
                written.append((s, Written(row=row, via=via)))
                before = len(moves) - 1
            via = None
    return CsvProgram(
        sources=tuple(sources),
        moves=tuple(moves),
        diagnostics=tuple(diagnostics),
        path_tables=path_tables,
        written=tuple(written),
        robot=robot,
        tool=tool,
        part=part,
    )
