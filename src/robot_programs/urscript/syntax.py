"""The text of a URScript program: its statements, the expressions in them, and its functions as the nodes of `core.flow`.

Universal Robots, *Script manual, e-Series*: "The URScript programming language". Expressions are written as Python's are, which
reads them; what Python has beyond URScript is not understood.
"""

import ast
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import accumulate, pairwise
from typing import Literal, NamedTuple

from robot_programs.core.errors import FileError, shown
from robot_programs.core.flow import Arm, Block, Body, Branches, Label, Leave, Loop, Node, Step, Unknown, lines_in
from robot_programs.core.source import Source

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


MAX_DEPTH = 80
"""Operators and brackets in each other."""

_OPERATORS: Mapping[type[ast.AST], str] = {
    ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/", ast.Mod: "%", ast.Eq: "==", ast.NotEq: "!=", ast.Lt: "<",
    ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">=", ast.USub: "-", ast.UAdd: "+", ast.Not: "not",
}  # fmt: skip

_MASKED = re.compile(
    r"""[#$][^\n]*|"[^"\n]*"|'[^'\n]*'|\bxor\b|[\r\f\\]|[^\x00-\x7f]|(?<![\w.])0+(?=\d)
    |\b(?:None|as|assert|async|await|break|class|continue|def|del|elif|else|except|finally|for|from|global|if|import|in|is|lambda
    |nonlocal|pass|raise|return|try|while|with|yield)\b""",
    re.VERBOSE,
)
_NAME = re.compile(r"[A-Za-z_]\w*(?:\.[A-Za-z_]\w*)*")
_NUMBER = r"0[xX][0-9a-fA-F]+|(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_GLUED = re.compile(rf"(?<![\w.])(?>{_NUMBER})[^\W\d]")
"""A number that goes on in a word, which Python takes with a warning where that is one of its own."""


def _masked(match: re.Match[str]) -> str:
    """What Python would read otherwise, in as many characters; ``xor`` binds as ``or`` does."""
    text = match[0]
    match text[0]:
        case "#" | "$" | "\r" | "\f":
            return " " * len(text)
        case '"' | "'" as mark:
            return mark + "_" * (len(text) - 2) + mark
        case "0":
            return "1" * len(text)
        case _ if text == "xor":
            return "or "
        case first if first.isascii() and first.isalpha():
            return text.swapcase()
        case first:
            return "_" if first.isalnum() else "?"


class _NotUnderstood(Exception):
    """Text that is no statement."""


class _Reader:
    """Reading the expression that a piece of a text is."""

    def __init__(self, text: str, start: int, end: int):
        self.text = text
        piece = _MASKED.sub(_masked, text[start:end])
        if _GLUED.search(piece):
            raise _NotUnderstood
        lines = piece.split("\n")
        self.starts = list(accumulate((len(line) + 1 for line in lines), initial=start))
        try:
            self.tree = ast.parse(piece, mode="eval").body
        except (SyntaxError, ValueError, RecursionError, MemoryError):
            raise _NotUnderstood from None

    def of(self, node: ast.expr | None, depth: int = 0) -> Expression:
        if node is None or depth > MAX_DEPTH:
            raise _NotUnderstood
        start = self.starts[node.lineno - 1] + node.col_offset
        end = self.starts[(node.end_lineno or 1) - 1] + (node.end_col_offset or 0)
        text = self.text[start:end]
        if isinstance(node, ast.Constant):
            return Expression("value", start, end, "", _constant(node.value, text))

        def each(*nodes: ast.expr) -> tuple[Expression, ...]:
            return tuple(self.of(one, depth + 1) for one in nodes)

        match node:
            case ast.Name() | ast.Attribute() if _NAME.fullmatch(text) and text not in _WORDS:
                return Expression("name", start, end, text)
            case ast.List():
                return Expression("list", start, end, parts=each(*node.elts))
            case ast.Subscript(value=ast.Name(id="p"), slice=place) if self.text.startswith("p[", start):
                return Expression(
                    "pose", start, end, parts=each(*(place.elts if isinstance(place, ast.Tuple) else [place]))
                )
            case ast.Subscript():
                return Expression("index", start, end, parts=each(node.value, node.slice))
            case ast.Call(func=ast.Name() | ast.Attribute() as called):
                keys = (*("" for _ in node.args), *(key.arg or "" for key in node.keywords))
                parts = each(*node.args, *(key.value for key in node.keywords))
                return Expression("call", start, end, self.of(called).name, parts=parts, keys=keys)
            case ast.BoolOp():
                return self.folded(node, each(*node.values))
            case _:
                sign, operands = _operation(node)
                return Expression("operation", start, end, sign, parts=each(*operands))

    def folded(self, node: ast.BoolOp, values: Sequence[Expression]) -> Expression:
        """Conditions one after another: ``or`` and ``xor`` bind alike."""
        whole = values[0]
        for before, value in pairwise(values):
            between = re.sub(r"#[^\n]*", "", self.text[before.end : value.start])
            sign = "and" if isinstance(node.op, ast.And) else "xor" if re.search(r"\bxor\b", between) else "or"
            whole = Expression("operation", whole.start, value.end, sign, parts=(whole, value))
        return whole


def _operation(node: ast.expr) -> tuple[str, list[ast.expr]]:
    match node:
        case ast.Compare(ops=[sign], comparators=[right]):
            operands = [node.left, right]
        case ast.BinOp(op=sign):
            operands = [node.left, node.right]
        case ast.UnaryOp(op=sign):
            operands = [node.operand]
        case _:
            raise _NotUnderstood
    if type(sign) not in _OPERATORS:
        raise _NotUnderstood
    return _OPERATORS[type(sign)], operands


def _constant(value: object, text: str) -> int | float | bool | str:
    """What a constant of Python's is; its text has what was put in its place."""
    match value:
        case bool():
            return value
        case float() if "_" not in text:
            return float(text)
        case int() if text.isdecimal():
            return int(text) if len(text) < 16 else float(text)
        case int() if text[:2] in ("0x", "0X") and "_" not in text:
            return int(text, 16)
        case str() if text[0] in "\"'" and not set("\"'") & set(text[1:-1]):
            return text[1:-1]
        case _:
            raise _NotUnderstood


# Statements.

MAX_BLOCKS = 40
"""In each other; no program has as many."""

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


REST_OF_LINE = re.compile(r"[ \t]*(?:[#$][^\n]*)?(?:\n|$)")
"""Behind a statement: nothing but a comment."""


class Token(NamedTuple):
    """A word of the text."""

    kind: str
    text: str
    start: int

    @property
    def end(self) -> int:
        """Behind its last character."""
        return self.start + len(self.text)


_HEADS = {"def", "thread", "sec", "if", "while", "elif", "else"}
_ALONE = {"end", "break", "continue", "halt"}
_BLOCKS = _HEADS | _ALONE
_WORDS = {*_BLOCKS, "return", "global", "local", "run", "pass"}
"""With which a statement begins."""


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
        piece = tokens[first:behind]
        if not piece:
            raise _NotUnderstood
        reader = _Reader(text, piece[0].start, piece[-1].end)
        return reader.of(reader.tree)

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
