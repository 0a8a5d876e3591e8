"""The text of a URScript program: its statements, the expressions in them, and its functions as the nodes of `core.flow`.

Universal Robots, *Script manual, e-Series*: "The URScript programming language".
"""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import ClassVar, Literal, NamedTuple

from robot_programs.core.errors import FileError, shown
from robot_programs.core.flow import Arm, Block, Body, Branches, Label, Leave, Loop, Node, Step, Unknown, lines_in
from robot_programs.core.source import Source
from robot_programs.core.values import OperandReader

# Expressions.


class Expression(NamedTuple):
    """An expression with its place in the text: its first character, and behind its last one."""

    kind: Literal["value", "name", "list", "pose", "index", "call", "operation"]
    start: int
    end: int
    name: str = ""
    """Of a variable, a constant, a field of a structure, or what is called; the operator."""
    value: int | float | bool | str = 0
    """A number, whole ones apart, because their quotients may be whole, too; a flag, or a text."""
    parts: "tuple[Expression, ...]" = ()
    """Elements, arguments or operands; what is indexed, and by what."""
    keys: tuple[str, ...] = ()
    """Names by which arguments are given, empty where they stand in their order."""

    @property
    def arguments(self) -> "Iterator[tuple[str, Expression]]":
        """Of a call: names and values."""
        return zip(self.keys, self.parts, strict=True)


def inside(expression: Expression) -> Iterator[Expression]:
    """An expression and all those in it, in their order."""
    waiting = [expression]
    while waiting:
        one = waiting.pop()
        yield one
        waiting += reversed(one.parts)


_NAME = re.compile(r"[A-Za-z_]\w*(?:\.[A-Za-z_]\w*)*")
_NUMBER = r"0[xX][0-9a-fA-F]+|(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_TOKEN = re.compile(
    rf"""(?P<space>[ \t\r\f]+|\#[^\n]*|\$[^\n]*)
    |(?P<newline>\n)
    |(?P<number>{_NUMBER})
    |(?P<name>{_NAME.pattern})
    |(?P<text>"[^"\n]*"|'[^'\n]*')
    |(?P<mark>[=!<>]=|.)""",
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


class _NotUnderstood(Exception):
    """Text that is no statement."""


class _Reader(OperandReader[Expression]):
    """The tokens of an expression, from left to right."""

    BINDING: ClassVar = {
        "or": 1, "xor": 1, "and": 2, "==": 4, "!=": 4, "<": 4, "<=": 4, ">": 4, ">=": 4, "+": 5, "-": 5, "*": 6, "/": 6, "%": 6,
    }  # fmt: skip
    PREFIXES: ClassVar = {"not": 3, "-": 7, "+": 7}

    def __init__(self, text: str, tokens: Sequence[Token]):
        self.text, self.end = text, 0
        self._coming = iter(tokens)
        self.next = next(self._coming, _NO_TOKEN)

    def whole(self) -> Expression:
        """The expression that all tokens are."""
        expression = self.expression()
        if self.next.kind:
            raise _NotUnderstood
        return expression

    def take(self) -> Token:
        token, self.next = self.next, next(self._coming, _NO_TOKEN)
        self.end = token.end
        return token

    def skip(self, mark: str) -> bool:
        """Take a mark, if it comes next."""
        return self.next.text == mark and bool(self.take())

    def expect(self, mark: str) -> None:
        if not self.skip(mark):
            raise _NotUnderstood

    def problem(self, what: str) -> _NotUnderstood:
        return _NotUnderstood(what)

    @property
    def place(self) -> int:
        return self.next.start

    @property
    def sign(self) -> str:
        return self.next.text

    def operation(self, start: int, sign: str, *operands: Expression) -> Expression:
        left, compares = operands[0], self.BINDING["=="]
        chained = self.BINDING.get(sign) == compares == self.BINDING.get(left.name) and left.kind == "operation"
        if chained and ")" not in self.text[left.end : operands[-1].start]:
            raise _NotUnderstood  # the manual does not tell what a < b < c is
        return Expression("operation", start, self.end, sign, parts=operands)

    def single(self) -> Expression:
        start, self.height = self.place, 0
        value = self._single()
        while self.skip("["):
            height, index = self.height, self.expression()
            self.grow(max(height, self.height))
            self.expect("]")
            value = Expression("index", start, self.end, parts=(value, index))
        return value

    def _single(self) -> Expression:
        token = self.take()
        match token.kind, token.text:
            case "number" | "text", _:
                return Expression("value", token.start, token.end, "", _constant(token))
            case "name", "True" | "False":
                return Expression("value", token.start, token.end, "", token.text == "True")
            case "name", name if name not in _WORDS:
                if name == "p" and self.place == token.end and self.skip("["):
                    parts, _ = self._items("]")
                    if not parts:
                        raise _NotUnderstood
                    return Expression("pose", token.start, self.end, parts=parts)
                if self.skip("("):
                    parts, keys = self._items(")")
                    return Expression("call", token.start, self.end, name, parts=parts, keys=keys)
                return Expression("name", token.start, token.end, name)
            case "mark", "[":
                parts, _ = self._items("]")
                return Expression("list", token.start, self.end, parts=parts)
            case "mark", "(":
                value = self.expression()
                self.expect(")")
                return value
            case _:
                raise _NotUnderstood

    def _items(self, closing: str) -> tuple[tuple[Expression, ...], tuple[str, ...]]:
        """Values up to a closing bracket, and the names by which those of a call are given."""
        items: list[Expression] = []
        keys: list[str] = []
        height = 0
        while not self.skip(closing):
            item, key = self.expression(), ""
            if closing == ")" and item.kind == "name" and "." not in item.name and self.skip("="):
                item, key = self.expression(), item.name
            elif any(keys):
                raise _NotUnderstood
            items.append(item)
            keys.append(key)
            height = max(height, self.height)
            if self.next.text != closing:
                self.expect(",")
        self.height = height
        self.grow(height)
        return tuple(items), tuple(keys)


_NO_TOKEN = Token("", "", 0)


def _constant(token: Token) -> int | float | str:
    """What a number or a text is."""
    text = token.text
    if token.kind == "text":
        return text[1:-1]
    if text[:2] in ("0x", "0X"):
        return int(text, 16)
    return int(text) if text.isdecimal() and len(text) < 16 else float(text)


# Statements.

MAX_BLOCKS = 40
"""In each other; no program has as many."""

REST_OF_LINE = re.compile(r"[ \t]*(?:[#$][^\n]*)?(?:\n|$)")
"""Behind a statement: nothing but a comment."""


_HEADS = {"def", "thread", "sec", "if", "while", "elif", "else"}
_ALONE = {"end", "break", "continue", "halt"}
_BLOCKS = _HEADS | _ALONE
_WORDS = {*_BLOCKS, "return", "global", "local", "run", "pass", *_Reader.BINDING, *_Reader.PREFIXES}
"""With which a statement begins, and operators: no names."""


def _lines(text: str) -> Iterator[list[Token]]:
    """Tokens of each statement; a header ends in its colon, and what stands in brackets goes on in the next line."""
    line: list[Token] = []
    depth = 0
    for match in _TOKEN.finditer(text):
        kind, word = str(match.lastgroup), match[0]
        if kind == "space":
            continue
        if kind == "newline":
            if depth <= 0 and line:
                yield line
                line = []
            continue
        if kind == "name" and line and (word == "end" or (depth > 0 and word in _BLOCKS)):  # nothing open goes on here
            yield line
            line, depth = [], 0
        line.append(Token(kind, word, match.start()))
        if kind == "mark":
            depth += (word in "([{") - (word in ")]}")
        if (word == ":" and depth <= 0 and line[0].text in _HEADS) or line[0].text == "end":
            yield line
            line, depth = [], 0
    if line:
        yield line


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
    def calls(self) -> tuple[Expression, ...]:
        """Calls in it, in the order of the text."""
        whole = (e for e in (self.index, self.value) if e is not None)
        return tuple(e for one in whole for e in inside(one) if e.kind == "call")


def _statement(text: str, tokens: Sequence[Token]) -> Statement:
    start, end = tokens[0].start, tokens[-1].end
    try:
        return _understood(text, tokens, start, end)
    except _NotUnderstood:
        words = frozenset(token.text for token in tokens if token.kind == "name")
        return Statement(kind="unknown", start=start, end=end, words=words)


def _understood(text: str, tokens: Sequence[Token], start: int, end: int) -> Statement:
    def expression(first: int, behind: int | None = None) -> Expression:
        return _Reader(text, tokens[first:behind]).whole()

    def statement(kind: Kind, **other: object) -> Statement:
        return Statement(kind=kind, start=start, end=end, **other)  # pyright: ignore[reportArgumentType]

    words = [token.text for token in tokens]
    match words:
        case ["def" | "thread" | "sec" as kind, *_, ":"]:
            call = expression(1, -1)
            return statement(kind, name=_called(call), parameters=tuple(_parameters(call)))
        case ["if" | "elif" | "while" as kind, *_, ":"]:
            return statement(kind, value=expression(1, -1))
        case ["else", ":"] | ["end" | "break" | "continue" | "halt"] | ["halt", "(", ")"]:
            return statement(words[0])  # pyright: ignore[reportArgumentType]
        case ["pass"] | ["kill" | "join" | "enter_critical" | "exit_critical", _, *_] if words[1:2] != ["="]:
            return statement("declare")
        case ["return"]:
            return statement("return")
        case ["return", *_]:
            return statement("return", value=expression(1))
        case _:
            pass
    if "run" in words and (at := words.index("run")) in (0, _first_outside(words) + 1):
        call = expression(at + 1)  # the handle of a thread is no value
        return statement("run", name=_called(call), value=call)
    scope = words[0] if words[0] in ("global", "local") else ""
    if "=" in words and (equals := _first_outside(words)):
        target, value = expression(bool(scope), equals), expression(equals + 1)
        of, *index = target.parts if target.kind == "index" else (target,)
        if of.kind != "name":
            raise _NotUnderstood
        return statement("assign", name=of.name, scope=scope, index=index[0] if index else None, value=value)
    value = expression(bool(scope))
    if scope and value.kind != "name":
        raise _NotUnderstood
    return statement("declare", name=value.name, scope=scope) if scope else statement("evaluate", value=value)


def _first_outside(words: Sequence[str]) -> int:
    """Place of the first equals sign in no brackets; 0 where there is none."""
    depth = 0
    for place, word in enumerate(words):
        depth += (word in "([{") - (word in ")]}")
        if word == "=" and not depth:
            return place
    return 0


def _called(call: Expression) -> str:
    if call.kind != "call":
        raise _NotUnderstood
    return call.name


def _parameters(call: Expression) -> Iterator[tuple[str, Expression | None]]:
    for name, value in call.arguments:
        if not name and value.kind != "name":
            raise _NotUnderstood
        yield (name, value) if name else (value.name, None)


# Functions, threads and secondary programs, with the statements outside of them as one more.


@dataclass(frozen=True, eq=False, kw_only=True)
class File:
    """A file of a program."""

    number: int
    source: Source
    routines: "list[Routine]" = field(default_factory=list["Routine"])
    """In the order of the text; the statements outside of all come first."""
    ends: dict[int, Statement] = field(default_factory=dict[int, Statement])
    """What closes a block, by the first character of its header."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Routine:
    """A function, a thread, a secondary program, or what stands outside of these."""

    file: File
    kind: str
    """``def``, ``thread``, ``sec``, or empty."""
    name: str
    start: int
    begins: int
    """Behind the colon of its header."""
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
    outside = Routine(file=file, kind="", name=source.path.stem, start=0, begins=0, parent=None)
    file.routines.append(outside)
    blocks = _Blocks(file, (_statement(source.text, tokens) for tokens in _lines(source.text)))
    nodes, line = blocks.block(outside, ())
    if line is not None:
        raise blocks.refuse(
            line, f"{'closes nothing' if line.kind == 'end' else NO_IF}; an 'end' before it closes too much"
        )
    outside.nodes.extend(nodes)
    return file


NO_IF = "belongs to no 'if'"


class _Blocks:
    """Statements as nested nodes."""

    def __init__(self, file: File, statements: Iterator[Statement]):
        self.file, self.statements = file, statements
        self.continued = set[int]()
        """First characters of the loops that have a ``continue``."""

    def refuse(self, line: Statement, why: str) -> FileError:
        source = self.file.source
        text = shown(source.text[line.start : line.end])
        return FileError(source.path, f"'{text}' {why}", line=source.line(line.start))

    def block(self, routine: Routine, around: tuple[Statement, ...]) -> tuple[Block, Statement | None]:
        """Nodes of a block, and what ends it or goes on with another branch; None at the end of the file."""
        nodes: list[Node] = []
        for line in self.statements:
            if len(around) > MAX_BLOCKS:
                raise self.refuse(line, f"lies in more than {MAX_BLOCKS} blocks; write some of them as functions")
            match line.kind:
                case "end" | "elif" | "else":
                    return tuple(nodes), line
                case "def" | "thread" | "sec":
                    self.routine(line, routine, around)
                case "if":
                    nodes.append(self.branches(line, routine, around))
                case "while":
                    nodes.append(self.loop(line, routine, around))
                case _:
                    nodes.append(self.node(line, around))
        return tuple(nodes), None

    def closed(self, routine: Routine, around: tuple[Statement, ...], *, arms: bool = False) -> tuple[Block, Statement]:
        """Nodes of a block that something ends: its end, or another branch."""
        nodes, line = self.block(routine, around)
        if line is None:
            raise self.refuse(around[-1], "is not closed by 'end'; the file is cut off, or an 'end' is missing")
        if line.kind != "end" and not arms:
            raise self.refuse(line, f"{NO_IF}; an 'end' before it closes too much")
        self.file.ends[around[-1].start] = line
        return nodes, line

    def routine(self, line: Statement, parent: Routine, around: tuple[Statement, ...]) -> None:
        own = Routine(
            file=self.file, kind=line.kind, name=line.name, start=line.start, begins=line.end, parent=parent,
            parameters=line.parameters,
        )  # fmt: skip
        self.file.routines.append(own)
        own.nodes.extend(self.closed(own, (*around, line))[0])

    def branches(self, line: Statement, routine: Routine, around: tuple[Statement, ...]) -> Node:
        arms: list[Arm] = []
        head = line
        while head.kind != "end":
            nodes, behind = self.closed(routine, (*around, line), arms=head.kind != "else")
            arms.append(Arm(line=head if arms else None, condition=head.value, body=nodes))
            head = behind
        return Branches(line=line, name="if", arms=tuple(arms))

    def loop(self, line: Statement, routine: Routine, around: tuple[Statement, ...]) -> Node:
        body, _ = self.closed(routine, (*around, line))
        if line.start in self.continued:
            body = (*body, Label(line=line, name=str(line.start)))
        kind = "endless" if line.value is not None and line.value.value is True else "while"
        return Loop(line=line, name="while", kind=kind, condition=line.value, body=body)

    def node(self, line: Statement, around: tuple[Statement, ...]) -> Node:
        match line.kind:
            case "break" | "continue":
                loop = next((one for one in reversed(around) if one.kind != "if"), None)
                if loop is None or loop.kind != "while":
                    raise self.refuse(line, "is in no loop")
                if line.kind == "break":
                    return Leave(line=line, way="exit")
                self.continued.add(loop.start)
                return Leave(line=line, way="jump", label=str(loop.start))
            case "return":
                return Leave(line=line, way="return")
            case "halt":
                return Leave(line=line, way="stop")
            case "unknown":
                return Unknown(line=line)
            case _:
                return Step(line=line)
