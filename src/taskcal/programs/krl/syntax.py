"""What a line of KRL says, as far as it matters for where the robot goes."""

from dataclasses import dataclass, field
from typing import NamedTuple

from taskcal.programs.krl.lexer import Word

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
    """Variables handed to functions on the way."""
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
    """Variables handed to functions on the way."""
