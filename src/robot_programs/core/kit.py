"""What reading languages has in common: words of a table, and a cursor that reads expressions of the one form from them."""

import re
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from typing import ClassVar, NamedTuple

from robot_programs.core.form import Expression, Hole, Lit, Op, Ref, Span
from robot_programs.core.program import Unresolved
from robot_programs.core.values import MAX_DEPTH


class Token(NamedTuple):
    """A word of a text."""

    kind: str
    """Its group in the language's table."""
    text: str
    start: int
    """Its first character in the file."""

    @property
    def end(self) -> int:
        """Behind its last character."""
        return self.start + len(self.text)

    @property
    def upper(self) -> str:
        """Its text in capitals."""
        return self.text.upper()


NO_WORD = Token("", "", 0)

OPENING, CLOSING = frozenset("([{"), frozenset(")]}")


def words(table: re.Pattern[str], text: str, at: int) -> Iterator[Token]:
    """Words of a text.

    Args:
        table: an expression that matches anywhere, with a group for each kind; what is of the kind ``space`` is left out.
        text: the text.
        at: place of its first character in the file.
    """
    for match in table.finditer(text):
        kind = match.lastgroup or ""
        if kind != "space":
            yield Token(kind, match[0], at + match.start())


def opens(word: Token) -> int:
    """How many brackets a word opens; negative where it closes one."""
    return (word.text in OPENING) - (word.text in CLOSING)


def parted(found: Sequence[Token], mark: str) -> Iterator[Sequence[Token]]:
    """Words between the marks of a kind that stand in no brackets."""
    depth, first = 0, 0
    for number, word in enumerate(found):
        depth += opens(word)
        if word.text == mark and not depth:
            yield found[first:number]
            first = number + 1
    yield found[first:]


class Words:
    """Words of a line from left to right, letter case aside."""

    def __init__(self, found: Sequence[Token]) -> None:
        """Start before the first of some words."""
        self.words, self.number = found, 0

    @property
    def next(self) -> Token:
        """The next word; one without text at the end."""
        return self.words[self.number] if self.number < len(self.words) else NO_WORD

    @property
    def behind_next(self) -> Token:
        """The word after that."""
        return self.words[self.number + 1] if self.number + 1 < len(self.words) else NO_WORD

    @property
    def done(self) -> bool:
        """Whether no word is left."""
        return self.number >= len(self.words)

    @property
    def place(self) -> int:
        """First character of the next word."""
        return self.next.start

    @property
    def end(self) -> int:
        """Behind the word read last."""
        return self.words[self.number - 1].end

    @property
    def sticks(self) -> bool:
        """Whether the next word stands right behind the one before, without a blank."""
        return not self.done and self.next.start == self.end

    def take(self) -> Token:
        """Read a word.

        Raises:
            Unresolved: none is left.
        """
        if self.done:
            raise self.problem("it ends too early")
        self.number += 1
        return self.words[self.number - 1]

    def at(self, *texts: str) -> bool:
        """Whether the next word is one of some, in capitals."""
        return self.next.text.upper() in texts

    def accept(self, *texts: str) -> bool:
        """Read the next word if it is one of some."""
        found = self.at(*texts)
        if found:
            self.take()
        return found

    def expect(self, text: str) -> None:
        """Read a word.

        Raises:
            Unresolved: it is not the next one.
        """
        if not self.accept(text):
            raise self.problem(f"'{text}' is missing")

    def taken_to(self, *stops: str) -> tuple[Token, ...]:
        """Read words up to one that stops, outside of any bracket; all that are left without one."""
        start, depth, end = self.number, 0, len(self.words)
        for number in range(start, end):
            word = self.words[number]
            if not depth and word.text.upper() in stops:
                end = number
                break
            depth += opens(word)
        self.number = end
        return tuple(self.words[start:end])

    def skip(self, opening: str, closing: str) -> None:
        """Read to behind the bracket that is open.

        Raises:
            Unresolved: it is not closed.
        """
        depth = 1
        while depth:
            if self.done:
                raise self.problem("a bracket is not closed")
            text = self.take().text
            depth += (text == opening) - (text == closing)

    def problem(self, what: str) -> Unresolved:
        """An error at the next word."""
        return Unresolved(what)


class Cursor(Words, ABC):
    """Words of a line, from which expressions are read.

    A language says by `BINDING` and `PREFIXES` how its operators bind, and by `single` what single values are.
    """

    BINDING: ClassVar[Mapping[str, int]]
    """Operators between two values; those with higher numbers bind tighter."""
    PREFIXES: ClassVar[Mapping[str, int]]
    """Operators in front of one."""
    SIGNS: ClassVar[Mapping[str, str]] = {}
    """Operators that the form calls otherwise."""

    depth = 0
    """Brackets and blocks that are open."""
    height = 0
    """Values inside values of the expression read last."""

    def __init__(self, found: Sequence[Token], file: int) -> None:
        """Start before the first of some words of a file, which is given by its number."""
        super().__init__(found)
        self.file = file

    @property
    def sign(self) -> str:
        """The next word as an operator; anything else is none."""
        return self.next.upper

    @abstractmethod
    def single(self) -> Expression:
        """Read a value in which no operator is outside of brackets; sets `height`."""

    def enter(self) -> None:
        """Count a bracket or block that opens."""
        self.depth += 1
        if self.depth > MAX_DEPTH:
            raise self.problem(f"brackets or blocks are nested deeper than {MAX_DEPTH} at")

    def grow(self, height: int) -> None:
        """Note that the expression read last contains others of some height."""
        self.height = height + 1
        if self.height > MAX_DEPTH:
            raise self.problem(f"an expression is nested deeper than {MAX_DEPTH} at")

    def expression(self, weakest: int = 0) -> Expression:
        """Read operands joined by operators that bind tighter than the weakest, the tightest first (precedence climbing)."""
        self.enter()
        try:
            return self._joined(weakest)
        finally:
            self.depth -= 1

    def _joined(self, weakest: int) -> Expression:
        start, sign = self.place, self.sign
        if self.PREFIXES.get(sign, -1) >= weakest:
            self.take()
            left = self.operation(start, sign, self.expression(self.PREFIXES[sign]))
            self.grow(self.height)
        else:
            left = self.single()
        height = self.height
        while self.BINDING.get(sign := self.sign, 0) > weakest:
            self.take()
            right = self._joined(self.BINDING[sign])
            left = self.operation(start, sign, left, right)
            self.grow(max(height, self.height))
            height = self.height
        return left

    def span(self, start: int) -> Span:
        """Place of what was read since a character."""
        return self.file, start, self.end

    def operation(self, start: int, sign: str, *operands: Expression) -> Expression:
        """What an operator makes of operands; a sign before a number belongs to it."""
        (first, *others) = operands
        if not others and sign in "+-" and isinstance(first, Lit) and type(first.value) is float:
            return Lit(at=self.span(start), value=-first.value if sign == "-" else first.value)
        return Op(at=self.span(start), sign=self.SIGNS.get(sign, sign.lower()), operands=operands)

    def whole(self) -> Expression:
        """The expression that all further words are; a hole where they are none."""
        start = self.place
        try:
            found = self.expression()
            if self.done:
                return found
            why = f"'{self.next.text}' is not evaluated"
        except Unresolved as reason:
            why = str(reason)
        self.number = len(self.words)
        return Hole(at=(self.file, start, self.words[-1].end if self.words else start), why=why)


def named(found: Sequence[Token], data: Mapping[str, Ref]) -> tuple[Ref, ...]:
    """Data that a line names which is not understood, so that it may change them.

    Args:
        found: its words.
        data: by the words that name them, in capitals.
    """
    return tuple({word.upper: data[word.upper] for word in found if word.upper in data}.values())
