"""What data hold at some place of a program, as far as its flow tells."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace

from taskcal.programs.rapid.names import File, Symbol
from taskcal.programs.rapid.predefined import Value
from taskcal.programs.rapid.syntax import Aggregate, Argument, Component, Expression, Index


@dataclass(frozen=True, eq=False, kw_only=True)
class Origin:
    """Where a value is declared."""

    symbol: Symbol
    path: tuple[int, ...]
    """Which component or element of it, counted from 0."""
    type: str
    node: Expression | None
    """What is written there; None where only a larger whole is written."""
    selectors: tuple[Component | Index, ...]
    """How the reference says the path."""

    @property
    def name(self) -> str:
        """As ``p{3}`` or ``st{2}.pick``, with the value of each index."""
        items, text = iter(self.path), self.symbol.name
        for selector in self.selectors:
            match selector:
                case Index():
                    text += "{" + ",".join(str(next(items) + 1) for _ in selector.items) + "}"
                case Component():
                    next(items)
                    text += f".{selector.key}"
        return text


@dataclass(frozen=True, eq=False, kw_only=True)
class Handed:
    """How a parameter got what it holds: the argument of a call, and how that is read on the way to where it is used."""

    argument: Argument
    """Of the first call, where what is handed on is written."""
    file: File
    """Of that call."""
    origin: Origin | None
    """Declaration of what the argument names; None where it names none."""
    literal: Aggregate | None
    """What the argument writes out; None where it does not."""
    reads: frozenset[tuple[File, int]] = frozenset()
    """Files and first characters of the arguments by which routines hand it on."""
    parameters: tuple[Symbol, ...] = ()
    """Those that it has come through."""

    @property
    def source(self) -> tuple[object, ...]:
        """Equal for what comes from the same argument to the same parameters."""
        return (self.argument, self.parameters)


@dataclass(frozen=True, eq=False, kw_only=True)
class Held:
    """What data hold."""

    value: Value
    """Of no meaning where it is the declared one."""
    declared: bool = False
    """It is the value of their declaration, which still stands."""
    handed: Handed | None = None
    """How a parameter got it."""
    name: str = ""
    """Of the data whose value it is, where it was assigned as a whole; empty otherwise."""
    settable: bool = False
    """It comes from persistent data, which an operator may set by hand: nothing is decided by it."""

    def agrees(self, other: "Held") -> bool:
        """Whether two hold the same from the same place."""
        source = None if self.handed is None else self.handed.source
        others = None if other.handed is None else other.handed.source
        mine = (self.declared, self.name, source, self.settable)
        same = mine == (other.declared, other.name, others, other.settable)
        return self is other or (same and identical(self.value, other.value))


def identical(a: Value, b: Value) -> bool:
    """Whether two values are the same and of one type: a truth is not a number."""
    if isinstance(a, tuple) and isinstance(b, tuple):
        return a is b or (len(a) == len(b) and all(map(identical, a, b)))
    return type(a) is type(b) and a == b


Variables = Mapping[Symbol, Held]
"""What is known of variables; those that are missing hold their declared value, or nobody knows what."""

Before = frozenset[int | None]
"""Numbers of the motions that may have been the last one, None for any; empty where control does not come."""

ANY: Before = frozenset([None])


@dataclass(frozen=True, eq=False, kw_only=True)
class State:
    """What holds at a place of a program."""

    before: Before
    variables: Variables = field(default_factory=dict[Symbol, Held])

    @property
    def reached(self) -> bool:
        """Whether control comes there."""
        return bool(self.before)

    def behind(self, *before: int | None) -> "State":
        """The same behind other motions."""
        return replace(self, before=frozenset(before))

    def forgotten(self, symbols: Iterable[Symbol]) -> "State":
        """Where some data may hold anything."""
        lost = self.variables.keys() & set(symbols)
        if not lost:
            return self
        return replace(self, variables={k: v for k, v in self.variables.items() if k not in lost})

    def holding(self, held: Variables) -> "State":
        """Where some data hold something else."""
        return replace(self, variables={**self.variables, **held}) if held else self


NOWHERE = State(before=frozenset())
"""Where control does not come."""


def merged(states: Iterable[State]) -> State:
    """What holds after any of some ways through the program."""
    ways = [state for state in states if state.reached]
    if not ways:
        return NOWHERE
    first, *others = ways
    before = first.before.union(*(way.before for way in others))
    if all(way.variables is first.variables for way in others):
        return replace(first, before=before)
    return State(before=before, variables=dict(_common(first, others)))


def _common(first: State, others: Iterable[State]) -> Iterator[tuple[Symbol, Held]]:
    others = tuple(others)
    for symbol, held in first.variables.items():
        there = [other.variables.get(symbol) for other in others]
        if all(other is not None and held.agrees(other) for other in there):
            yield symbol, held
        elif all(other is not None and identical(held.value, other.value) for other in there):
            settable = held.settable or any(other.settable for other in there if other is not None)
            yield symbol, Held(value=held.value, settable=settable)
