"""Rewriting motions of a TP program: numbers of its positions, positions of their own, and motions before others."""

import re
from collections import defaultdict
from collections.abc import Collection, Hashable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from math import isclose
from typing import Any, ClassVar, cast

import numpy as np

from robot_programs.core.form import Span, Text
from robot_programs.core.program import Composition, Paths, TargetVisit, Waypoint
from robot_programs.core.robot import Robot
from robot_programs.core.sharing import Pose, SharingProgram, Spelling, Use, points_of
from robot_programs.core.source import Source, TextEdit
from robot_programs.core.values import Origin
from robot_programs.tp.listing import (
    JOINTS,
    METRES_PER_SECOND,
    Configuration,
    Instruction,
    Listing,
    MotionGroup,
    Position,
    Register,
    edits_for,
    joint_values,
    listed,
    pose_values,
)
from robot_programs.tp.lower import MotionInstruction, NamedPosition
from taskcal_groundwork import se3
from taskcal_groundwork.errors import InputError

_POSITION_NUMBER = re.compile(r"\bP\s*\[\s*(\d{1,5})", re.IGNORECASE)
_COMPUTED_POSITION = re.compile(r"=\s*P\s*\[\s*[A-Z]", re.IGNORECASE)
"""One whose number is computed, assigned to a register."""
_LINE_COUNT = re.compile(r"\bLINE_COUNT\s*=\s*(\d+)", re.IGNORECASE)
PASSING = "CNT100"


Shifts = tuple[Pose, Pose]
"""By which a motion shifts its positions: in the user frame, and in the tool."""


@dataclass(frozen=True, eq=False, kw_only=True)
class WrittenPosition:
    """A position of a motion as it is written."""

    operand: NamedPosition
    position: Position | None
    """None of a register."""
    origin: Origin | None
    """Where its numbers stand; None of a register."""
    stated: MotionGroup | Register
    """The position's values of the robot's group; or the register, whose value no program states."""
    numbers: tuple[int, int]
    """Of user frame and tool."""
    offset: Shifts

    @property
    def start(self) -> int:
        """Place of its numbers."""
        return self.operand.start if self.position is None else self.position.start

    def without_offset(self, T: Pose) -> Pose:
        """Pose that the position states for one to which the motion leads."""
        shift, tool_shift = self.offset
        return se3.inverse(shift) @ T @ se3.inverse(tool_shift)

    def with_offset(self, T: Pose) -> Pose:
        """The inverse."""
        shift, tool_shift = self.offset
        return shift @ T @ tool_shift


@dataclass(frozen=True, eq=False, kw_only=True)
class TpSite:
    """A motion's place in the text."""

    file: int
    listing: Listing
    motion: MotionInstruction
    written: tuple[WrittenPosition, ...]
    from_memory: bool
    """It depends on registers of the controller."""

    @property
    def text(self) -> Text:
        """Number of the file, and first character."""
        return self.motion.at[:2]


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class TpProgram(SharingProgram):
    """TP program read from listings."""

    LANGUAGE: ClassVar = "TP"

    sites: tuple[TpSite, ...] = ()
    unresolved: tuple[TargetVisit, ...] = ()
    """Positions of motions that were not resolved."""

    def spelling(self, robot: Robot, waypoints: Paths) -> "TpSpelling":
        """Positions get new numbers in their place, or stand behind all others; lines behind new ones are numbered anew."""
        return TpSpelling(sources=self.sources, program=self, robot=robot, uses=[*self._uses(robot, waypoints)])

    def _uses(self, robot: Robot, waypoints: Paths) -> Iterator[Use[str]]:
        for number, (site, move) in enumerate(zip(self.sites, self.motions, strict=True)):
            source, path = self.sources[site.file], waypoints.get(number)
            for written, point in zip(
                site.written, points_of(len(site.written), path[-1] if path else None), strict=True
            ):
                old = own_text(source, written)
                posed = move.via is None and written.stated.is_pose
                yield Use(
                    motion=number,
                    text=(site.file, written.operand.start, written.operand.end),
                    slot=written.origin,
                    numbers=old,
                    wanted=old if point is None else position_text(source, robot, written, point),
                    poses=(written.without_offset, written.with_offset) if posed else None,
                )

    def speed_edit(self, number: int, speed: float) -> tuple[int, TextEdit]:
        """The speed in the motion's own unit; see `Program.speed_edit`.

        Raises:
            InputError: it is not whole in that unit, and the unit takes whole numbers; or it stands in a register.
        """
        site = self.sites[number]
        start, end, unit = site.motion.speed_at
        if not unit:
            return super().speed_edit(number, speed)
        value = speed / METRES_PER_SECOND[unit]
        if unit != "inch/min" and not isclose(value, round(value), rel_tol=1e-9):
            raise InputError(f"{self.motions[number].place}: {value:g} {unit} is not whole, as TP states it")
        return site.file, TextEdit(start=start, end=end, text=f"{value:.10g}")

    def visits(self) -> Iterable[TargetVisit]:
        """Motions of one listing that name one position, whatever shifts it; see `Program.visits`."""
        for number, (site, move) in enumerate(zip(self.sites, self.motions, strict=True)):
            for written in site.written:
                yield TargetVisit(number=number, target=(site.file, written.operand.name), place=move.place)
        yield from self.unresolved


def own_text(source: Source, written: WrittenPosition) -> str:
    """A position's text as it stands, from its number's closing bracket on; of a register, that of one with what it holds."""
    position, stated = written.position, written.stated
    if position is not None:
        return source.text[position.number_at[1] : position.end]
    values = pose_values(stated.pose()) if stated.is_pose else joint_values(stated.joints(len(JOINTS)))
    configuration = str(Configuration.parse(stated.configuration)) if stated.is_pose else ""
    return listed(written.numbers, values, configuration, source.newline)


def position_text(source: Source, robot: Robot, written: WrittenPosition, waypoint: Waypoint) -> str:
    """A position's text for a waypoint, from its number's closing bracket on; `source` has the one that is written."""
    stated, configuration = written.stated, None
    position, near = written.position, stated if isinstance(stated, MotionGroup) else None
    if stated.is_pose:
        assert waypoint.T is not None
        values = pose_values(written.without_offset(waypoint.T), near)
        configuration = Configuration.parse(stated.configuration).of(robot, waypoint.q)
    else:
        values = joint_values(waypoint.q)
    if position is None or near is None:
        return listed(written.numbers, values, "" if configuration is None else str(configuration), source.newline)
    edits = edits_for(near, values)
    if configuration is not None and near.configuration_at[1]:
        start, end = near.configuration_at
        if str(configuration) != str(Configuration.parse(near.configuration)):
            edits.append(TextEdit(start=start, end=end, text=str(configuration)))
    for (number, name), value in zip(position.external, waypoint.external, strict=False):
        if not np.isnan(value):
            edits += edits_for(position.groups[number], {name: value})
    return source.piece(position.number_at[1], position.end, edits)


@dataclass(eq=False, kw_only=True)
class TpSpelling(Spelling[str]):
    """What is written into listings; numbers of a position are its text, from its number's closing bracket on."""

    program: TpProgram
    robot: Robot
    added: dict[int, list[str]] = field(default_factory=lambda: defaultdict[int, list[str]](list))
    """Texts of new positions, by file."""
    inserted: dict[int, dict[int, list[str]]] = field(default_factory=lambda: defaultdict[int, Any](dict))
    """By file: texts of new instructions, behind their numbers, by the place of the one that they stand before."""

    @cached_property
    def listings(self) -> Mapping[int, Listing]:
        """Those with motions."""
        return {site.file: site.listing for site in self.program.sites}

    def alike(self, one: str, other: str) -> bool:
        """Whether two positions have one text."""
        return one == other

    def reader(self, slot: Origin, texts: Collection[Span]) -> str:
        """Another instruction that names a position, or a motion that comes to it by a computed number."""
        file, named = slot.at[0], self._named[slot.at[0], slot.path[0]].keys()
        other = min(named - {start for number, start, _ in texts if number == file}, default=None)
        return "" if other is None else self.place((file, other, other))

    @cached_property
    def _named(self) -> Mapping[tuple[int, Hashable], Mapping[int, None]]:
        """By file and position, where instructions name it, or may by a computed index; of a motion, where it comes to it."""
        out = defaultdict[tuple[int, Hashable], dict[int, None]](dict)
        for file, listing in self.listings.items():
            for instruction in listing.instructions:
                for match in _POSITION_NUMBER.finditer(instruction.text):
                    out[file, int(match[1])][instruction.body + match.start()] = None
                if _COMPUTED_POSITION.search(instruction.text):
                    for number in listing.positions:
                        out[file, number][instruction.body] = None
        for use in self.uses:
            if use.slot is not None:
                out[use.text[0], use.slot.path[0]][use.text[1]] = None
        return out

    @cached_property
    def _largest(self) -> Mapping[int, int]:
        """Largest number of a position, by file."""
        texts = {file: self.sources[file].text for file in self.listings}
        return {f: max((int(m[1]) for m in _POSITION_NUMBER.finditer(text)), default=0) for f, text in texts.items()}

    def in_place(self, use: Use[str]) -> None:
        """Change a position."""
        assert use.slot is not None
        file, _, end = use.slot.at
        position = self.listings[file].positions[cast("int", use.slot.path[0])]
        self.edits[file].append(TextEdit(start=position.number_at[1], end=end, text=use.wanted))

    def own(self, use: Use[str]) -> str:
        """Add a position, and name it."""
        return self._add(use.text[0], use.wanted)

    def clone(self, use: Use[str]) -> str | None:
        """The same: the positions of a listing are its declarations."""
        return self.own(use)

    def _add(self, file: int, text: str) -> str:
        number = self._largest[file] + len(self.added[file]) + 1
        self.added[file].append(f"P[{number}{text}")
        return f"P[{number}]"

    def insert(self, number: int, path: Sequence[Waypoint]) -> None:
        """Write motions before a motion, with its own text and positions of their own, which pass by them."""
        site, stops = self.program.sites[number], self.program.motions[number].stops
        self.inserted[site.file][site.motion.instruction.start] = [
            self._instruction(site, waypoint, stops=stops) for waypoint in path[:-1]
        ]

    def _instruction(self, site: TpSite, waypoint: Waypoint, *, stops: bool) -> str:
        motion, own, source = site.motion, site.motion.instruction, self.sources[site.file]
        edits: list[TextEdit] = []
        for written, point in zip(site.written, points_of(len(site.written), waypoint), strict=True):
            assert point is not None
            name = self._add(site.file, position_text(source, self.robot, written, point))
            edits.append(TextEdit(start=written.operand.start, end=written.operand.end, text=name))
        if stops:
            start, end = motion.termination
            edits.append(TextEdit(start=start, end=end, text=PASSING))
        piece = source.piece(own.number[1], own.end, edits)
        # without a number and a semicolon, the line behind would go on with this one
        return piece if piece.endswith(";") else f"{piece} ;"

    def result(self) -> tuple[Source, ...]:
        """The files with all that was written."""
        for file, inserted in self.inserted.items():
            self.edits[file] += _with_lines(self.sources[file], self.listings[file], inserted)
        for file, texts in self.added.items():
            listing, newline = self.listings[file], self.sources[file].newline
            ends = [position.end for position in listing.positions.values()]
            behind = max(ends, default=listing.sections["POS"][0] - len(newline))
            self.edits[file].append(TextEdit(start=behind, end=behind, text="".join(newline + text for text in texts)))
        return super().result()


def _with_lines(source: Source, listing: Listing, inserted: Mapping[int, Sequence[str]]) -> Iterator[TextEdit]:
    """Put new instructions before others, number all behind them anew, and count them."""
    added, expected = 0, 1
    for instruction in listing.instructions:
        start, end = instruction.number
        number = source.text[start:end]
        counts = bool(number) and int(number) == expected  # a condition under a motion counts its lines anew
        expected += counts
        texts = inserted.get(instruction.start, ())
        head = source.text[instruction.start : end]
        lines = [
            (_numbered(instruction, int(number) + added + k) if counts else head) + text + source.newline
            for k, text in enumerate(texts)
        ]
        yield from [TextEdit(start=instruction.start, end=instruction.start, text="".join(lines))] if lines else ()
        added += len(lines)
        if counts and added:
            yield TextEdit(start=instruction.start, end=end, text=_numbered(instruction, int(number) + added))
    start, end = listing.sections.get("ATTR", (0, 0))
    count = _LINE_COUNT.search(source.text, start, end)
    if count is not None:
        yield TextEdit(start=count.start(1), end=count.end(1), text=str(int(count[1]) + added))


def _numbered(instruction: Instruction, number: int) -> str:
    """Beginning of a line, with another number in the columns of its own where there is room."""
    return str(number).rjust(instruction.number[1] - instruction.start)


# A new TP program of motions to joint positions, such as a measuring program has.

NEWLINE = "\r\n"
"""As FANUC's controllers write it."""

MAX_NAME_LENGTH = 36
MAX_REMARK_LENGTH = 32


def compose_tp(program: Composition) -> Source:
    """A program of its own, ``name.ls``, of motions to joint positions: it cannot state its user frames and tools.

    Raises:
        InputError: TP cannot say it.
    """
    program.expect_name("a TP program", MAX_NAME_LENGTH)
    program.expect_input(r"\d+", "its number, such as 3")
    positions: list[str] = []
    for number, move in enumerate(program.motions):
        if move.end.q is None:
            raise InputError(
                f"motion {number} goes to a pose in '{move.part.name}'; a TP program does not state its frames, so that new ones "
                "are written of motions to joint positions only: correct a program that is there, or write another language"
            )
        positions.append(f"P[{number + 1}{listed((0, 0), joint_values(move.end.q), '', NEWLINE)}")
    instructions = list(_instructions(program))
    lines = [
        f"/PROG  {program.name.upper()}",
        "/ATTR",
        "OWNER\t\t= MNEDITOR;",
        f"LINE_COUNT\t= {len(instructions)};",
        "DEFAULT_GROUP\t= 1,*,*,*,*;",
        "/MN",
        *(f"{k + 1:4}:{text} ;" for k, text in enumerate(instructions)),
        "/POS",
        *positions,
        "/END",
    ]
    return program.written(lines, ".ls", NEWLINE)


def _instructions(program: Composition) -> Iterator[str]:
    for i, move in enumerate(program.motions):
        if program.notes:
            yield f"  !{program.note(i)[:MAX_REMARK_LENGTH]}"
        yield f"J P[{i + 1}] {program.joint_speed_percent:g}% {'FINE' if move.stops else 'CNT100'}"
        yield from program.waits(i, "  WAIT {0:6.2f}(sec)", "  WAIT DI[{0}]=OFF", "  WAIT DI[{0}]=ON")
