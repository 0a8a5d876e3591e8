"""The text of a URScript program: its statements, the expressions in them, and its functions as the nodes of `core.flow`.

Universal Robots, *Script manual, e-Series*: "The URScript programming language".
"""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal, NamedTuple

from robot_programs.core.errors import FileError, shown
from robot_programs.core.flow import Arm, Block, Body, Branches, Label, Leave, Loop, Node, Step, Unknown, lines_in
from robot_programs.core.source import Source

# Expressions, each with its place in the text: its first character, and behind its last one.


class Number(NamedTuple):
    """A number; whole ones are kept apart, because their quotients may be whole, too."""

    start: int
    end: int
    value: int | float


class Text(NamedTuple):
    """A string, without its quotation marks."""

    start: int
    end: int
    value: str


class Name(NamedTuple):
    """A variable, a constant, or a field of a structure."""

    start: int
    end: int
    name: str


class Listed(NamedTuple):
    """A list, or a pose."""

    start: int
    end: int
    items: "tuple[Expression, ...]"
    pose: bool


class Index(NamedTuple):
    """An element of a list or a pose."""

    start: int
    end: int
    of: "Expression"
    at: "Expression"


class Call(NamedTuple):
    """A call; arguments with the names that they are given by, empty where they stand in their order."""

    start: int
    end: int
    name: str
    arguments: "tuple[tuple[str, Expression], ...]"


class Operation(NamedTuple):
    """One or two operands and what is done with them."""

    start: int
    end: int
    operator: str
    operands: "tuple[Expression, ...]"


Expression = Number | Text | Name | Listed | Index | Call | Operation


def inside(expression: Expression) -> Iterator[Expression]:
    """An expression and all those in it, in their order."""
    waiting = [expression]
    while waiting:
        one = waiting.pop()
        yield one
        match one:
            case Listed():
                waiting += reversed(one.items)
            case Index():
                waiting += (one.at, one.of)
            case Call():
                waiting += (value for _, value in reversed(one.arguments))
            case Operation():
                waiting += reversed(one.operands)
            case _:
                pass


# Tokens.

_TOKEN = re.compile(
    r"""(?P<space>[ \t\r\f]+|\#[^\n]*|\$[^\n]*)
    |(?P<newline>\n)
    |(?P<number>0[xX][0-9a-fA-F]+|(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)
    |(?P<name>[A-Za-z_]\w*(?:\.[A-Za-z_]\w*)*)
    |(?P<text>"[^"\n]*"|'[^'\n]*')
    |(?P<mark>[=!<>]=|[-+*/%<>=()\[\],:{}?@])
    |(?P<other>.)""",
    re.VERBOSE,
)
"""Behind ``$`` stands the label of a line for PolyScope."""


class Token(NamedTuple):
    """A word of the text."""

    kind: str
    text: str
    start: int

    @property
    def end(self) -> int:
        """Behind its last character."""
        return self.start + len(self.text)


_OPENS = {"def", "thread", "sec", "if", "while"}
_HEADS = {*_OPENS, "elif", "else"}
_ALONE = {"end", "break", "continue", "halt"}
_WORDS = {*_HEADS, *_ALONE, "return", "global", "local", "run", "pass"}
"""With which a statement begins, whatever stood open before."""


def _lines(text: str) -> Iterator[list[Token]]:
    """Tokens of each statement; a header ends in its colon, and what stands in brackets goes on in the next line."""
    line: list[Token] = []
    depth = 0
    for match in _TOKEN.finditer(text):
        kind = match.lastgroup
        if kind == "space":
            continue
        token = Token(str(kind), match[0], match.start())
        if kind == "newline":
            if depth <= 0 and line:
                yield line
                line = []
            continue
        if line and (
            token.text == "end" or (depth > 0 and token.text in _HEADS | _ALONE)
        ):  # nothing that is open goes on here
            yield line
            line, depth = [], 0
        line.append(token)
        depth += (token.text in ("(", "[", "{")) - (token.text in (")", "]", "}"))
        if (token.text == ":" and depth <= 0 and line[0].text in _HEADS) or line[0].text == "end":
            yield line
            line, depth = [], 0
    if line:
        yield line


class _NotUnderstood(Exception):
    """Tokens that are no statement."""


MAX_DEPTH = 40
"""Brackets in each other, and blocks; no program has as many."""
MAX_TERMS = 200
"""Operators in one statement."""

_LEVELS = (("or", "xor"), ("and",), ("==", "!=", "<", ">", "<=", ">="), ("+", "-"), ("*", "/", "%"))
"""Operators from those that bind least."""
_BINDS = {operator: level for level, same in enumerate(_LEVELS) for operator in same}
COMPARED = 2
"""Level of comparisons, of which ``not`` takes one."""

FLAGS = {"True": True, "False": False}


class _Parser:
    """Reading the tokens of one statement."""

    def __init__(self, tokens: Sequence[Token]):
        self.tokens, self.at, self.depth, self.terms = tokens, 0, 0, 0

    @property
    def next(self) -> str:
        return self.tokens[self.at].text if self.at < len(self.tokens) else ""

    def take(self, text: str = "") -> Token:
        if self.at >= len(self.tokens) or (text and self.next != text):
            raise _NotUnderstood
        self.at += 1
        return self.tokens[self.at - 1]

    def begins(self, text: str) -> bool:
        """Whether a word comes next, which is taken then."""
        found = self.next == text
        self.at += found
        return found

    def another(self) -> Token:
        """What goes on with an expression."""
        self.terms += 1
        if self.terms > MAX_TERMS:
            raise _NotUnderstood
        return self.take()

    def name(self) -> str:
        token = self.take()
        if token.kind != "name" or token.text in _WORDS:
            raise _NotUnderstood
        return token.text

    def whole(self) -> Expression:
        """The expression that all that is left is."""
        found = self.expression()
        if self.at < len(self.tokens):
            raise _NotUnderstood
        return found

    def expression(self, least: int = 0) -> Expression:
        """An expression of operators that bind at least so much."""
        left = self.operand()
        while (bound := _BINDS.get(self.next, -1)) >= least:
            operator = self.another().text
            right = self.expression(bound + 1)
            left = Operation(left.start, right.end, operator, (left, right))
        return left

    def operand(self) -> Expression:
        self.depth += 1
        if self.depth > MAX_DEPTH:
            raise _NotUnderstood
        found = self.indexed()
        self.depth -= 1
        return found

    def indexed(self) -> Expression:
        token = self.take()
        found: Expression
        match token:
            case Token(text="-" | "+" | "not"):
                of = self.operand() if token.text != "not" else self.expression(COMPARED)
                return Operation(token.start, of.end, token.text, (of,))
            case Token(kind="number"):
                found = Number(token.start, token.end, _number(token.text))
            case Token(kind="text"):
                found = Text(token.start, token.end, token.text[1:-1])
            case Token(text="("):
                within = self.expression()
                found = Operation(token.start, self.take(")").end, "()", (within,))
            case Token(text="["):
                found = self.listed(token.start, pose=False)
            case Token(text="p") if self.next == "[" and self.tokens[self.at].start == token.end:
                self.take()
                found = self.listed(token.start, pose=True)
            case Token(kind="name") if token.text not in _WORDS:
                called = self.next == "("
                found = self.call(token) if called else Name(token.start, token.end, token.text)
            case _:
                raise _NotUnderstood
        while self.next == "[":
            self.another()
            index = self.expression()
            found = Index(found.start, self.take("]").end, found, index)
        return found

    def listed(self, start: int, *, pose: bool) -> Listed:
        items: list[Expression] = []
        while self.next != "]":
            items.append(self.expression())
            if self.next != "]":
                self.take(",")
        return Listed(start, self.take("]").end, tuple(items), pose)

    def call(self, name: Token) -> Call:
        self.take("(")
        arguments: list[tuple[str, Expression]] = []
        while self.next != ")":
            given = ""
            if self.at + 1 < len(self.tokens) and self.tokens[self.at + 1].text == "=":
                given = self.name()
                self.take("=")
            arguments.append((given, self.expression()))
            if self.next != ")":
                self.take(",")
        return Call(name.start, self.take(")").end, name.text, tuple(arguments))


def _number(text: str) -> int | float:
    if text[:2] in ("0x", "0X"):
        return int(text, 16)
    return int(text) if text.isdecimal() and len(text) < 16 else float(text)


# Statements.

Kind = Literal[
    "def", "thread", "sec", "if", "elif", "else", "while", "end", "break", "continue", "return", "halt",
    "assign", "evaluate", "run", "declare", "unknown",
]  # fmt: skip


@dataclass(frozen=True, eq=False, kw_only=True)
class Statement:
    """A statement, or the header of a block."""

    kind: Kind
    start: int
    end: int
    name: str = ""
    """Of what is defined, assigned or run."""
    scope: str = ""
    """``global`` or ``local``, where it says so."""
    index: Expression | None = None
    """Of the element that is assigned."""
    value: Expression | None = None
    """A condition, what is assigned or returned, or a call."""
    parameters: tuple[tuple[str, Expression | None], ...] = ()
    """Of a function, with their default values."""
    words: frozenset[str] = frozenset()
    """Of a statement that was not understood."""

    @cached_property
    def expressions(self) -> tuple[Expression, ...]:
        """All of it."""
        return tuple(e for e in (self.index, self.value) if e is not None)

    @cached_property
    def calls(self) -> tuple[Call, ...]:
        """Calls in it, in the order of the text."""
        return tuple(e for whole in self.expressions for e in inside(whole) if isinstance(e, Call))


def _statement(tokens: Sequence[Token]) -> Statement:
    start, end = tokens[0].start, tokens[-1].end
    try:
        return _understood(tokens, start, end)
    except _NotUnderstood:
        words = frozenset(token.text for token in tokens if token.kind == "name")
        return Statement(kind="unknown", start=start, end=end, words=words)


def _understood(tokens: Sequence[Token], start: int, end: int) -> Statement:
    first = tokens[0].text
    parser = _Parser(tokens[1:] if first in _WORDS else tokens)
    if first in ("def", "thread", "sec"):
        return _header(parser, first, start, end)
    if first in _HEADS:
        condition = None if first == "else" else parser.expression()
        parser.take(":")
        if parser.next:
            raise _NotUnderstood
        return Statement(kind=first, start=start, end=end, value=condition)  # pyright: ignore[reportArgumentType]
    if first in _ALONE:
        if len(tokens) > 1 and (first != "halt" or [t.text for t in tokens[1:]] != ["(", ")"]):
            raise _NotUnderstood
        return Statement(kind=first, start=start, end=end)  # pyright: ignore[reportArgumentType]
    if first == "pass":
        return Statement(kind="declare", start=start, end=end)
    if first == "return":
        return Statement(kind="return", start=start, end=end, value=parser.whole() if parser.next else None)
    if first == "run":
        return _started(parser, start, end)
    if len(tokens) > 1 and first in ("kill", "join", "enter_critical", "exit_critical") and tokens[1].text != "=":
        return Statement(kind="declare", start=start, end=end)
    return _assignment(parser, first if first in ("global", "local") else "", start, end)


def _header(parser: _Parser, kind: str, start: int, end: int) -> Statement:
    name = parser.name()
    parser.take("(")
    parameters: list[tuple[str, Expression | None]] = []
    while parser.next != ")":
        parameter, default = parser.name(), None
        if parser.next == "=":
            parser.take()
            default = parser.expression()
        parameters.append((parameter, default))
        if parser.next != ")":
            parser.take(",")
    parser.take(")")
    parser.take(":")
    return Statement(kind=kind, start=start, end=end, name=name, parameters=tuple(parameters))  # pyright: ignore[reportArgumentType]


def _started(parser: _Parser, start: int, end: int) -> Statement:
    call = parser.whole()
    if not isinstance(call, Call):
        raise _NotUnderstood
    return Statement(kind="run", start=start, end=end, name=call.name, value=call)


def _assignment(parser: _Parser, scope: str, start: int, end: int) -> Statement:
    """An assignment, the declaration of a variable, or an expression that is evaluated for what it does."""
    target = parser.expression()
    if parser.next == "=":
        parser.take()
        if parser.begins("run"):  # the handle of a thread is no value
            return _started(parser, start, end)
        value = parser.whole()
        index = None
        match target:
            case Name():
                name = target.name
            case Index(of=Name() as of, at=at):
                name, index = of.name, at
            case _:
                raise _NotUnderstood
        return Statement(kind="assign", start=start, end=end, name=name, scope=scope, index=index, value=value)
    if parser.next:
        raise _NotUnderstood
    if scope:
        if not isinstance(target, Name):
            raise _NotUnderstood
        return Statement(kind="declare", start=start, end=end, name=target.name, scope=scope)
    return Statement(kind="evaluate", start=start, end=end, value=target)


# Functions, threads and secondary programs, with the statements outside of them as one more.


@dataclass(frozen=True, eq=False, kw_only=True)
class File:
    """A file of a program."""

    number: int
    source: Source
    routines: "list[Routine]" = field(default_factory=list["Routine"])
    """In the order of the text; the statements outside of all come first."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Routine:
    """A function, a thread, a secondary program, or what stands outside of these."""

    file: File
    kind: str
    """``def``, ``thread``, ``sec``, or empty."""
    name: str
    start: int
    parent: "Routine | None"
    """In which it is defined."""
    parameters: tuple[tuple[str, Expression | None], ...] = ()
    nodes: list[Node] = field(default_factory=list[Node])

    @cached_property
    def body(self) -> Body:
        """Its nodes."""
        return Body(nodes=tuple(self.nodes), size=1 + len(self.lines))

    @cached_property
    def lines(self) -> tuple[Statement, ...]:
        """Its statements, without those of functions defined in it."""
        return tuple(lines_in(self.nodes))

    @cached_property
    def own(self) -> frozenset[str]:
        """Parameters, and variables that it declares ``local``."""
        local = {line.name for line in self.lines if line.scope == "local"}
        return frozenset(local | {name for name, _ in self.parameters})

    @cached_property
    def assigned(self) -> frozenset[str]:
        """Variables that it sets without saying whose they are."""
        return frozenset(plain_name(line.name) for line in self.lines if line.kind == "assign" and not line.scope)


def plain_name(name: str) -> str:
    """Name of the variable of which another name is a field."""
    return name.partition(".")[0]


def parse(source: Source, number: int) -> File:
    """The functions of a file.

    Raises:
        FileError: blocks and their ends do not match.
    """
    file = File(number=number, source=source)
    _Blocks(file).read(_statement(tokens) for tokens in _lines(source.text))
    return file


@dataclass(eq=False, kw_only=True)
class _Open:
    """A block whose end has not come yet."""

    line: Statement
    nodes: list[Node]
    """To which statements are added."""
    routine: Routine
    arms: list[tuple[Statement, list[Node]]] = field(default_factory=list[tuple[Statement, list[Node]]])
    continues: str = ""
    """Label to which its ``continue`` leads."""


class _Blocks:
    """Statements as nested nodes."""

    def __init__(self, file: File):
        self.file = file
        self.outside = Routine(file=file, kind="", name=file.source.path.stem, start=0, parent=None)
        file.routines.append(self.outside)
        self.open: list[_Open] = []

    @property
    def routine(self) -> Routine:
        return self.open[-1].routine if self.open else self.outside

    @property
    def nodes(self) -> list[Node]:
        return self.open[-1].nodes if self.open else self.outside.nodes

    def refuse(self, line: Statement, why: str) -> FileError:
        source = self.file.source
        return FileError(
            source.path, f"'{shown(source.text[line.start : line.end])}' {why}", line=source.line(line.start)
        )

    def read(self, statements: Iterator[Statement]) -> None:
        for line in statements:
            self.add(line)
        if self.open:
            raise self.refuse(self.open[-1].line, "is not closed by 'end'; the file is cut off, or an 'end' is missing")

    def add(self, line: Statement) -> None:
        if len(self.open) > MAX_DEPTH:
            raise self.refuse(line, f"lies in more than {MAX_DEPTH} blocks; write some of them as functions")
        match line.kind:
            case "def" | "thread" | "sec":
                routine = Routine(
                    file=self.file, kind=line.kind, name=line.name, start=line.start, parent=self.routine,
                    parameters=line.parameters,
                )  # fmt: skip
                self.file.routines.append(routine)
                self.open.append(_Open(line=line, nodes=routine.nodes, routine=routine))
            case "if" | "while":
                opened = _Open(line=line, nodes=[], routine=self.routine)
                opened.arms.append((line, opened.nodes))
                self.open.append(opened)
            case "elif" | "else":
                if not self.open or self.open[-1].line.kind != "if" or self.open[-1].arms[-1][0].kind == "else":
                    raise self.refuse(line, "belongs to no 'if'; an 'end' before it closes too much")
                self.open[-1].nodes = []
                self.open[-1].arms.append((line, self.open[-1].nodes))
            case "end":
                if not self.open:
                    raise self.refuse(line, "closes nothing; an 'end' before it closes too much")
                self.close(self.open.pop())
            case _:
                self.nodes.append(self.node(line))

    def node(self, line: Statement) -> Node:
        match line.kind:
            case "break" | "continue":
                loop = next((one for one in reversed(self.open) if one.line.kind not in ("if",)), None)
                if loop is None or loop.line.kind != "while":
                    raise self.refuse(line, "is in no loop")
                if line.kind == "break":
                    return Leave(line=line, way="exit")
                loop.continues = f"{loop.line.start}"
                return Leave(line=line, way="jump", label=loop.continues)
            case "return":
                return Leave(line=line, way="return")
            case "halt":
                return Leave(line=line, way="stop")
            case "unknown":
                return Unknown(line=line)
            case _:
                return Step(line=line)

    def close(self, block: _Open) -> None:
        line = block.line
        if line.kind == "if":
            first, *others = block.arms
            arms = [Arm(condition=first[0].value, body=tuple(first[1]))]
            arms += [Arm(line=head, condition=head.value, body=tuple(nodes)) for head, nodes in others]
            self.nodes.append(Branches(line=line, name="if", arms=tuple(arms)))
        elif line.kind == "while":
            body: Block = tuple(block.nodes)
            if block.continues:
                body = (*body, Label(line=line, name=block.continues))
            kind = "endless" if is_true(line.value) else "while"
            self.nodes.append(Loop(line=line, name="while", kind=kind, condition=line.value, body=body))


def is_true(condition: Expression | None) -> bool:
    """Whether a condition is the word True."""
    while isinstance(condition, Operation) and condition.operator == "()":
        condition = condition.operands[0]
    return isinstance(condition, Name) and condition.name == "True"
