"""Reading tool paths and joint paths in CSV."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from taskcal.errors import FileError
from taskcal.programs.csv_path.rewriting import Written, rewritten
from taskcal.programs.csv_path.sheet import Sheet, read_sheet
from taskcal.programs.program import Frame, Move, Program, Remark, Target, Waypoint
from taskcal.programs.source import Edit, Source
from taskcal.programs.spinning import spun_alike
from taskcal.robot.robot import Robot

_YES, _NO = ("1", "yes", "true"), ("", "0", "no", "false")


@dataclass(frozen=True, eq=False, kw_only=True)
class CsvProgram(Program):
    """Paths read from CSV."""

    sheets: tuple[Sheet, ...]
    written: tuple[tuple[int, Written], ...]
    """Where each motion stands: number of its sheet, and rows."""
    robot: Robot | None
    tool: Frame | None
    part: Frame

    def rewrite(self, robot: Robot, ways: Mapping[int, tuple[Waypoint, ...]]) -> tuple[Source, ...]:
        """The files with some motions rewritten; see `Program.rewrite`.

        Raises:
            TaskcalError: a motion is to become something for which the file has no columns.
        """
        edits: list[list[Edit]] = [[] for _ in self.sheets]
        for number, way in ways.items():
            s, written = self.written[number]
            edits[s] += rewritten(self.sheets[s], written, way)
        return tuple(sheet.source.edited(e) for sheet, e in zip(self.sheets, edits, strict=True))

    def reread(self, sources: tuple[Source, ...]) -> "CsvProgram":
        """The program of other texts of the same files, with this one's spins along the way; see `Program.reread`."""
        return spun_alike(read_csv_path(sources, robot=self.robot, tool=self.tool, part=self.part), self)


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
    sheets = tuple(read_sheet(source, robot) for source in sources)
    moves: list[Move] = []
    written: list[tuple[int, Written]] = []
    remarks: list[Remark] = []
    for s, sheet in enumerate(sheets):
        if sheet.columns.position and tool is None and robot is None:
            raise FileError(sheet.source.path, "does not say what its positions are of; give the tool, or the robot")
        own = tool or Frame(name="", T=np.eye(4) if robot is None else robot.T_flange_tool)
        before: int | None = None
        via: int | None = None
        for row in range(len(sheet.rows)):
            if sheet.is_via(row):
                if via is not None or row + 1 == len(sheet.rows):
                    raise sheet.error("a point on the way must be followed by the end of its arc", row)
                via = row
                continue
            strangers = _strangers(sheet, row, own, part)
            if strangers:
                remarks.append(Remark(place=sheet.place(row), text=strangers))
                before = None
            else:
                moves.append(_move(sheet, row, via, own, part, before))
                written.append((s, Written(row=row, via=via)))
                before = len(moves) - 1
            via = None
    return CsvProgram(
        sources=tuple(sources),
        moves=tuple(moves),
        remarks=tuple(remarks),
        sheets=sheets,
        written=tuple(written),
        robot=robot,
        tool=tool,
        part=part,
    )


def _strangers(sheet: Sheet, row: int, tool: Frame, part: Frame) -> str:
    """Why a row's tool or frame is not known; empty where both are."""
    for meaning, frame in (("tool", tool), ("frame", part)):
        name = sheet.word(row, meaning)
        if name and name != frame.name:
            return f"{meaning} '{name}' is not known; only '{frame.name}' was given, so the motion stays as it is"
    return ""


def _move(sheet: Sheet, row: int, via: int | None, tool: Frame, part: Frame, before: int | None) -> Move:
    kind = sheet.kind(row)
    if (kind == "circular") != (via is not None):
        message = "a row 'via' with the point on the way must stand before the end of an arc, and 'circular' at its end"
        raise sheet.error(message, row, "move")
    return Move(
        kind=kind,
        end=_target(sheet, row),
        via=None if via is None else _target(sheet, via),
        tool=tool,
        part=part,
        part_in_hand=False,
        speed=None if np.isnan(sheet.speed[row]) else float(sheet.speed[row]),
        stops=_stops(sheet, row),
        follows=before,
        routine=sheet.source.path.stem,
        place=sheet.place(row),
    )


def _target(sheet: Sheet, row: int) -> Target:
    posed = not np.isnan(sheet.T[row]).any()
    return Target(
        name=sheet.word(row, "name") or sheet.word(row, "id"),
        T=sheet.T[row] if posed else None,
        q=None if posed else sheet.q[row],
        posture=None,
        place=sheet.place(row),
        free_spin=posed and sheet.columns.only_axis,
    )


def _stops(sheet: Sheet, row: int) -> bool:
    word = sheet.word(row, "stop").lower()
    if word not in _YES + _NO:
        raise sheet.error(f"'{word}' is neither yes nor no", row, sheet.columns.words["stop"])
    return word in _YES
