"""What a RAPID module consists of: declarations, routines, statements and expressions with their places in the text."""

from collections.abc import Iterator
from dataclasses import dataclass

from taskcal.programs.rapid.lexer import Token, listed
from taskcal.programs.source import Source


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
class Text(Node):
    """A string."""

    value: str


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class Truth(Node):
    """TRUE or FALSE."""

    value: bool


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class Aggregate(Node):
    """Values in square brackets: a record or an array."""

    held: "tuple[Expression, ...] | str"
    """The values; the text of the file where they are a few numbers, which are most of a program and read again."""

    @property
    def is_plain(self) -> bool:
        """Whether it is known to hold nothing but numbers."""
        return isinstance(self.held, str)

    @property
    def numbers(self) -> tuple[float, ...]:
        """Those of a plain one."""
        return tuple(value for _, _, value in self._listed())

    @property
    def items(self) -> tuple["Expression", ...]:
        """The values; those of a plain one are other objects each time."""
        if not isinstance(self.held, str):
            return self.held
        return tuple(Number(start=start, end=end, value=value) for start, end, value in self._listed())

    def _listed(self) -> Iterator[tuple[int, int, float]]:
        return listed(self.held, self.start, self.end) if isinstance(self.held, str) else iter(())


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


Expression = Number | Text | Truth | Aggregate | Reference | Call | Operation


def parts(node: Expression) -> Iterator[Expression]:
    """An expression and all that stand in it."""
    yield node
    match node:
        case Aggregate() if not node.is_plain:
            inside = node.items
        case Operation():
            inside = node.operands
        case Call():
            inside = tuple(argument.value for argument in node.arguments if argument.value is not None)
        case Reference():
            inside = tuple(
                item for selector in node.selectors if isinstance(selector, Index) for item in selector.items
            )
        case _:
            inside = ()
    for part in inside:
        yield from parts(part)


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class Declaration(Node):
    """Declares data; its text ends behind the semicolon."""

    storage: str
    """``const``, ``pers`` or ``var``."""
    local: bool
    type: Token
    name: Token
    array: bool
    value: Expression | None


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class Parameter:
    """What a routine is given."""

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
class Instruction(Node):
    """Calls an instruction or a procedure; its text ends behind the semicolon."""

    name: Token
    arguments: tuple[Argument, ...]
    compact: bool = False
    """It is all that an IF without THEN governs."""


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class Assignment(Node):
    """Gives a variable a value."""

    target: Reference
    value: Expression


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class Branches(Node):
    """IF or TEST: one of several branches is taken."""

    conditions: tuple[Expression, ...]
    branches: tuple[tuple["Statement", ...], ...]
    exhaustive: bool
    """One of the branches is always taken."""


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class Loop(Node):
    """FOR or WHILE."""

    counter: Token | None
    """Variable that a FOR declares."""
    conditions: tuple[Expression, ...]
    body: tuple["Statement", ...]


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class Label(Node):
    """Where a GOTO leads."""


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class Leave(Node):
    """RETURN, GOTO, RAISE, RETRY, TRYNEXT or EXIT: what follows in the text is not what follows in time."""

    keyword: str
    value: Expression | None


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


Statement = Instruction | Assignment | Branches | Loop | Label | Leave | Unparsed


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class Routine(Node):
    """A procedure, function or trap."""

    name: Token
    kind: str
    """``proc``, ``func`` or ``trap``."""
    local: bool
    parameters: tuple[Parameter, ...]
    declarations: tuple[Declaration, ...]
    body: tuple[Statement, ...]
    handlers: tuple[tuple[Statement, ...], ...]
    """What ERROR, UNDO and BACKWARD lead to."""

    @property
    def statements(self) -> "tuple[Statement, ...]":
        """Those of the body and of all handlers."""
        return (*self.body, *(statement for handler in self.handlers for statement in handler))


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class Module(Node):
    """A module."""

    name: Token
    declarations: tuple[Declaration, ...]
    records: tuple[Record, ...]
    routines: tuple[Routine, ...]
    unparsed: tuple[Unparsed, ...]
    """Text between declarations and routines that is neither."""
