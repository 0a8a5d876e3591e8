"""The one form to which languages lower their text: expressions, and the lines that stand in the nodes of `flow`.

Every expression knows its place in the text. State of a controller, such as the active frame, is data as variables are, so that
what sets it is an assignment as well.
"""

from collections.abc import Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from robot_programs.core.flow import Block, lines_in

Span = tuple[int, int, int]
"""Number of a file, first character, and behind the last one."""

Text = tuple[int, int]
"""Text of a line: number of a file, and first character."""

Key = Hashable
"""Of a datum: a variable, a register, or what is active."""

HERE: Key = "where the robot is"
"""The datum that is the motion before a line."""

# Expressions.


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class Lit:
    """A number, a truth value, a text, or another value that the text states."""

    at: Span
    value: Any


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class Ref:
    """A datum, or a part of it."""

    at: Span
    name: str
    """As the program calls the datum, for messages."""
    key: Key
    path: "tuple[str | tuple[Expression, ...], ...]" = ()
    """Names of parts, and indices of elements."""


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class Op:
    """An operator with its operands."""

    at: Span
    sign: str
    operands: "tuple[Expression, ...]"


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class Hole:
    """What is not understood, or known only at run time."""

    at: Span
    why: str
    named: tuple[Ref, ...] = ()
    """Data that its text names."""


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class Rec:
    """A structure or an array whose parts are written out."""

    at: Span
    kind: str = ""
    parts: "Mapping[Hashable, Expression]"


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class Ask:
    """The value of a function: of the language, or of the program."""

    at: Span
    name: str
    arguments: "tuple[Expression, ...]" = ()
    """Of a function of the program, one for each parameter; a hole for what is not given."""
    options: tuple[str, ...] = ()
    """Names of the last of them, where they are given by name."""
    routines: "tuple[Routine, ...]" = ()
    """Those of the program that may be meant."""
    changes: tuple[Ref, ...] = ()
    """What a function of the language may change."""
    lends: tuple[Ref, ...] = ()
    """As of `Do`."""
    moves: bool = False
    """Where the robot is behind it is not known."""
    sure: bool = True
    """It is called for certain, and once, so that it can be followed."""


Expression = Lit | Ref | Op | Rec | Ask | Hole


def parts_of(expression: Expression) -> Sequence[Expression]:
    """The expressions right in one, in the order of the text."""
    match expression:
        case Op():
            return expression.operands
        case Rec():
            return tuple(expression.parts.values())
        case Ask():
            return expression.arguments
        case Ref() if expression.path:
            return [index for part in expression.path if isinstance(part, tuple) for index in part]
        case _:
            return ()


def inside(expression: Expression) -> Iterator[Expression]:
    """An expression, and all in it."""
    waiting = [expression]
    while waiting:
        one = waiting.pop()
        yield one
        waiting += reversed(parts_of(one))


def asks_in(expression: Expression) -> Iterator[Ask]:
    """Functions in an expression, those in arguments before the one that is given them."""
    for one in parts_of(expression):
        yield from asks_in(one)
    if isinstance(expression, Ask):
        yield expression


# Routines and their lines.


@dataclass(eq=False, kw_only=True)
class Routine:
    """A routine of a program; its nodes may be lowered later, when all others are known."""

    name: str
    """Empty of lines outside of any, of which is not known when they run."""
    nodes: Block = ()
    handlers: tuple[Block, ...] = ()
    """To which control comes from anywhere in it, where an error is met."""
    parameters: tuple[Key, ...] = ()
    returning: frozenset[Key] = frozenset()
    """Parameters by which it changes what it is given, if it sets them."""
    variables: tuple[Key, ...] = ()
    """Data of its own, which begin anew each time."""
    beside: bool = False
    """It may run between any two lines."""
    begins: bool = False
    """The program begins in it, whatever calls it."""
    unread: frozenset[str] = frozenset()
    """Labels to which a jump may lead that is not understood."""
    behind: "Routine | None" = None
    """What was gone through before it begins, where nothing calls it."""
    disarms: "frozenset[Routine]" = frozenset()
    """Routines that no longer run beside the lines where it ends."""
    resumes: "Routine | None" = None
    """Where it runs beside the lines, the call may be left that is being made there."""

    @property
    def all_nodes(self) -> Block:
        """Of its body and its handlers."""
        return tuple(node for block in (self.nodes, *self.handlers) for node in block)

    @property
    def lines(self) -> "Iterator[Line]":
        """Of its body and its handlers, those in blocks included."""
        return (line for line in lines_in(self.all_nodes) if line is not None)


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class Assign:
    """An assignment."""

    at: Span
    target: Ref
    value: Expression


@dataclass(frozen=True, eq=False, kw_only=True)
class MoveLine:
    """A motion; languages add what they need of its text."""

    at: Span
    points: tuple[Expression, ...] = ()
    """Where it leads, its end last."""
    settings: Mapping[str, Expression] = field(default_factory=dict[str, Expression])
    """What else it depends on, by names of the language; it need not be known."""
    why: str = ""
    """Why it is not understood; empty where it is."""
    ends: bool = True
    """The robot is in its end before anything else happens."""
    leans: bool = False
    """It may count from where the motion before ends: the setting ``before`` gives that motion when it is called."""
    linked: bool = True
    """It can be told from the order of the lines which motion comes before it."""


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class Do:
    """A call, or a step that may change something otherwise."""

    at: Span
    routines: tuple[Routine, ...] = ()
    """Those of the program that may be meant."""
    arguments: tuple[Expression, ...] = ()
    changes: tuple[Ref, ...] = ()
    """What else may hold something unknown behind it."""
    why: str = ""
    """What is then to be said behind the name of such a datum."""
    moves: bool = False
    """Where the robot is behind it is not known, whatever it calls."""
    any: bool = False
    """Any routine of the program may be meant."""
    sure: bool = True
    """The routine is meant for certain, so that it can be followed."""
    lends: tuple[Ref, ...] = ()
    """What may be changed as `changes` are, and is so on ways alone that lead through the routine."""


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class Arming:
    """From here on routines may run beside the lines, or no longer do."""

    at: Span
    routines: tuple[Routine, ...]
    on: bool = True


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class Check:
    """Line of a node: what its conditions or bounds are, and what it counts."""

    at: Span
    conditions: tuple[Expression, ...] = ()
    counter: Ref | None = None


Line = Assign | MoveLine | Do | Arming | Check


def expressions(line: Line) -> tuple[Expression, ...]:
    """What a line reads."""
    match line:
        case Assign():
            return (line.value, *(index for part in line.target.path if isinstance(part, tuple) for index in part))
        case MoveLine():
            return (*line.points, *line.settings.values())
        case Do():
            return line.arguments
        case Check():
            return line.conditions
        case Arming():
            return ()


def changed(line: Line) -> tuple[Ref, ...]:
    """What a line changes by itself."""
    match line:
        case Assign():
            return (line.target,)
        case Do():
            return line.changes
        case Check(counter=Ref() as counter):
            return (counter,)
        case _:
            return ()


def calls_in(line: Line) -> "Iterator[Do | Ask]":
    """Calls of routines of the program in a line."""
    if isinstance(line, Do) and line.routines:
        yield line
    for one in expressions(line):
        yield from (ask for ask in asks_in(one) if ask.routines)


def called(line: Line) -> tuple[Routine, ...]:
    """Routines that may run in a line, but for functions in its expressions."""
    return line.routines if isinstance(line, Do) else ()
