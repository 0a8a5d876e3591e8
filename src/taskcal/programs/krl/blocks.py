"""The blocks of a KRL routine as a tree: branches, loops and splines with the lines inside."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property

from taskcal.programs.krl.parser import BLOCKS
from taskcal.programs.krl.syntax import Control, Statement

SPLINES = {"SPLINE", "PTP_SPLINE"}
LOOPS = {"FOR", "WHILE", "REPEAT", "LOOP"}

DEEPEST = 24
"""Blocks in each other, in one routine, and labels to which a GOTO behind them leads."""

_INNER = {"IF": {"ELSE"}, "SWITCH": {"CASE", "DEFAULT"}}
_CLOSING = frozenset(BLOCKS.values())


@dataclass(frozen=True, eq=False, kw_only=True)
class Branches:
    """IF or SWITCH."""

    line: Control
    branches: tuple[tuple[Control, tuple["Node", ...]], ...]
    """The line that begins each branch, and what it holds: of an IF its own line, then that of ELSE."""

    @property
    def complete(self) -> bool:
        """Whether one of the branches is taken in any case."""
        return any(line.keyword in ("ELSE", "DEFAULT") for line, _ in self.branches)


@dataclass(frozen=True, eq=False, kw_only=True)
class Loop:
    """FOR, WHILE, REPEAT or LOOP."""

    line: Control
    body: tuple["Node", ...]
    end: Control

    @cached_property
    def size(self) -> int:
        """How many lines it has, itself included."""
        return 1 + sum(1 for _ in lines_in(self.body))


@dataclass(frozen=True, eq=False, kw_only=True)
class Spline:
    """SPLINE or PTP_SPLINE."""

    body: tuple["Node", ...]


Node = Statement | Branches | Loop | Spline


@dataclass(frozen=True, eq=False, kw_only=True)
class Labels:
    """The labels of a routine and the GOTO that lead to them, by name in capitals."""

    backward: frozenset[str]
    """To which a GOTO behind them leads."""
    entered: frozenset[str]
    """To which a GOTO leads from outside the block that they are in."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Tree:
    """The lines of a routine."""

    nodes: tuple[Node, ...]
    labels: Labels
    odd: Control | None
    """The line at which its blocks do not match; its lines then stand side by side. None where all match."""


def tree_of(lines: Iterable[Statement], matters: Callable[[Statement], bool]) -> Tree:
    """The tree of a routine's lines.

    Args:
        lines: its lines, in order.
        matters: whether a line is of any consequence; the others are left out.
    """
    kept = [line for line in lines if matters(line)]
    builder = _Builder(lines=kept)
    nodes = builder.body(None)
    if builder.odd is not None:
        nodes = tuple(kept)
    return Tree(nodes=nodes, labels=_labels(nodes), odd=builder.odd)


class _Builder:
    def __init__(self, lines: list[Statement]):
        self.lines, self.at = lines, 0
        self.odd: Control | None = None
        self.depth = 0

    def body(self, opening: Control | None) -> tuple[Node, ...]:
        """Lines up to the one that ends the block, or its branch; that one is not taken."""
        nodes: list[Node] = []
        own = set[str]() if opening is None else {BLOCKS[opening.keyword], *_INNER.get(opening.keyword, ())}
        while self.at < len(self.lines) and self.odd is None:
            line = self.lines[self.at]
            keyword = line.keyword if isinstance(line, Control) else ""
            if keyword in own:
                return tuple(nodes)
            self.at += 1
            if isinstance(line, Control) and (keyword in _CLOSING or keyword in ("ELSE", "CASE", "DEFAULT")):
                self.odd = line
            elif isinstance(line, Control) and keyword in BLOCKS:
                nodes.append(self._block(line))
            else:
                nodes.append(line)
        if opening is not None:
            self.odd = self.odd or opening
        return tuple(nodes)

    def _block(self, opening: Control) -> Node:
        begins, branches = opening, list[tuple[Control, tuple[Node, ...]]]()
        self.depth += 1
        if self.depth > DEEPEST:
            self.odd = opening
        while True:
            branches.append((begins, self.body(opening)))
            if self.odd is not None:
                return opening
            end = self.lines[self.at]
            assert isinstance(end, Control)
            self.at += 1
            if end.keyword == BLOCKS[opening.keyword]:
                break
            begins = end
        self.depth -= 1
        (_, body) = branches[0]
        if opening.keyword in LOOPS:
            return Loop(line=opening, body=body, end=end)
        if opening.keyword in SPLINES:
            return Spline(body=body)
        # before the first CASE there is no branch
        return Branches(line=opening, branches=tuple(branches[opening.keyword == "SWITCH" :]))


def bodies_of(node: Node) -> tuple[tuple[Node, ...], ...]:
    """What stands inside a block, branch by branch."""
    match node:
        case Branches():
            return tuple(body for _, body in node.branches)
        case Loop() | Spline():
            return (node.body,)
        case _:
            return ()


def lines_in(nodes: Iterable[Node]) -> Iterator[Statement]:
    """All lines of some nodes, those of blocks included."""
    for node in nodes:
        match node:
            case Branches():
                yield node.line
                for line, body in node.branches:
                    if line is not node.line:
                        yield line
                    yield from lines_in(body)
            case Loop():
                yield node.line
                yield from lines_in(node.body)
                yield node.end
            case Spline():
                yield from lines_in(node.body)
            case _:
                yield node


def name_of_label(line: Control) -> str:
    """Of a label or a GOTO, in capitals."""
    return line.words[0].upper if line.words else ""


def exits_of(nodes: Iterable[Node]) -> bool:
    """Whether an EXIT among the nodes of a loop leaves that loop."""
    return any(
        (isinstance(node, Control) and node.keyword == "EXIT")
        or (not isinstance(node, Loop) and any(exits_of(body) for body in bodies_of(node)))
        for node in nodes
    )


def _labels(nodes: tuple[Node, ...]) -> Labels:
    everywhere = [line for line in lines_in(nodes) if isinstance(line, Control) and line.keyword == "GOTO"]
    backward, entered = set[str](), set[str]()

    def visit(body: tuple[Node, ...]) -> None:
        own = [node for node in body if isinstance(node, Control) and node.keyword == "LABEL"]
        within = {line.start for line in lines_in(body)} if own else set[int]()
        for label in own:
            name = name_of_label(label)
            for line in everywhere:
                if name_of_label(line) == name and line.start > label.start:
                    backward.add(name)
                if name_of_label(line) == name and line.start not in within:
                    entered.add(name)
        for node in body:
            for inner in bodies_of(node):
                visit(inner)

    visit(nodes)
    if len(backward) > DEEPEST:
        return Labels(backward=frozenset(), entered=frozenset(entered | backward))
    return Labels(backward=frozenset(backward), entered=frozenset(entered))
