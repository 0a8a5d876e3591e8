"""Reading tool paths and joint paths in CSV."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from robot_programs.core.errors import FileError
from robot_programs.core.program import Diagnostic, Frame, Move, Program, Target, Waypoint
from robot_programs.core.robot import Robot
from robot_programs.core.source import Edit, Source
from robot_programs.csv_path.rewrite import Written, rewrite
from robot_programs.csv_path.table import PathTable, read_path_table

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
) -> Move:
    """The motion of which a row holds the end.

    Raises:
        FileError: an arc has no via point, or another motion has one; or whether it stops is not said by yes or no.
    """
    kind = path_table.kind(row)
    if (kind == "circular") != (via is not None):
        message = "a row 'via' with the via point must stand before the end of an arc, and 'circular' at its end"
        raise path_table.error(message, row, "move")
    return Move(
        kind=kind,
        end=_target(path_table, row),
        via=None if via is None else _target(path_table, via),
        tool=tool,
        part=part,
        part_in_hand=False,
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
    robot: Robot | None
    tool: Frame | None
    part: Frame

    def rewrite(self, robot: Robot, waypoints: Mapping[int, tuple[Waypoint, ...]]) -> tuple[Source, ...]:
        """The files with some motions rewritten; see `Program.rewrite`.

        Raises:
            InputError: a motion is to become something for which the file has no columns.
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
