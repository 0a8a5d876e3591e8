"""The words of KRL, line by line; comments and file headers have none."""

import re
from collections.abc import Iterator
from typing import NamedTuple

# KRL is ASCII outside of comments and strings; whatever else occurs is one symbol, so that every text has words.
_WORD = re.compile(
    r"""
    (?P<blank>  [ \t\r\f\v\xa0\ufeff]+ | ;.* )
  | (?P<number> (?: [0-9]+ (?: \.[0-9]* )? | \.[0-9]+ ) (?: [Ee][+-]?[0-9]+ )? )
  | (?P<name>   [A-Za-z_$] [A-Za-z0-9_$]* )
  | (?P<enum>   \# [A-Za-z_] [A-Za-z0-9_]* )
  | (?P<string> "[^"]*" | '[^']*' )
  | (?P<symbol> == | <> | <= | >= | . )
    """,
    re.VERBOSE,
)


class Word(NamedTuple):
    """A number, name, enumeration constant, string or symbol."""

    kind: str
    text: str
    start: int
    """First character in the file's text."""
    end: int
    """Behind the last one."""

    @property
    def upper(self) -> str:
        """KRL does not tell capital from small letters."""
        return self.text.upper()


def lines_of_words(text: str) -> Iterator[list[Word]]:
    """The words of every line that has some."""
    start = 0
    while start < len(text):
        end = text.find("\n", start)
        end = len(text) if end < 0 else end
        words = _words(text, start, end)
        if words:
            yield words
        start = end + 1


def _words(text: str, start: int, end: int) -> list[Word]:
    if text.startswith("&", start):
        return []
    return [
        Word(match.lastgroup, match.group(), *match.span())
        for match in _WORD.finditer(text, start, end)
        if match.lastgroup and match.lastgroup != "blank"
    ]


def bit_string(text: str) -> float | None:
    """The number that a bit string such as ``'B1010'`` or ``'HFF'`` means, in capitals; None where it is none."""
    digits, base = text[2:-1], {"'B": 2, "'H": 16}.get(text[:2])
    if base is None or not digits or len(digits) > 32 or not set(digits) <= set("0123456789ABCDEF"[:base]):
        return None
    return float(int(digits, base))
