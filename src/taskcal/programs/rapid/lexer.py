"""The words of a RAPID module: names, numbers, strings and symbols, each with its place in the text."""

import re
import sys
from collections.abc import Iterator
from typing import Literal, NamedTuple

Kind = Literal["name", "number", "text", "symbol", "end"]

# Every alternative begins with characters that no other begins with, so the time to read a file grows with its length.
_WORD = re.compile(
    r"""
      (?P<blank>   [\s\ufeff]+ | ![^\n]* )
    | (?P<name>    [^\W\d]\w* )
    | (?P<number>  0[xX][0-9A-Fa-f]+ | 0[bB][01]+ | 0[oO][0-7]+ | (?: [0-9]+ (?:\.[0-9]*)? | \.[0-9]+ ) (?:[eE][+-]?[0-9]+)? )
    | (?P<text>    "(?: [^"\n] | "" )* "? )
    | (?P<symbol>  := | <> | <= | >= | . )
    """,
    re.VERBOSE | re.DOTALL,
)

_NUMBER = r"(?: [0-9]+ (?:\.[0-9]*)? | \.[0-9]+ ) (?:[eE][+-]?[0-9]+)?"
_SIGNED = rf"(?: [+-] \s* )? {_NUMBER}"
# bounded, as what is repeated is kept by the search until the list ends
_LIST = re.compile(rf"\[ \s* {_SIGNED} \s* (?: , \s* {_SIGNED} \s* ){{0,99}} \]", re.VERBOSE)
_IN_LIST = re.compile(rf"(?: ([+-]) \s* )? ({_NUMBER})", re.VERBOSE)

HEADER = "%%%"
"""Encloses what a controller writes in front of a module: version and language."""


class Token(NamedTuple):
    """A word of the text."""

    kind: Kind
    text: str
    key: str
    """The text by which it is compared: letter case does not matter in RAPID."""
    start: int

    @property
    def end(self) -> int:
        """Behind its last character."""
        return self.start + len(self.text)


def tokenize(text: str) -> Iterator[Token]:
    """The words of a module's text without white space, comments and header; the last one is of kind ``end``."""
    yield from words_from(text, _behind_header(text))


def words_from(text: str, start: int) -> Iterator[Token]:
    """The same from the start of a word on."""
    yield from words(text, start, len(text))
    yield Token("end", "", "", len(text))


def words(text: str, start: int, end: int) -> Iterator[Token]:
    """The words between the start of one and the end of the same or a later one, in a module's text."""
    for match in _WORD.finditer(text, start, end):
        word = match[0]
        match match.lastgroup:
            case "blank":
                pass
            case "name":
                # the same names come again and again; what is kept of the text names each once
                yield Token("name", sys.intern(word), sys.intern(word.lower()), match.start())
            case "number":
                yield Token("number", word, word, match.start())
            case "text":
                yield Token("text", word, word, match.start())
            case _:
                yield Token("symbol", word, word, match.start())


def list_end(text: str, start: int) -> int:
    """Behind the list of decimal numbers and nothing else that begins somewhere; 0 where none does, or a long one."""
    found = _LIST.match(text, start)
    return found.end() if found else 0


def listed(text: str, start: int, end: int) -> Iterator[tuple[int, int, float]]:
    """First character, end and value of each number of such a list."""
    for found in _IN_LIST.finditer(text, start, end):
        value = float(found[2])
        yield found.start(), found.end(), -value if found[1] == "-" else value


def number(token: Token) -> float:
    """The value of a number."""
    bases = {"0x": 16, "0b": 2, "0o": 8}
    base = bases.get(token.text[:2].lower())
    # a float takes any length of digits, an integer of a foreign base does so too
    return float(token.text) if base is None else float(min(int(token.text[2:], base), 2**64))


def _behind_header(text: str) -> int:
    start = len(text) - len(text.lstrip("\ufeff \t\r\n"))
    if not text.startswith(HEADER, start):
        return 0
    end = text.find(HEADER, start + len(HEADER))
    return 0 if end < 0 else end + len(HEADER)
