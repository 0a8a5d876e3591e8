"""What a RAPID module consists of: declarations, routines, statements and expressions with their places in the text."""

import re
import sys
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import Literal, NamedTuple, cast

from robot_programs.core.flow import Block, lines_in
from robot_programs.core.source import Source

# The words of a RAPID module: names, numbers, strings and symbols, each with its place in the text.

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
# a target that is written out: lists of numbers in one, each tried in one way only
_NESTED = re.compile(rf"\[ \s* (?>{_LIST.pattern}) \s* (?: , \s* (?>{_LIST.pattern}) \s* ){{0,9}} \]", re.VERBOSE)
LISTED = re.compile(r"[^\s\[\],]+(?: \s+ [^\s\[\],]+)?", re.VERBOSE)
"""A number in such a list, whose sign may stand apart."""
_BEGINS_NESTED = re.compile(r"\[\s*\[")

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
        """Position after its last character."""
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
        if match.lastgroup == "name":
            yield named(match[0], match.start())
        elif match.lastgroup != "blank":
            yield Token(cast("Kind", match.lastgroup), match[0], match[0], match.start())


def named(word: str, start: int) -> Token:
    """A name. The same come again and again; what is kept of the text has each once."""
    return Token("name", sys.intern(word), sys.intern(word.lower()), start)


def list_end(text: str, start: int) -> int:
    """End of the list of decimal numbers, or of lists of these, that begins somewhere; 0 where none does, or a long one."""
    found = (_NESTED if _BEGINS_NESTED.match(text, start) else _LIST).match(text, start)
    return found.end() if found else 0


def listed(text: str, start: int, end: int) -> Iterator[tuple[int, int, float]]:
    """First character, end and value of each number of such a list."""
    for found in LISTED.finditer(text, start, end):
        yield found.start(), found.end(), float("".join(found[0].split()))  # a sign may stand apart


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


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class Node:
    """A part of the text."""

    start: int
    """First character."""
    end: int
    """Behind the last one."""


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class Number(Node):
    """A number with its sign."""

    value: float


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class Constant(Node):
    """A string, or TRUE or FALSE."""

    value: str | bool


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class Aggregate(Node):
    """Values in square brackets: a record or an array."""

    content: "tuple[Expression, ...] | str"
    """The values; the text of the file where they are a few numbers or lists of these, most of a program, which are read again."""

    @property
    def is_literal(self) -> bool:
        """Whether it is known to hold nothing but numbers, itself or in lists."""
        return isinstance(self.content, str)

    @property
    def is_plain(self) -> bool:
        """Whether it is known to hold nothing but numbers itself."""
        return isinstance(self.content, str) and not _BEGINS_NESTED.match(self.content, self.start)

    @property
    def numbers(self) -> tuple[float, ...]:
        """Numbers of a plain aggregate."""
        if not isinstance(self.content, str):
            return ()
        try:
            return tuple(map(float, self.content[self.start + 1 : self.end - 1].split(",")))
        except ValueError:  # a sign stands apart from its number
            return tuple(value for _, _, value in self._listed())

    @property
    def count(self) -> int:
        """How many numbers a plain aggregate has."""
        return self.content.count(",", self.start, self.end) + 1 if isinstance(self.content, str) else 0

    @property
    def values(self) -> "tuple[float | tuple[float, ...], ...]":
        """Numbers of a literal one, those of its lists together."""
        if self.is_plain or not isinstance(self.content, str):
            return self.numbers
        *lists, _, _ = self.content[self.start : self.end].split("]")
        try:
            return tuple(tuple(map(float, one.rpartition("[")[2].split(","))) for one in lists)
        except ValueError:  # a sign stands apart from its number
            return tuple(one.numbers for one in self._lists())

    @property
    def items(self) -> tuple["Expression", ...]:
        """The values; those of a literal one are other objects each time."""
        if not isinstance(self.content, str):
            return self.content
        if not self.is_plain:
            return tuple(self._lists())
        return tuple(Number(start=start, end=end, value=value) for start, end, value in self._listed())

    def _listed(self) -> Iterator[tuple[int, int, float]]:
        return listed(self.content, self.start, self.end) if isinstance(self.content, str) else iter(())

    def _lists(self) -> "Iterator[Aggregate]":
        text = self.content if isinstance(self.content, str) else ""
        for found in _LIST.finditer(text, self.start + 1, self.end):
            yield Aggregate(start=found.start(), end=found.end(), content=text)


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class Component:
    """Selects a component of a record: ``.trans``."""

    key: str


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class Index:
    """Selects an element of an array: ``{3}`` or ``{1,2}``."""

    items: tuple["Expression", ...]


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class Reference(Node):
    """A name, possibly with components and indices."""

    name: Token
    selectors: tuple[Component | Index, ...]


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class Argument(Node):
    """An argument of an instruction or a function."""

    option: str
    r"""Name of an optional one, as in ``\WObj:=w``, in lower case; empty for a required one."""
    value: "Expression | None"
    """None for a switch."""
    conditional: bool = False
    r"""It is passed on where the routine itself got it: ``\WObj?w``."""


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class Call(Node):
    """The value of a function."""

    name: Token
    arguments: tuple[Argument, ...]


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class Operation(Node):
    """An operator with one or two operands."""

    operator: str
    operands: tuple["Expression", ...]


Expression = Number | Constant | Aggregate | Reference | Call | Operation


def parts(node: Expression) -> Iterator[Expression]:
    """An expression and all that stand in it."""
    yield node
    for part in inside(node):
        yield from parts(part)


def inside(node: Expression) -> tuple[Expression, ...]:
    """The expressions that stand right in one; none of a list of nothing but numbers."""
    match node:
        case Aggregate() if not node.is_literal:
            return node.items
        case Operation():
            return node.operands
        case Call():
            return tuple(argument.value for argument in node.arguments if argument.value is not None)
        case Reference():
            return tuple(item for selector in node.selectors if isinstance(selector, Index) for item in selector.items)
        case _:
            return ()


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class Declaration(Node):
    """Declares data; its text ends behind the semicolon."""

    storage: str
    """``const``, ``pers`` or ``var``."""
    local: bool
    type: Token
    name: Token
    dimensions: tuple[Expression, ...]
    """Of an array; none of other data."""
    value: Expression | None


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class Parameter:
    """Parameter of a routine."""

    name: Token
    type: str
    optional: bool
    changed: bool
    """The routine may assign to it."""


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class Record:
    """A type with components."""

    name: Token
    components: tuple[tuple[str, str], ...]
    """Name and type of each, in lower case."""


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class Tail:
    """What motions have behind their targets, names alone: that of most lines is alike, and is read once."""

    arguments: tuple[Argument, ...]
    """As if the text began with them."""
    options: frozenset[str]
    """Names of the optional ones."""


def moved(arguments: Iterable[Argument], by: int) -> tuple[Argument, ...]:
    """Arguments that are names, as they are so many characters further on."""
    out: list[Argument] = []
    for given in arguments:
        value = given.value
        if isinstance(value, Reference):
            name = value.name._replace(start=value.name.start + by)
            value = Reference(start=name.start, end=name.end, name=name, selectors=())
        out.append(Argument(start=given.start + by, end=given.end + by, option=given.option, value=value))
    return tuple(out)


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class Instruction(Node):
    """Calls an instruction or a procedure; its text ends behind the semicolon."""

    name: Token
    first: tuple[Argument, ...]
    """Arguments in front of the tail, none of them optional; all where there is none."""
    tail: Tail | None = None
    compact: bool = False
    """It is all that an IF without THEN governs."""
    plain: bool = False
    """It is known to be given names and lists of numbers alone."""
    _arguments: tuple[Argument, ...] | None = field(init=False, default=None)

    def __repr__(self) -> str:
        own = ("start", "end", "name", "arguments", "compact", "plain")
        return f"Instruction({', '.join(f'{name}={getattr(self, name)!r}' for name in own)})"

    @property
    def arguments(self) -> tuple[Argument, ...]:
        """All arguments, the same objects each time."""
        if self.tail is None:
            return self.first
        if self._arguments is None:
            object.__setattr__(self, "_arguments", (*self.first, *moved(self.tail.arguments, self.first[-1].end)))
        return self._arguments or ()

    @property
    def options(self) -> frozenset[str]:
        """Names of the optional arguments."""
        if self.tail is not None:
            return self.tail.options
        return frozenset([argument.option for argument in self.first if argument.option])


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class Assignment(Node):
    """Gives a variable a value."""

    target: Reference
    value: Expression


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class Control(Node):
    """What steers where control goes on, with all that it governs: IF, TEST, FOR, WHILE, RETURN, GOTO, RAISE and the like."""

    conditions: tuple[Expression, ...]
    """What it reads: conditions, bounds, or what is returned."""
    counter: Token | None = None
    """Variable that a FOR declares."""


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class Label(Node):
    """Label of a GOTO."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Problem:
    """Text that could not be understood."""

    position: int
    text: str


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class Unparsed(Node):
    """Text that is not a statement."""

    tokens: tuple[Token, ...]
    problem: Problem
    """Why it is not understood."""

    def trouble(self, source: Source) -> str:
        """The problem with its line."""
        return f"line {source.place(self.problem.position).line}: {self.problem.text}"


Line = Instruction | Assignment | Control | Label | Unparsed
"""A statement without those that stand in it; `flow` has the form in which they do."""


def expressions_of(line: Line) -> tuple[Expression, ...]:
    """The expressions of a statement itself."""
    match line:
        case Instruction():
            return tuple(argument.value for argument in line.arguments if argument.value is not None)
        case Assignment():
            return (line.target, line.value)
        case Control():
            return line.conditions
        case _:
            return ()


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class Routine(Node):
    """A procedure, function or trap."""

    name: Token
    kind: str
    """``proc``, ``func`` or ``trap``."""
    local: bool
    parameters: tuple[Parameter, ...]
    declarations: tuple[Declaration, ...]
    body: Block
    handlers: tuple[Block, ...]
    """What ERROR, UNDO and BACKWARD lead to."""

    @property
    def nodes(self) -> Block:
        """Statements of the body and of all handlers."""
        return (*self.body, *(node for handler in self.handlers for node in handler))

    @property
    def lines(self) -> Iterator[Line]:
        """The same with all that stand in them."""
        return lines_in(self.nodes)


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class Module(Node):
    """A module."""

    name: Token
    declarations: tuple[Declaration, ...]
    records: tuple[Record, ...]
    routines: tuple[Routine, ...]
    unparsed: tuple[Unparsed, ...]
    """Text between declarations and routines that is neither."""


# The words of a module as they are read: one after the other, so that a file's words are never all in memory.

MAX_WORDS = 2_000_000
"""Of one statement or declaration; an array of a hundred thousand targets, each of lists of numbers, has fewer."""


MAX_VALUES = 5_000_000
"""Values of a file, those in lists included: numbers in a list of nothing else count as one."""


class TooMuch(Exception):
    """A file holds more of something than any program, and would take gigabytes."""

    def __init__(self, position: int, text: str):
        self.position, self.text = position, text
        super().__init__(text)


class Words:
    """Words that are read one after the other."""

    def __init__(self, text: str):
        self.text = text
        self._coming = tokenize(text)
        self._later: Token | None = None
        """The word behind the next one, where it was looked at."""
        self.next = next(self._coming)
        """The word that is to be read next."""
        self.end = 0
        """Behind the word read last."""
        self._left = MAX_WORDS
        """Words that may still be read before another statement begins."""
        self._begun = 0
        """Where the last one began."""
        self._values = MAX_VALUES
        """Values that may still be read."""

    def begin(self) -> None:
        """Note that a statement or a declaration begins at the next word."""
        self._left, self._begun = MAX_WORDS, self.next.start

    def take(self) -> Token:
        """Read a word.

        Raises:
            TooMuch: the statement has more words than any.
        """
        token = self.next
        if token.kind == "end":
            return token
        if not self._left:
            raise TooMuch(
                self._begun,
                f"has more than {MAX_WORDS:,} words in the statement that begins here; divide it into several",
            )
        self._left -= 1
        self.end = token.start + len(token.text)
        if self._later is None:
            self.next = next(self._coming)
        else:
            self.next, self._later = self._later, None
        return token

    def jump(self, end: int) -> None:
        """Go on behind some text, of which no word but the next one has been looked at."""
        self.end, self._coming = end, words_from(self.text, end)
        self.next = next(self._coming)

    @property
    def looked_ahead(self) -> bool:
        """Whether the word behind the next one has been looked at."""
        return self._later is not None

    def count_values(self, count: int = 1) -> None:
        """Count values.

        Raises:
            TooMuch: there are more than in any program.
        """
        if self._values < count:
            raise TooMuch(self.next.start, f"has more than {MAX_VALUES:,} values; divide it into several files")
        self._values -= count

    def behind_next(self) -> Token:
        """The word behind the next one, of which there has to be one."""
        if self._later is None:
            self._later = next(self._coming)
        return self._later
