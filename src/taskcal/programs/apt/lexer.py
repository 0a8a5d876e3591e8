"""Words, numbers and separators of APT, with their places."""

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass

SEPARATORS = "/,()="
_TOKEN = re.compile(r"[/,()=]|[^/,()=]+")
_NUMBER = re.compile(r"[+-]?(\d+(?:\.\d*)?|\.\d+)([eE][+-]?\d+)?")
_LARGEST = 1e9


@dataclass(frozen=True, kw_only=True)
class Token:
    """A word, a number or a separator."""

    text: str
    start: int
    end: int

    @property
    def number(self) -> float | None:
        """Its value; None where it is not a number, or a larger one than any path has."""
        if not _NUMBER.fullmatch(self.text):
            return None
        value = float(self.text)
        return value if math.isfinite(value) and abs(value) <= _LARGEST else None


def tokenize(text: str, start: int, end: int) -> list[Token]:
    """The tokens between two places of a text."""
    tokens: list[Token] = []
    for match in _TOKEN.finditer(text, start, end):
        word = match[0].strip()
        if word:
            begin = match.start() + match[0].index(word)
            tokens.append(Token(text=word, start=begin, end=begin + len(word)))
    return tokens


def lines_of(text: str) -> Iterator[tuple[int, int]]:
    """First character of each line, and behind its last one."""
    start = 1 if text.startswith("\ufeff") else 0
    while start < len(text):
        end = text.find("\n", start)
        end = len(text) if end < 0 else end
        yield start, end - 1 if end > start and text[end - 1] == "\r" else end
        start = end + 1
