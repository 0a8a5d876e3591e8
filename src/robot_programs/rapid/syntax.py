"""What the text of a RAPID module consists of: words, numbers that are written out, and heads of data and routines."""

import re
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from robot_programs.core.form import Lit
from robot_programs.core.kit import Token
from robot_programs.core.source import Source

# Words: names, numbers, strings, lists of nothing but numbers, and symbols, each with its place in the text.

_NUMBER = r"(?: [0-9]+ (?:\.[0-9]*)? | \.[0-9]+ ) (?:[eE][+-]?[0-9]+)?"
_SIGNED = rf"(?: [+-] \s* )? {_NUMBER}"
# bounded, as what is repeated is kept by the search until the list ends
_LIST = rf"\[ \s* {_SIGNED} \s* (?: , \s* {_SIGNED} \s* ){{0,99}} \]"
# a target that is written out: lists of numbers in one, each tried in one way only
_NESTED = rf"\[ \s* (?>{_LIST}) \s* (?: , \s* (?>{_LIST}) \s* ){{0,9}} \]"
LIST = rf"(?: {_NESTED} | {_LIST} )"
NAME = r"[^\W\d]\w*"

# Every alternative begins with characters that no other begins with, so the time to read a file grows with its length.
WORD = re.compile(
    rf"""
      (?P<space>   [\s\ufeff]+ | ![^\n]* )
    | (?P<name>    {NAME} )
    | (?P<number>  0[xX][0-9A-Fa-f]+ | 0[bB][01]+ | 0[oO][0-7]+ | {_NUMBER} )
    | (?P<text>    "(?: [^"\n] | "" )* "? )
    | (?P<list>    {LIST} )
    | (?P<symbol>  := | <> | <= | >= | . )
    """,
    re.VERBOSE | re.DOTALL,
)
LISTED = re.compile(r"[^\s\[\],]+(?: \s+ [^\s\[\],]+)?", re.VERBOSE)
"""A number in such a list, whose sign may stand apart."""
_SIGN_APART = re.compile(r"([+-])\s+")
_BEGINS_NESTED = re.compile(r"\[\s*\[")

_HEADER = re.compile(r"[\ufeff \t\r\n]*%%%")

_RESERVED = """
    alias and backward case connect const default div do else elseif endfor endfunc endif endmodule endproc endrecord
    endtest endtrap endwhile error exit false for from func goto if inout local mod module nostepin not noview or pers
    proc raise readonly record retry return step sysmodule test then to trap true trynext undo var viewonly while with
    xor
"""
RESERVED = frozenset(_RESERVED.split())
"""Words that are not names."""


def words(text: str, start: int, end: int) -> Iterator[Token]:
    """The words between the start of one and the end of the same or a later one, in a module's text."""
    for match in WORD.finditer(text, start, end):
        kind = match.lastgroup or ""
        if kind == "name":  # the same come again and again; what is kept of the text has each once
            yield Token(kind, sys.intern(match[0]), match.start())
        elif kind != "space":
            yield Token(kind, match[0], match.start())


def tokenize(text: str) -> Iterator[Token]:
    """The words of a module's text without white space, comments and header."""
    return words(text, behind_header(text), len(text))


def behind_header(text: str) -> int:
    """Place behind what a controller writes in front of a module."""
    begin = _HEADER.match(text)
    end = text.find("%%%", begin.end()) if begin else -1
    return 0 if end < 0 else end + 3


def key_of(word: Token) -> str:
    """The text by which a name is compared: letter case does not matter in RAPID."""
    return sys.intern(word.text.lower())


def number(text: str) -> float:
    """The value of a number."""
    base = {"0x": 16, "0b": 2, "0o": 8}.get(text[:2].lower())
    # a float takes any length of digits, an integer of a foreign base does so too
    return float(text) if base is None else float(min(int(text[2:], base), 2**64))


# Numbers that are written out.


def listed(text: str, start: int, end: int) -> Iterator[tuple[int, int, float]]:
    """First character, end and value of each number of such a list."""
    for found in LISTED.finditer(text, start, end):
        yield found.start(), found.end(), float("".join(found[0].split()))  # a sign may stand apart


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class AggregateText:
    """Numbers in square brackets, or lists of these: most of a program, which are read when they are asked for."""

    text: str
    """Of the file."""
    start: int
    end: int
    is_literal: bool = True
    """It is one word, in which nothing else stands."""

    @property
    def is_nested(self) -> bool:
        """Whether lists stand in it."""
        return _BEGINS_NESTED.match(self.text, self.start) is not None

    @property
    def values(self) -> tuple[float | tuple[float, ...], ...]:
        """Numbers of a literal, those of its lists together."""
        own = self.text[self.start : self.end]
        try:
            return _values(own)
        except ValueError:
            return _values(_SIGN_APART.sub(r"\1", own))

    def leaves(self) -> Iterator[tuple[int, int, float]]:
        """First character, end and value of the numbers in their order."""
        if self.is_literal:
            yield from listed(self.text, self.start, self.end)
            return
        begins, factor = -1, 1.0
        for word in words(self.text, self.start, self.end):
            if word.kind == "list":
                yield from listed(self.text, word.start, word.end)
            elif word.kind == "number":
                yield word.start if begins < 0 else begins, word.end, factor * number(word.text)
            if word.text in ("+", "-"):
                begins = word.start if begins < 0 else begins
                factor *= -1.0 if word.text == "-" else 1.0
            else:
                begins, factor = -1, 1.0


def _values(own: str) -> tuple[float | tuple[float, ...], ...]:
    if not _BEGINS_NESTED.match(own):
        return tuple(map(float, own[1:-1].split(",")))
    *lists, _, _ = own.split("]")
    return tuple(tuple(map(float, one.rpartition("[")[2].split(","))) for one in lists)


# What declarations and routines begin with.


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class DataDeclaration:
    """Declares data; its text ends behind the semicolon."""

    start: int
    end: int
    storage: str
    """``const``, ``pers`` or ``var``."""
    local: bool
    type: Token
    name: Token
    dimensions: int = 0
    """Of an array; none of other data."""
    sizes_at: int = 0
    """First character of what says how many elements it has."""
    value_at: int = 0
    """First character of its value; 0 where it has none."""
    literal: Lit | None = None
    """Its value, if that says itself all of it."""


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class RoutineParameter:
    """Parameter of a routine."""

    name: Token
    type: str
    """In lower case."""
    optional: bool
    changed: bool
    """The routine may assign to it."""


@dataclass(frozen=True, kw_only=True, slots=True)
class SyntaxProblem:
    """Text that could not be understood."""

    position: int
    text: str

    def trouble(self, source: Source) -> str:
        """The same with its line."""
        return f"line {source.place(self.position).line}: {self.text}"


class NotRead(NamedTuple):
    """Text that is not understood."""

    start: int
    end: int
    problem: SyntaxProblem


@dataclass(eq=False, kw_only=True, slots=True)
class RoutineText:
    """Text of a procedure, function or trap."""

    start: int
    end: int = 0
    name: Token
    kind: str
    """``proc``, ``func`` or ``trap``."""
    local: bool
    parameters: Sequence[RoutineParameter]
    passed: Sequence[DataDeclaration | NotRead]
    """What is declared among its statements."""
    body_at: int
    """Behind its head: its statements are read when all names are known."""


@dataclass(eq=False, kw_only=True, slots=True)
class ModuleText:
    """A module."""

    start: int
    end: int = 0
    name: Token
    declarations: list[DataDeclaration] = field(default_factory=list[DataDeclaration])
    records: dict[str, tuple[tuple[str, str], ...]] = field(default_factory=dict[str, tuple[tuple[str, str], ...]])
    """Types with their components, name and type of each, in lower case."""
    routines: list[RoutineText] = field(default_factory=list[RoutineText])
    unread: list[NotRead] = field(default_factory=list[NotRead])
    """Text between declarations and routines that is neither."""
