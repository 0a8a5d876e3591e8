"""The text of a program file, which keeps every byte that is not edited on purpose."""

import gc
import re
from array import array
from bisect import bisect_right
from collections.abc import Generator, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

from taskcal_groundwork.errors import FileError, shortened
from taskcal_groundwork.files import read_bytes

MAX_LINE_LENGTH = 1_000_000
"""Characters; controllers take some hundreds, what is generated has some thousands."""

MAX_LINES = 3_000_000
"""A milling program of a million points has a line or two for each."""


@dataclass(frozen=True, kw_only=True, slots=True)
class TextEdit:
    """Characters to be replaced."""

    start: int
    """First character, counted from 0."""
    end: int
    """Behind the last one; equal to `start` for an insertion."""
    text: str


@dataclass(frozen=True, kw_only=True, slots=True)
class Place:
    """Place in a file."""

    path: Path
    line: int
    """Counted from 1."""

    def __str__(self) -> str:
        return f"{self.path}:{self.line}"


@dataclass(frozen=True, kw_only=True)
class Source:
    """A program file as text."""

    path: Path
    text: str
    """Line ends as in the file."""
    encoding: str
    """``utf-8``, or ``latin-1`` where the file is not UTF-8: either gives every byte back."""
    lines: tuple[int, ...] | None = None
    """Of a text that was made of the file's, for each line the one of the file that it comes from; None for the file's own."""

    def __repr__(self) -> str:
        return f"Source({shortened(str(self.path), 120)}: {len(self.text)} characters, {self.encoding})"

    @classmethod
    def of(cls, path: Path, data: bytes) -> "Source":
        """Decode the bytes of a file.

        Raises:
            FileError: a line is longer than any of a program, or there are more lines.
        """
        try:
            source = cls(path=path, text=data.decode("utf-8"), encoding="utf-8")
        except UnicodeDecodeError:
            source = cls(path=path, text=data.decode("latin-1"), encoding="latin-1")
        source._expect_lines()
        return source

    def _expect_lines(self) -> None:
        """Refuse what has no lines, or too many: its words would take gigabytes before any of them is found wrong."""
        first, text = 0, self.text
        lines = text.count("\n")
        if lines > MAX_LINES:
            raise FileError(self.path, f"has {lines:,} lines, more than {MAX_LINES:,}; divide it into several files")
        while len(text) - first > MAX_LINE_LENGTH:
            end = max(text.rfind(mark, first, first + MAX_LINE_LENGTH + 1) for mark in "\n\r")
            if end < 0:
                message = f"has more than {MAX_LINE_LENGTH:,} characters in one line, as no program has; export it line by line"
                raise FileError(self.path, message, line=text.count("\n", 0, first) + 1)
            first = end + 1

    def encode(self) -> bytes:
        """The bytes of the file."""
        return self.text.encode(self.encoding)

    @cached_property
    def newline(self) -> str:
        """Line end of the file."""
        return "\r\n" if "\r\n" in self.text else "\n"

    @cached_property
    def _starts(self) -> "array[int]":
        return array("Q", [0]) + array("Q", (match.end() for match in re.finditer("\n", self.text)))

    def line(self, position: int) -> int:
        """Line of a character in the file, counted from 1."""
        own = bisect_right(self._starts, position)
        return own if self.lines is None else self.lines[own - 1]

    def start(self, line: int) -> int:
        """First character of a line of the file, counted from 1; of one that stands for it, where it is written several times."""
        return self._starts[line - 1 if self.lines is None else self.lines.index(line)]

    def place(self, position: int) -> Place:
        """Place of a character."""
        return Place(path=self.path, line=self.line(position))

    def indent(self, position: int) -> str:
        """White space at the start of a character's line."""
        start = self._starts[bisect_right(self._starts, position) - 1]
        end = start
        while end < len(self.text) and self.text[end] in " \t":
            end += 1
        return self.text[start:end]

    def edited(self, edits: Iterable[TextEdit]) -> "Source":
        """The source with characters replaced; insertions at one place come in the order given.

        Raises:
            ValueError: two edits overlap.
        """
        return replace(self, text=self.piece(0, len(self.text), edits), lines=None)

    def piece(self, start: int, end: int, edits: Iterable[TextEdit]) -> str:
        """A piece of the text with edits that lie in it; see `edited`."""
        parts: list[str] = []
        for edit in sorted(edits, key=lambda edit: (edit.start, edit.end)):
            if edit.start < start:
                raise ValueError(f"edits of {self.path} overlap in line {self.line(edit.start)}")
            parts += [self.text[start : edit.start], edit.text]
            start = edit.end
        return "".join([*parts, self.text[start:end]])


@dataclass(frozen=True, kw_only=True)
class Backup:
    """A folder or a zip file in which a program was found."""

    path: Path
    skipped: int
    """Files in it that are no program."""


def read_source(path: str | Path) -> Source:
    """Read a program file.

    Raises:
        FileError: it is missing, cannot be read, or is too large.
    """
    path = Path(path)
    return Source.of(path, read_bytes(path))


def lines_of(text: str, start: int = 0, end: int | None = None) -> Iterator[tuple[int, int]]:
    """First character of each line of a text or a part of it, and behind its last one, before the line end."""
    end = len(text) if end is None else end
    while start < end:
        newline = text.find("\n", start, end)
        last = end if newline < 0 else newline
        yield start, last - 1 if last > start and text[last - 1] == "\r" else last
        start = last + 1


@contextmanager
def uncollected() -> Generator[None]:
    """Read without the collector of reference cycles: all that is read is kept, and it would go through that again and again."""
    collected = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if collected:
            gc.enable()


# Numbers in the text of a program: a new value in the digits of the old one.

MAX_DECIMALS = 12
"""No program states more."""


def renumbered(text: str, was: float, value: float, decimals: int) -> str:
    """Text for a value that may have changed.

    Args:
        text: how the number is written.
        was: what is meant by it.
        value: what is to be meant.
        decimals: decimals that matter; as many are written, or more where the text has more.

    Returns:
        The text itself where the value is the same to that many decimals.
    """
    if abs(value - was) <= 0.5 * 10.0**-decimals:
        return text
    return numeral(value, max(decimals, min(_decimals(text), MAX_DECIMALS)))


def numeral(value: float, decimals: int) -> str:
    """A number with so many decimals, without a minus before zero."""
    return f"{round(value, decimals) + 0.0:.{decimals}f}"


def _decimals(text: str) -> int:
    behind = text.partition(".")[2]
    return len(behind) - len(behind.lstrip("0123456789"))


# Names for new data of a program, which nothing in it has yet.


class FreshNames:
    """Names that no word of a program's files has, letter case aside."""

    def __init__(self, words: Iterable[str], *, longest: int, usual: int | None = None, reserved: Iterable[str] = ()):
        """Take note of the names in use.

        Args:
            words: all of the program's; read when the first name is asked for.
            longest: characters that a name may have.
            usual: characters that one may have where none of the words is longer.
            reserved: words of the language.
        """
        self._words, self._reserved = words, reserved
        self._longest, self._usual = longest, longest if usual is None else usual
        self._taken: set[str] | None = None

    def like(self, name: str) -> str:
        """A fresh name that begins like another one, numbered from 2 on."""
        taken = self._in_use()
        number = 2
        while True:
            ending = f"_{number}"
            candidate = name[: self._longest - len(ending)] + ending
            if candidate.lower() not in taken:
                taken.add(candidate.lower())
                return candidate
            number += 1

    def nearest(self, name: str) -> str:
        """The name itself where it is free, else a fresh one like it."""
        taken = self._in_use()
        if name.lower() in taken:
            return self.like(name)
        taken.add(name.lower())
        return name

    def _in_use(self) -> set[str]:
        if self._taken is None:
            words = {word.lower() for word in self._words}
            self._longest = min(self._longest, max(self._usual, *map(len, words), 0))
            self._taken = words | {word.lower() for word in self._reserved}
        return self._taken
