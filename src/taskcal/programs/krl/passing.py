"""What all passes through the lines of a KRL routine need: the expressions of a line, and what holds where ways meet."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Generator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace

from taskcal.programs.krl.blocks import Node, Tree, lines_in
from taskcal.programs.krl.expressions import Value, evaluated
from taskcal.programs.krl.flow import MOST_SCOUTS, Flow
from taskcal.programs.krl.frames import Frames
from taskcal.programs.krl.lexer import Word
from taskcal.programs.krl.routines import Routine, altered_by, calls_of, keys_changed_by
from taskcal.programs.krl.state import State, merged
from taskcal.programs.krl.syntax import Control, Statement
from taskcal.programs.krl.variables import (
    Holding,
    Lost,
    forgotten,
    without_places,
)
from taskcal.programs.unresolved import Unresolved


@dataclass(eq=False, kw_only=True)
class Pass(ABC):
    """One pass through a routine."""

    flow: Flow
    routine: Routine
    tree: Tree
    frames: Frames
    inside: tuple[str, ...]
    returns: list[tuple[State, Holding | None]] = field(default_factory=list[tuple[State, Holding | None]])
    """What holds where the routine is left before its end, and what it returns there."""
    exits: list[list[State]] = field(default_factory=list[list[State]])
    """What holds where the loops that are being gone through are left, the innermost last."""
    gotos: dict[str, list[State]] = field(default_factory=dict[str, list[State]])
    """What holds where labels are jumped to."""
    trigger: bool = False
    """A TRIGGER waits for the next motion."""

    @abstractmethod
    def body(self, nodes: Sequence[Node], state: State, start: int = 0) -> State:
        """Go through some lines, from one of them on."""

    def lost(self, reason: str) -> State:
        """Where anything may hold."""
        return self.flow.anything(reason)

    def stable(self, entry: State, nodes: Sequence[Node], run: Callable[[State], State], reason: str) -> State:
        """What holds each time that some lines begin which are gone through again and again."""
        cost = 1 + sum(1 for _ in lines_in(nodes))
        for _ in range(0 if self.flow.scouting else MOST_SCOUTS):
            if not self.flow.may(cost):
                break
            with self.scouting():
                again = run(entry)
            joined = merged([entry, again], reason)
            if joined == entry:
                return entry
            entry = joined
        return self.widened(entry, nodes, reason)

    def widened(self, state: State, nodes: Sequence[Node], reason: str) -> State:
        """Where some lines may have changed all that they change."""
        lines = tuple(lines_in(nodes))
        sets = frozenset[str]().union(*(altered_by(line, self.flow.alters) for line in lines))
        names, by_value, changes = self.frames.names, self.flow.by_value, self.flow.changes
        keys = frozenset[str]().union(*(keys_changed_by(line, names, by_value, changes) for line in lines))
        variables = {key: Lost(reason=f"{key.rpartition(':')[2]} is not the same in every turn") for key in keys}
        state = replace(
            state,
            variables={**without_places(forgotten(state.variables, keys)), **variables},
            armed=state.armed | self.flow.armed_by(self.routine, lines),
        )
        return state.forgotten(reason, sets | {"motion"})

    @contextmanager
    def scouting(self) -> Generator[None]:
        """Go through lines without leaving anything noted."""
        returns, exits = len(self.returns), [len(left) for left in self.exits]
        gotos, trigger = {name: list(states) for name, states in self.gotos.items()}, self.trigger
        self.flow.scouting += 1
        try:
            yield
        finally:
            self.flow.scouting -= 1
            del self.returns[returns:]
            for left, size in zip(self.exits, exits, strict=True):
                del left[size:]
            for name, states in self.gotos.items():
                states[:] = gotos.get(name, [])
            self.trigger = trigger

    def asked(self, line: Statement, state: State) -> State:
        """What holds behind functions in the expressions of a line."""
        for name in calls_of(line):
            state = self.flow.forget(name, state)
        if isinstance(line, Control) and line.changed:
            keys = (self.frames.names.key(name) for name in line.changed)
            state = replace(state, variables=forgotten(state.variables, keys))
        return state

    def truth(self, words: Sequence[Word], state: State) -> bool | None:
        """Whether a condition holds; None where the text does not tell."""
        value = self.value(words, state)
        return value if isinstance(value, bool) else None

    def value(self, words: Sequence[Word], state: State) -> Value | None:
        """The value of an expression by which ways are chosen; None where the text does not tell, or all are gone through."""
        if self.flow.all_ways:
            return None
        try:
            return evaluated(words, replace(self.frames.known(state), deciding=True))
        except Unresolved:
            return None
