"""The parts of a program's listing: its sections, and the instructions in one of them."""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

from taskcal.programs.tp.position import Position, read_positions
from taskcal.programs.tp.stretches import stretches

_SECTION = re.compile(r"^[ \t]*/(PROG|ATTR|APPL|MN|POS|END)\b[^\r\n]*(?:\r?\n|$)", re.MULTILINE | re.IGNORECASE)
_LINE = re.compile(r"[ \t]*(?P<number>\d*)[ \t]*:")
_POSITION = re.compile(r"^[ \t]*(?P<head>P)\[[^\r\n]*\{", re.MULTILINE)
_NAME = re.compile(r"/PROG[ \t]+(?P<name>[^\s;]+)", re.IGNORECASE)


@dataclass(frozen=True, kw_only=True)
class Instruction:
    """An instruction of the program, over one line or several."""

    start: int
    """First character of its first line."""
    number: tuple[int, int]
    """Where its number stands; empty where it has none."""
    body: int
    """Behind the colon."""
    end: int
    """Behind its last character, the semicolon."""
    text: str
    """From the body to the end, with what begins its further lines blanked out."""


@dataclass(frozen=True, eq=False)
class Listing:
    """A program's listing."""

    text: str

    @cached_property
    def sections(self) -> dict[str, tuple[int, int]]:
        """Where the first section of each name stands, without the line that names it."""
        out: dict[str, tuple[int, int]] = {}
        for mark, end in stretches(_SECTION.finditer(self.text), len(self.text)):
            out.setdefault(mark[1].upper(), (mark.end(), end))
        return out

    @cached_property
    def positions(self) -> dict[int, Position]:
        """Those of the section POS, by number."""
        return {position.number: position for position in self._blocks}

    @cached_property
    def _blocks(self) -> tuple[Position, ...]:
        return tuple(read_positions(self.text, *self.sections.get("POS", (0, 0))))

    def fault(self) -> tuple[int, str] | None:
        """Where a position is not whole, or has the number of another one, and what is wrong; None where all are sound."""
        closed = {position.start for position in self._blocks}
        for head in _POSITION.finditer(self.text, *self.sections.get("POS", (0, 0))):
            if head.start("head") not in closed:
                return head.start("head"), "the position that begins here is not closed by }; is the file whole?"
        numbers: set[int] = set()
        for position in self._blocks:
            if position.number in numbers:
                return position.start, f"P[{position.number}] is listed a second time; which one counts is not known"
            numbers.add(position.number)
        return None

    @cached_property
    def name(self) -> str:
        """Of the program; empty where it is not stated."""
        match = _NAME.search(self.text)
        return "" if match is None else match["name"]

    @cached_property
    def instructions(self) -> tuple[Instruction, ...]:
        """Those of the section MN, in their order."""
        return tuple(_instructions(self.text, *self.sections.get("MN", (0, 0))))


def _instructions(text: str, start: int, end: int) -> Iterator[Instruction]:
    opened: tuple[int, tuple[int, int], int] | None = None
    pieces: list[str] = []
    behind = start
    for first, last in _lines(text, start, end):
        mark = _LINE.match(text, first, last)
        if mark is None:
            continue
        if opened is not None and mark["number"]:  # the one before has no semicolon
            yield _instruction(opened, behind, pieces)
            opened = None
        if opened is None:
            opened, pieces = (first, mark.span("number"), mark.end()), [text[mark.end() : last]]
        else:
            pieces += [" " * (mark.end() - behind), text[mark.end() : last]]
        behind = last
        if text[first:last].rstrip().endswith(";"):
            yield _instruction(opened, first + len(text[first:last].rstrip()), pieces)
            opened = None
    if opened is not None:
        yield _instruction(opened, behind, pieces)


def _instruction(opened: tuple[int, tuple[int, int], int], end: int, pieces: list[str]) -> Instruction:
    start, number, body = opened
    return Instruction(start=start, number=number, body=body, end=end, text="".join(pieces)[: end - body])


def _lines(text: str, start: int, end: int) -> Iterator[tuple[int, int]]:
    """Lines of a part of a text, without their ends."""
    while start < end:
        newline = text.find("\n", start, end)
        last = end if newline < 0 else newline
        yield start, last - 1 if last > start and text[last - 1] == "\r" else last
        start = last + 1
