"""The text of a URScript program: its statements as words, in the functions and blocks that they stand in.

Universal Robots, *Script manual, e-Series*: "The URScript programming language".
"""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

from robot_programs.core.kit import Token, opens, parted, words
from robot_programs.core.source import Source
from taskcal_groundwork.errors import FileError, shown

_NAME = r"[A-Za-z_]\w*(?:\.[A-Za-z_]\w*)*"
_NUMBER = r"0[xX][0-9a-fA-F]+|(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
WORD = re.compile(
    rf"""(?P<space>[ \t\r\f]+|\#[^\n]*|\$[^\n]*)
    |(?P<newline>\n)
    |(?P<number>{_NUMBER})
    |(?P<name>{_NAME})
    |(?P<text>"[^"\n]*"|'[^'\n]*')
    |(?P<mark>[=!<>]=|.)""",
    re.VERBOSE,
)
"""Behind ``$`` stands the label of a line for PolyScope."""

REST_OF_LINE = re.compile(r"[ \t]*(?:[#$][^\n]*)?(?:\n|$)")
"""Behind a statement: nothing but a comment."""

MAX_BLOCKS = 40
"""In each other; no program has as many."""

FUNCTIONS = ("def", "thread", "sec")
"""With which functions, threads and secondary programs begin."""
_HEADS = {*FUNCTIONS, "if", "while", "elif", "else"}
_BLOCKS = {*_HEADS, "end", "break", "continue", "halt"}
OPERATORS = {
    "or": 1,
    "xor": 1,
    "and": 2,
    "==": 4,
    "!=": 4,
    "<": 4,
    "<=": 4,
    ">": 4,
    ">=": 4,
    "+": 5,
    "-": 5,
    "*": 6,
    "/": 6,
    "%": 6,
}
PREFIXES = {"not": 3, "-": 7, "+": 7}
KEYWORDS = {*_BLOCKS, "return", "global", "local", "run", "pass", *OPERATORS, *PREFIXES}
"""With which a statement begins, and operators: no names."""


def _statements(text: str) -> Iterator[list[Token]]:
    """Words of each statement; a header ends in its colon, and what stands in brackets goes on in the next line."""
    line: list[Token] = []
    depth = 0
    for word in words(WORD, text, 0):
        kind, own, _ = word
        if kind == "newline":
            if depth <= 0 and line:
                yield line
                line = []
            continue
        if kind == "name" and line and (own == "end" or (depth > 0 and own in _BLOCKS)):  # nothing open goes on here
            yield line
            line, depth = [], 0
        line.append(word)
        if kind == "mark":
            depth += opens(word)
        if (own == ":" and depth <= 0 and line[0].text in _HEADS) or line[0].text == "end":
            yield line
            line, depth = [], 0
    if line:
        yield line


def plain_name(name: str) -> str:
    """Name of the variable of which another name is a field."""
    return name.partition(".")[0]


@dataclass(eq=False, kw_only=True)
class ScriptStatement:
    """A statement, or a block: a header, what stands in it, and its end."""

    words: Sequence[Token]
    body: "list[ScriptStatement]" = field(default_factory=list["ScriptStatement"])
    others: "list[ScriptStatement]" = field(default_factory=list["ScriptStatement"])
    """Further branches of an ``if``."""
    end: Token | None = None
    """Of a block."""
    continued: bool = False
    """It is a loop that has a ``continue``."""

    @property
    def first(self) -> str:
        """Its first word."""
        return self.words[0].text

    @property
    def start(self) -> int:
        """Its first character."""
        return self.words[0].start

    @property
    def begins(self) -> int:
        """Behind it, or behind its header."""
        return self.words[-1].end


@dataclass(eq=False, kw_only=True)
class ScriptUnit:
    """A function, a thread, a secondary program, or what stands outside of these."""

    file: int
    source: Source
    kind: str
    """``def``, ``thread``, ``sec``, or empty."""
    name: str
    parent: "ScriptUnit | None" = None
    """In which it is defined."""
    head: ScriptStatement
    parameters: tuple[tuple[str, Sequence[Token]], ...] = ()
    """Names with the words of their default values, if they have any."""
    own: set[str] = field(default_factory=set[str])
    """Parameters, and variables that it declares ``local``."""
    shared: set[str] = field(default_factory=set[str])
    """Variables that it declares ``global``."""
    assigned: set[str] = field(default_factory=set[str])
    """Variables that it sets without saying whose they are."""
    calls: set[str] = field(default_factory=set[str])
    """What stands before brackets in it, but not behind ``run``."""
    features: set[str] = field(default_factory=set[str])
    """Variables by which it moves poses."""
    servers: set[str] = field(default_factory=set[str])
    """Variables that it sets to servers, whose functions stand behind their names."""


def parse(source: Source, number: int) -> list[ScriptUnit]:
    """The functions of a file in the order of the text; what stands outside of all comes first.

    Raises:
        FileError: blocks and their ends do not match, or a header is not understood.
    """
    blocks = _StatementReader(source, number)
    outside = ScriptUnit(
        file=number, source=source, kind="", name=source.path.stem, head=ScriptStatement(words=[Token("", "", 0)])
    )
    blocks.units.append(outside)
    line = blocks.block(outside, outside.head.body, ())
    if line is not None:
        raise blocks.refuse(
            line, f"{'closes nothing' if line.first == 'end' else NO_IF}; an 'end' before it closes too much"
        )
    return blocks.units


def _refused(source: Source, line: ScriptStatement, why: str) -> FileError:
    text = shown(source.text[line.start : line.begins])
    return FileError(source.path, f"'{text}' {why}", line=source.line(line.start))


def not_understood(source: Source, line: ScriptStatement) -> FileError:
    """What is said of a header that is not understood."""
    return _refused(source, line, "is not understood, and what stands in its block neither")


NO_IF = "belongs to no 'if'"


class _StatementReader:
    """Statements in the blocks of their functions."""

    def __init__(self, source: Source, number: int):
        self.source, self.number, self.units = source, number, list[ScriptUnit]()
        self.statements = (ScriptStatement(words=found) for found in _statements(source.text))

    def refuse(self, line: ScriptStatement, why: str) -> FileError:
        return _refused(self.source, line, why)

    def block(
        self, unit: ScriptUnit, body: list[ScriptStatement], around: tuple[ScriptStatement, ...]
    ) -> ScriptStatement | None:
        """Read a block, up to what ends it or goes on with another branch; None at the end of the file."""
        for line in self.statements:
            if len(around) > MAX_BLOCKS:
                raise self.refuse(line, f"lies in more than {MAX_BLOCKS} blocks; write some of them as functions")
            first = line.first
            if first in ("end", "elif", "else"):
                return line
            if first in FUNCTIONS:
                self.function(line, unit, around)
                continue
            body.append(line)
            if first in ("if", "while"):
                self.noted(line, unit)
                self.branches(unit, line, (*around, line))
            elif first in ("break", "continue") and len(line.words) == 1:
                self.leaves(line, around)
            else:
                self.noted(line, unit)
        return None

    def branches(self, unit: ScriptUnit, line: ScriptStatement, around: tuple[ScriptStatement, ...]) -> None:
        """Read what stands behind a header, with all branches of an ``if``."""
        head = line
        while (behind := self.block(unit, head.body, around)) is not None and behind.first != "end":
            if line.first != "if" or head.first == "else":
                raise self.refuse(behind, f"{NO_IF}; an 'end' before it closes too much")
            self.noted(behind, unit)
            line.others.append(behind)
            head = behind
        if behind is None:
            raise self.refuse(line, "is not closed by 'end'; the file is cut off, or an 'end' is missing")
        line.end = behind.words[0]

    def function(self, line: ScriptStatement, parent: ScriptUnit, around: tuple[ScriptStatement, ...]) -> None:
        """Read a function, a thread or a secondary program."""
        kind, *rest = line.words
        match rest:
            case [Token(kind="name") as name, Token(text="("), *given, Token(text=")"), Token(text=":")]:
                parameters = tuple(self.parameter(line, part) for part in parted(given, ",") if given)
            case _:
                raise not_understood(self.source, line)
        own = {name for name, _ in parameters}
        unit = ScriptUnit(
            file=self.number, source=self.source, kind=kind.text, name=name.text, parent=parent, head=line,
            parameters=parameters, own=own,
        )  # fmt: skip
        self.units.append(unit)
        self.branches(unit, line, (*around, line))

    def parameter(self, line: ScriptStatement, found: Sequence[Token]) -> tuple[str, Sequence[Token]]:
        match found:
            case [Token(kind="name") as name]:
                return name.text, ()
            case [Token(kind="name") as name, Token(text="="), _, *_]:
                return name.text, found[2:]
            case _:
                raise not_understood(self.source, line)

    def leaves(self, line: ScriptStatement, around: tuple[ScriptStatement, ...]) -> None:
        """Find the loop that a statement leaves, or goes on with."""
        loop = next((one for one in reversed(around) if one.first != "if"), None)
        if loop is None or loop.first != "while":
            raise self.refuse(line, "is in no loop")
        loop.continued |= line.first == "continue"

    def noted(self, line: ScriptStatement, unit: ScriptUnit) -> None:
        """Note what a statement sets and calls."""
        found = line.words
        for k in range(1, len(found)):
            if found[k].text == "(" and found[k - 1].kind == "name" and (k < 2 or found[k - 2].text != "run"):
                unit.calls.add(found[k - 1].text)
                if found[k - 1].text == "pose_trans" and k + 2 < len(found) and found[k + 2].text == ",":
                    unit.features.add(found[k + 1].text)
        scope = line.first if line.first in ("global", "local") else ""
        if len(found) > 1 + bool(scope) and found[1 + bool(scope)].text not in ("=", "["):
            return
        target, *value = parted(found, "=")
        if (value and value[0] and value[0][0].text == "run") or not (value or scope) or line.first in _BLOCKS:
            return
        name = plain_name(target[bool(scope)].text) if len(target) > bool(scope) else ""
        names = {"local": unit.own, "global": unit.shared}.get(scope, unit.assigned if unit.kind else unit.shared)
        names.add(name)
        if value and [word.text for word in value[0][:1]] == ["rpc_factory"]:
            unit.servers.add(name)
