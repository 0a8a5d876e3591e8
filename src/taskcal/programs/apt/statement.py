"""Statements of APT with the place of every word and number."""

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass

_SEPARATORS = "/,()="
_TOKEN = re.compile(r"[/,()=]|[^/,()=]+")
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?")
_LARGEST = 1e9

_LITERAL = ("PARTNO", "PPRINT", "INSERT", "LETTER", "REMARK")
"""Words whose line is text."""

_CARD = 72
"""Columns of a card that hold the statement; behind them CATIA numbers its points: PT 5, CIR 1."""
_CARD_NUMBER = re.compile(r"(PT|CIR)\s+\d+\s*")


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


@dataclass(frozen=True, kw_only=True)
class Statement:
    """A statement, possibly over several lines; or a comment."""

    word: str
    """Its first word in capitals, ``$$`` of a comment."""
    text: str
    """Of a comment or a line of text: what follows the word."""
    tokens: tuple[Token, ...]
    """From the first word on; empty for a comment or a line of text."""
    start: int
    end: int

    @property
    def arguments(self) -> tuple[Token, ...] | None:
        """What stands between commas behind the slash; None where it is not so simple."""
        behind = self.tokens[2:]
        if len(self.tokens) < 2 or self.tokens[1].text != "/":
            return () if len(self.tokens) == 1 else None
        if len(behind) % 2 == 0 or any((t.text == ",") != (i % 2 == 1) for i, t in enumerate(behind)):
            return None
        given = behind[::2]
        return None if any(t.text in _SEPARATORS for t in given) else given

    @property
    def words(self) -> tuple[str, ...]:
        """The arguments in capitals; none where they are not simple."""
        return tuple(token.text.upper() for token in self.arguments or ())

    @property
    def numbers(self) -> tuple[float, ...] | None:
        """The arguments, where all are numbers."""
        return numbers(self.arguments or ())


def numbers(tokens: tuple[Token, ...]) -> tuple[float, ...] | None:
    """Values of tokens, where all are numbers."""
    values = [token.number for token in tokens]
    known = tuple(value for value in values if value is not None)
    return known if len(known) == len(values) else None


def statements(text: str) -> Iterator[Statement]:
    """The statements of a text; those that a dollar sign continues are one."""
    tokens: list[Token] = []
    for start, end in _lines(text):
        line = text[start:end]
        if not tokens:
            stripped = line.lstrip()
            word = stripped[:6].upper()
            at = start + len(line) - len(stripped)
            if stripped.startswith("$$"):
                yield Statement(word="$$", text=stripped[2:], tokens=(), start=at, end=end)
                continue
            if word in _LITERAL:
                yield Statement(word=word, text=stripped[6:], tokens=(), start=at, end=end)
                continue
        if len(line) > _CARD and _CARD_NUMBER.fullmatch(line, _CARD):
            end = start + _CARD
        comment = text.find("$$", start, end)
        dollar = text.find("$", start, end)
        tokens += _tokens(text, start, dollar if dollar >= 0 else end)
        if tokens and (dollar < 0 or dollar == comment):
            yield _statement(tokens)
            tokens = []
    if tokens:
        yield _statement(tokens)


def _statement(tokens: list[Token]) -> Statement:
    if len(tokens) > 2 and tokens[1].text == ")":  # a label
        tokens = tokens[2:]
    word = " ".join(tokens[0].text.upper().split())
    return Statement(word=word, text="", tokens=tuple(tokens), start=tokens[0].start, end=tokens[-1].end)


def _lines(text: str) -> Iterator[tuple[int, int]]:
    """First character of each line, and behind its last one."""
    start = 1 if text.startswith("\ufeff") else 0
    while start < len(text):
        end = text.find("\n", start)
        end = len(text) if end < 0 else end
        yield start, end - 1 if end > start and text[end - 1] == "\r" else end
        start = end + 1


def _tokens(text: str, start: int, end: int) -> list[Token]:
    out: list[Token] = []
    for match in _TOKEN.finditer(text, start, end):
        word = match[0].strip()
        if word:
            begin = match.start() + match[0].index(word)
            out.append(Token(text=word, start=begin, end=begin + len(word)))
    return out
