"""Rewriting motions of a TP program: numbers of its positions, positions of their own, and motions before others."""

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from math import isclose

import numpy as np
from jaxtyping import Float

from robot_programs.core import se3
from robot_programs.core.errors import InputError
from robot_programs.core.program import Composition, Motion, Paths, Program, Visit, Waypoint
from robot_programs.core.robot import Robot
from robot_programs.core.source import Source, TextEdit
from robot_programs.tp.listing import (
    METRES_PER_SECOND,
    Configuration,
    Group,
    Instruction,
    Listing,
    MotionLine,
    Operand,
    Position,
    Register,
    edits_for,
    joint_values,
    listed,
    pose_values,
)

_POSITION_NUMBER = re.compile(r"\bP\s*\[\s*(\d{1,5})", re.IGNORECASE)
_LINE_COUNT = re.compile(r"\bLINE_COUNT\s*=\s*(\d+)", re.IGNORECASE)
PASSING = "CNT100"


Shifts = tuple[Float[np.ndarray, "4 4"], Float[np.ndarray, "4 4"]]
"""By which a motion shifts its positions: in the user frame, and in the tool."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Written:
    """A position of a motion as it is written."""

    operand: Operand
    position: Position | None
    """None of a register."""
    stated: Group | Register
    """The position's values of the robot's group; or the register, whose value no program states."""
    numbers: tuple[int, int]
    """Of user frame and tool."""
    offset: Shifts

    @property
    def start(self) -> int:
        """Place of its numbers."""
        return self.operand.start if self.position is None else self.position.start


@dataclass(frozen=True, eq=False, kw_only=True)
class Site:
    """A motion's place in the text."""

    file: int
    listing: Listing
    instruction: Instruction
    motion: MotionLine
    written: tuple[Written, ...]


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class TpProgram(Program):
    """TP program read from listings."""

    sites: tuple[Site, ...]
    """Of the moves, in their order."""
    unresolved: tuple[Visit, ...] = ()
    """Positions of motions that were not resolved."""

    def rewrite(self, robot: Robot, waypoints: Paths) -> tuple[Source, ...]:
        """The program's files with some motions rewritten.

        Positions get new numbers where all motions that name one agree; where others still need the old ones, and in place of
        registers, the motion names a new position, which stands behind all others. Waypoints before the last become motions
        of their own in the lines before, and the lines behind are numbered anew.

        Args:
            robot: the robot, whose joint positions decide the configuration.
            waypoints: by number of the motion.

        Raises:
            InputError: a motion is to become one of another kind.
        """
        by_file: dict[int, list[int]] = {}
        for number in sorted(waypoints):
            by_file.setdefault(self.sites[number].file, []).append(number)
        out = list(self.sources)
        for file, numbers in by_file.items():
            rewriting = _Rewriting(source=out[file], listing=self.sites[numbers[0]].listing, robot=robot)
            for number in numbers:
                rewriting.motion(self.sites[number], self.motions[number], waypoints[number])
            out[file] = rewriting.result()
        return tuple(out)

    def speed_edit(self, number: int, speed: float) -> tuple[int, TextEdit]:
        """The speed in the motion's own unit; see `Program.speed_edit`.

        Raises:
            InputError: it is not whole in that unit, and the unit takes whole numbers.
        """
        site = self.sites[number]
        start, end, unit = site.motion.speed_at
        value = speed / METRES_PER_SECOND[unit]
        if unit != "inch/min" and not isclose(value, round(value), rel_tol=1e-9):
            raise InputError(f"{self.motions[number].place}: {value:g} {unit} is not whole, as TP states it")
        return site.file, TextEdit(start=start, end=end, text=f"{value:.10g}")

    def visits(self) -> Iterable[Visit]:
        """Motions of one listing that name one position, whatever shifts it; see `Program.visits`."""
        for number, (site, move) in enumerate(zip(self.sites, self.motions, strict=True)):
            for written in site.written:
                yield Visit(number=number, target=(site.file, written.operand.name), place=move.place)
        yield from self.unresolved


@dataclass(eq=False, kw_only=True)
class _Rewriting:
    """Rewriting one file."""

    source: Source
    listing: Listing
    robot: Robot
    edits: list[TextEdit] = field(default_factory=list[TextEdit])
    added: list[str] = field(default_factory=list[str])
    """Texts of new positions."""
    inserted: dict[int, list[str]] = field(default_factory=dict[int, list[str]])
    """Texts of new instructions, behind their numbers, by the place of the one that they stand before."""
    changes: dict[int, dict[str, list[Written]]] = field(default_factory=dict[int, dict[str, list[Written]]])
    """By position: its new texts, each with the operands that want it."""
    fresh: int = 0
    """Largest number of a position."""

    def __post_init__(self) -> None:
        numbers = [int(m[1]) for m in _POSITION_NUMBER.finditer(self.source.text)]
        self.fresh = max(numbers, default=0)

    def motion(self, site: Site, move: Motion, path: tuple[Waypoint, ...]) -> None:
        *before, last = path
        if any(waypoint.kind != move.kind for waypoint in path):
            raise InputError(f"{move.place}: the motion cannot become one of another kind in TP")
        if before:
            self.inserted[site.instruction.start] = [self._instruction(site, move, waypoint) for waypoint in before]
        self._point(site.written[-1], last)
        if last.via is not None:
            self._point(site.written[0], last.via)

    def _point(self, written: Written, waypoint: Waypoint) -> None:
        text = self._position(written, waypoint)
        number = written.operand.number
        assert number is not None
        if written.position is None:
            self._name(written.operand, self._add(text))
            return
        self.changes.setdefault(number, {}).setdefault(text, []).append(written)

    def _instruction(self, site: Site, move: Motion, waypoint: Waypoint) -> str:
        """The motion's own text with another position, passing by it."""
        motion, own = site.motion, site.instruction
        edits: list[TextEdit] = []
        points = [waypoint] if waypoint.via is None else [waypoint.via, waypoint]
        for written, point in zip(site.written, points, strict=True):
            operand = written.operand
            name = f"P[{self._add(self._position(written, point))}]"
            edits.append(TextEdit(start=operand.start, end=operand.end, text=name))
        if move.stops:
            start, end = motion.termination
            edits.append(TextEdit(start=start, end=end, text=PASSING))
        piece = self.source.piece(own.number[1], own.end, edits)
        # without a number and a semicolon, the line behind would go on with this one
        return piece if piece.endswith(";") else f"{piece} ;"

    def _position(self, written: Written, waypoint: Waypoint) -> str:
        """A position's text for a waypoint: from its number's closing bracket on."""
        values, configuration = self._values(written, waypoint)
        position, group = written.position, written.stated
        if position is None or not isinstance(group, Group):
            stated = "" if configuration is None else str(configuration)
            return listed(written.numbers, values, stated, self.source.newline)
        edits = edits_for(group, values)
        if configuration is not None and group.configuration_at[1]:
            start, end = group.configuration_at
            if str(configuration) != str(Configuration.parse(group.configuration)):
                edits.append(TextEdit(start=start, end=end, text=str(configuration)))
        for (number, name), value in zip(position.external, waypoint.external, strict=False):
            if not np.isnan(value):
                edits += edits_for(position.groups[number], {name: value})
        first = position.number_at[1]
        return self.source.piece(first, position.end, edits)

    def _values(self, written: Written, waypoint: Waypoint) -> tuple[dict[str, float], Configuration | None]:
        """Values of all components, millimetres and degrees, and the configuration of a pose."""
        stated = written.stated
        if not stated.is_pose:
            return joint_values(waypoint.q), None
        assert waypoint.T is not None
        shift, tool_shift = written.offset
        T = se3.inverse(shift) @ waypoint.T @ se3.inverse(tool_shift)
        near = stated if isinstance(stated, Group) else None
        return pose_values(T, near), Configuration.parse(stated.configuration).of(self.robot, waypoint.q)

    def _add(self, text: str) -> int:
        """Add a position, and give its number."""
        self.fresh += 1
        self.added.append(f"P[{self.fresh}{text}")
        return self.fresh

    def _name(self, operand: Operand, number: int) -> None:
        self.edits.append(TextEdit(start=operand.start, end=operand.end, text=f"P[{number}]"))

    def result(self) -> Source:
        self._positions()
        self._lines()
        if self.added:
            newline = self.source.newline
            ends = [position.end for position in self.listing.positions.values()]
            behind = max(ends, default=self.listing.sections["POS"][0] - len(newline))
            self.edits.append(TextEdit(start=behind, end=behind, text="".join(newline + text for text in self.added)))
        return self.source.edited(self.edits)

    def _positions(self) -> None:
        """Change positions where all that name one agree, and copy them where they do not."""
        named = self._named()
        for number, texts in self.changes.items():
            first = next(iter(texts.values()))[0]
            position = first.position
            assert position is not None
            old = self.source.text[position.number_at[1] : position.end]
            rewritten = {w.operand.start for operands in texts.values() for w in operands}
            stays = old in texts or named.get(number, set()) - rewritten
            for text, operands in texts.items():
                if text == old:
                    continue
                if not stays:
                    self.edits.append(TextEdit(start=position.number_at[1], end=position.end, text=text))
                    stays = True
                    continue
                fresh = self._add(text)
                for operand in {w.operand.start: w.operand for w in operands}.values():
                    self._name(operand, fresh)

    def _named(self) -> dict[int, set[int]]:
        """By position, where the instructions name it."""
        out: dict[int, set[int]] = {}
        for instruction in self.listing.instructions:
            for match in _POSITION_NUMBER.finditer(instruction.text):
                out.setdefault(int(match[1]), set()).add(instruction.body + match.start())
        return out

    def _lines(self) -> None:
        """Put new instructions before theirs, number all behind them anew, and count them."""
        if not self.inserted:
            return
        added, expected = 0, 1
        for instruction in self.listing.instructions:
            start, end = instruction.number
            number = self.source.text[start:end]
            counts = bool(number) and int(number) == expected  # a condition under a motion counts its lines anew
            expected += counts
            if instruction.start in self.inserted:
                added += self._insert(instruction, int(number) + added if counts else None)
            if counts and added:
                text = self._numbered(instruction, int(number) + added)
                self.edits.append(TextEdit(start=instruction.start, end=end, text=text))
        start, end = self.listing.sections.get("ATTR", (0, 0))
        count = _LINE_COUNT.search(self.source.text, start, end)
        if count is not None:
            self.edits.append(TextEdit(start=count.start(1), end=count.end(1), text=str(int(count[1]) + added)))

    def _insert(self, instruction: Instruction, first: int | None) -> int:
        """Put the new instructions before one, numbered from a number on, and say how many they are."""
        texts = self.inserted[instruction.start]
        head = self.source.text[instruction.start : instruction.number[1]]
        lines = [
            (head if first is None else self._numbered(instruction, first + k)) + text + self.source.newline
            for k, text in enumerate(texts)
        ]
        self.edits.append(TextEdit(start=instruction.start, end=instruction.start, text="".join(lines)))
        return len(texts)

    def _numbered(self, instruction: Instruction, number: int) -> str:
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
