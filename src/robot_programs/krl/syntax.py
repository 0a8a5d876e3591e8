"""What a line of KRL says, as far as it matters for where the robot goes."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from math import isfinite
from typing import NamedTuple

# The words of KRL, line by line; comments and file headers have none.

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


RELATIVE_MOTIONS = frozenset({"PTP_REL", "LIN_REL", "CIRC_REL", "SPTP_REL", "SLIN_REL", "SCIRC_REL"})
"""Motions by a distance."""

POINT_MOTIONS = frozenset({"PTP", "LIN", "CIRC", "SPTP", "SLIN", "SCIRC", "SPL", *RELATIVE_MOTIONS})
"""Motions to one point, or through one to another."""

OTHER_MOTIONS = frozenset({"SPL_REL"})
"""Motions that are not read."""

FRAMES_OF_DISTANCES = frozenset({"#BASE", "#TOOL"})
"""Behind a motion by a distance: along whose axes it is."""


class Field(NamedTuple):
    """A component of an aggregate, such as ``X 12.5``."""

    name: str
    """In capitals."""
    text: str
    """Its value as written."""
    value: float | None
    """None where it is not a number."""
    start: int
    """First character of the value."""
    end: int
    touches: bool
    """No blank stands before the value."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Aggregate:
    """Values in braces, such as ``{E6POS: X 12.5, Y 0}``."""

    type: str
    """As written before the colon, in capitals; empty without."""
    fields: tuple[Field, ...]
    start: int
    end: int

    def field(self, name: str) -> Field | None:
        """The component of that name."""
        for component in self.fields:
            if component.name == name:
                return component
        return None

    def value(self, name: str) -> float | None:
        """The number in a component; None where there is none."""
        component = self.field(name)
        return None if component is None else component.value


@dataclass(frozen=True, kw_only=True, slots=True)
class Reference:
    """A variable, or an element of an array."""

    name: str
    """In capitals, with its index: ``TOOL_DATA[3]``."""
    start: int
    end: int
    index: tuple[tuple[Word, ...], ...] = ()
    """Expressions of its index, where that is not a number."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Operand:
    """Aggregates and variables joined by the geometric operator; no parts where it is anything else."""

    parts: tuple[Aggregate | Reference, ...]
    start: int
    end: int


@dataclass(frozen=True, kw_only=True, slots=True)
class Statement:
    """A line of no consequence, and what all lines have."""

    start: int
    """First character."""
    end: int
    """Behind the last character, a comment not included."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Begin(Statement):
    """Start of a routine or data list."""

    name: str
    """In capitals."""
    parameters: tuple[str, ...] = ()
    """What the routine is given, in capitals."""
    by_value: tuple[bool, ...] = ()
    """Of each, whether it is given by value, so that the caller's own variable stays."""


@dataclass(frozen=True, kw_only=True, slots=True)
class End(Statement):
    """End of a routine or data list."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Declared:
    """A variable in a declaration."""

    name: str
    """In capitals; of an array without its size."""
    value: Operand | None
    """Where it starts with one."""
    start: int
    """First character of the name."""
    end: int


@dataclass(frozen=True, kw_only=True, slots=True)
class Declaration(Statement):
    """Variables of one type."""

    type: str
    shared: bool
    """Declared GLOBAL."""
    variables: tuple[Declared, ...]


@dataclass(frozen=True, kw_only=True, slots=True)
class Assignment(Statement):
    """A value for a variable."""

    name: str
    """Of what is assigned, in capitals, with index and components: ``$VEL.CP``, ``TOOL_DATA[1]``."""
    variable: str
    """The variable itself."""
    value: Operand
    text: str
    """The value as written, in capitals and without blanks."""
    changed: tuple[str, ...]
    """Variables passed to functions in its expressions."""
    index: tuple[Word, ...] | None
    """Of an element: what stands between the brackets."""
    component: str
    """Of a structure, in capitals; empty where all of it is assigned."""
    words: tuple[Word, ...]
    """The value."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Motion(Statement):
    """A motion instruction."""

    keyword: str
    """In capitals."""
    operands: tuple[Operand, ...]
    passing: tuple[str, ...]
    """Its words for passing by, such as ``C_DIS``."""
    settings: dict[str, tuple[Word, ...]] = field(default_factory=dict[str, tuple[Word, ...]])
    """What it sets for itself behind WITH."""
    along: str = ""
    """Of a motion by a distance: along whose axes, ``#BASE`` or ``#TOOL``; empty where it does not say."""
    trouble: str = ""
    """What is not understood of it; empty where all is."""
    words: tuple[Word, ...] = ()
    """What stands behind the keyword, if functions are called there."""

    def words_of(self, operand: Operand) -> tuple[Word, ...]:
        """The words of one of its points, if functions are called in the motion."""
        return tuple(word for word in self.words if operand.start <= word.start and word.end <= operand.end)


@dataclass(frozen=True, kw_only=True, slots=True)
class Call(Statement):
    """A call of a routine."""

    name: str
    """In capitals."""
    arguments: tuple[tuple[Word, ...], ...]

    @property
    def command(self) -> str:
        """The first argument, in capitals."""
        return "".join(word.upper for word in self.arguments[0])


@dataclass(frozen=True, kw_only=True, slots=True)
class Beside(Statement):
    """A line of an action that runs beside the lines after it: an interrupt, a TRIGGER or a cyclic analog signal."""

    keyword: str
    """INTERRUPT, TRIGGER, ANIN or ANOUT."""
    verb: str
    """DECL, ON or OFF; a TRIGGER is ON."""
    number: tuple[Word, ...]
    """Expression of the interrupt's number, empty for all; words of the analog signal."""
    shared: bool
    """Declared GLOBAL."""
    action: Statement | None = None
    """The call or the assignment of DECL, TRIGGER and ANIN ON."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Control(Statement):
    """A line that steers where the program goes on, by its first word; ``LABEL`` for a label."""

    keyword: str
    words: tuple[Word, ...] = ()
    """What stands behind it."""
    changed: tuple[str, ...] = ()
    """Variables passed to functions in its expressions."""


# The words of a line of KRL, taken one after the other: operands, structures and what WITH sets.

PASSING = {"C_PTP", "C_DIS", "C_VEL", "C_ORI", "C_SPL"}
QUOTES = ("'", '"')


class Cursor:
    """The words of a line, one after the other."""

    def __init__(self, words: Sequence[Word]):
        self._words = words
        self._next = 0

    @property
    def done(self) -> bool:
        """Whether all words are taken."""
        return self._next >= len(self._words)

    def at(self, text: str) -> bool:
        """Whether a symbol comes next."""
        return not self.done and self._words[self._next].text == text

    def at_name(self, names: set[str]) -> bool:
        """Whether one of some names comes next."""
        return not self.done and self._words[self._next].upper in names

    def at_kind(self, kind: str) -> bool:
        """Whether a word of a kind comes next."""
        return not self.done and self._words[self._next].kind == kind

    def take(self) -> Word:
        """The next word."""
        self._next += 1
        return self._words[self._next - 1]

    def accept(self, text: str) -> bool:
        """Take a symbol, if it comes next."""
        matches = self.at(text)
        self._next += matches
        return matches

    def skip_to(self, *stops: str) -> None:
        """Pass over words up to one that stops, outside of any bracket."""
        depth = 0
        while not self.done:
            word = self._words[self._next]
            if depth == 0 and word.upper in stops:
                return
            depth += (word.text in "([{") - (word.text in ")]}")
            self._next += 1

    def skip_brackets(self) -> None:
        """Pass over an index or a size."""
        if self.accept("["):
            self.skip_to("]")
            self.accept("]")

    def settings(self) -> dict[str, tuple[Word, ...]]:
        """Assignments behind WITH, by the name of what they set."""
        out: dict[str, tuple[Word, ...]] = {}
        while not self.done and not self.at_name(PASSING):
            start = self._next
            self.skip_to("=", *PASSING)
            name = "".join(word.upper for word in self._words[start : self._next])
            self.accept("=")
            start = self._next
            self.skip_to(",", *PASSING)
            out[name] = tuple(self._words[start : self._next])
            self.accept(",")
        return out

    def operand(self) -> Operand:
        """Aggregates and variables joined by colons; no parts where it is anything else."""
        if self.done:
            last = self._words[-1].end if self._words else 0
            return Operand(parts=(), start=last, end=last)
        start = self._next
        parts: list[Aggregate | Reference] = []
        known = True
        while True:
            part = self._part()
            if part is None:
                known = False
                break
            parts.append(part)
            if not self.accept(":"):
                break
        if not (self.done or self.at(",") or self.at_name({*PASSING, *FRAMES_OF_DISTANCES, "WITH"})):
            known = False
        if not known:
            self.skip_to(",", *PASSING, *FRAMES_OF_DISTANCES, "WITH")
        words = self._words[start : max(self._next, start + 1)]
        return Operand(parts=tuple(parts) if known else (), start=words[0].start, end=words[-1].end)

    def _part(self) -> Aggregate | Reference | None:
        if self.at("{"):
            return self._aggregate()
        if not self.at_kind("name") or self.at_name({*PASSING, "WITH"}):
            return None
        name = self.take()
        if not self.at("["):
            return Reference(name=name.upper, start=name.start, end=name.end)
        opening = self._next
        self.skip_brackets()
        words = self._words[opening : self._next]
        if words[-1].text != "]" or len(words) < 3 or self.at("."):
            return None
        plain = len(words) == 3 and words[1].kind == "number"
        return Reference(
            name=f"{name.upper}{''.join(word.upper for word in words)}",
            start=name.start,
            end=words[-1].end,
            index=() if plain else split_at_commas(words[1:-1]),
        )

    def _aggregate(self) -> Aggregate | None:
        opening = self.take()
        kind = ""
        if self.at_kind("name") and self._next + 1 < len(self._words) and self._words[self._next + 1].text == ":":
            kind = self.take().upper
            self.take()
        fields: dict[str, Field] = {}
        while not self.at("}"):
            field = self._field()
            if field is None or field.name in fields:
                return None
            fields[field.name] = field
            if not self.accept(",") and not self.at("}"):
                return None
        return Aggregate(type=kind, fields=tuple(fields.values()), start=opening.start, end=self.take().end)

    def _field(self) -> Field | None:
        if not self.at_kind("name"):
            return None
        name = self.take()
        self.skip_brackets()
        behind = self._words[self._next - 1].end
        start = self._next
        self.skip_to(",", "}")
        words = self._words[start : self._next]
        if (
            self.done or not words or any(word.text in QUOTES for word in words)
        ):  # a quote that is a word has no other end
            return None
        text = _joined(words)
        return Field(
            name=name.upper,
            text=text,
            value=_number(words),
            start=words[0].start,
            end=words[-1].end,
            touches=behind == words[0].start,
        )


def _joined(words: Sequence[Word]) -> str:
    """Words in a row, those that no symbol parts with a blank between them."""
    apart = ("symbol" not in (before.kind, word.kind) for before, word in pairwise(words))
    return words[0].text + "".join(f" {w.text}" if blank else w.text for blank, w in zip(apart, words[1:], strict=True))


def _number(words: Sequence[Word]) -> float | None:
    """A literal number with its sign, or a bit string such as ``'B1010'``."""
    last = words[-1]
    if len(words) == 1 and last.kind == "string":
        return bit_string(last.upper)
    if last.kind != "number" or len(words) > 2 or (len(words) == 2 and words[0].text not in {"+", "-"}):
        return None
    value = float(last.text) * (-1.0 if words[0].text == "-" else 1.0)
    return value if isfinite(value) else None


def split_at_commas(words: Sequence[Word]) -> tuple[tuple[Word, ...], ...]:
    """Words between commas that are in no bracket."""
    groups: list[list[Word]] = [[]]
    depth = 0
    for word in words:
        depth += (word.text in "([{") - (word.text in ")]}")
        if depth == 0 and word.text == ",":
            groups.append([])
        else:
            groups[-1].append(word)
    return tuple(tuple(group) for group in groups)
