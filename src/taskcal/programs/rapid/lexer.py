"""The words of a RAPID module: names, numbers, strings and symbols, each with its place in the text."""

import re
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
    for match in _WORD.finditer(text, _behind_header(text)):
        word = match[0]
        match match.lastgroup:
            case "blank":
                pass
            case "name":
                yield Token("name", word, word.lower(), match.start())
            case "number":
                yield Token("number", word, word, match.start())
            case "text":
                yield Token("text", word, word, match.start())
            case _:
                yield Token("symbol", word, word, match.start())
    yield Token("end", "", "", len(text))


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
