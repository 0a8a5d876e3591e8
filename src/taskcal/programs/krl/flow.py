"""The flow of a KRL program: what holds where each motion begins, through calls, branches, loops and jumps.

What cannot be decided is gone through in all ways; behind them holds what is the same in all.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

from taskcal.programs.krl.beside import Actions
from taskcal.programs.krl.blocks import Tree
from taskcal.programs.krl.findings import Findings, Text
from taskcal.programs.krl.frames import Frames
from taskcal.programs.krl.routines import Routine, calls_of
from taskcal.programs.krl.state import State, differing
from taskcal.programs.krl.syntax import Statement
from taskcal.programs.krl.variables import (
    forgotten,
)

JUMPED = "it can be reached by a GOTO"

MOST_IDLE_CALLS = 40
"""So often a routine without motions is followed; behind further calls, what it changes is not known."""

MOST_SCOUTS = 3
"""So often a loop is gone through to find what holds at the start of every turn; behind that, what it changes is not known."""


@dataclass(frozen=True, kw_only=True)
class Dropped:
    """What of a state does not hold any more where several ways meet."""

    what: frozenset[str] = frozenset()
    """Of tool, base and the like."""
    keys: frozenset[str] = frozenset()
    """Of variables, with their index."""

    @classmethod
    def between(cls, entry: State, joined: State) -> "Dropped":
        """What one state has and the other not."""
        return cls(what=differing(entry, joined), keys=frozenset(entry.variables.keys() - joined.variables.keys()))

    def of(self, state: State) -> State:
        """A state without it."""
        if not self.what and not self.keys:
            return state
        variables = {key: value for key, value in state.variables.items() if key not in self.keys}
        return replace(state.forgotten(JUMPED, self.what), variables=variables)


NOTHING = Dropped()


@dataclass(eq=False, kw_only=True)
class Flow:
    """The routines of a program, and how far they have been followed."""

    findings: Findings
    routines: Mapping[str, Sequence[Routine]]
    trees: Mapping[Routine, Tree]
    frames: Callable[[Routine], Frames]
    alters: Mapping[str, frozenset[str]]
    """By name of a routine: what of tool, base and the like it alters."""
    changes: Mapping[str, frozenset[str]]
    """By name of a routine: keys of the variables it changes."""
    by_value: Mapping[str, tuple[bool, ...]]
    actions: Actions
    """What may run beside the lines."""
    resuming: frozenset[str]
    """Routines behind whose calls an interrupt may resume that left what they call."""
    left: int
    """How many lines may still be gone through for calls and the turns of loops, in all."""
    scouting: int = 0
    """Lines are gone through only for what they leave behind: motions are not noted, loops not taken turn by turn."""
    all_ways: bool = False
    """Ways that are never taken are gone through, too."""
    anywhere: set[str] = field(default_factory=set[str])
    """Routines that are called where that is not followed."""
    idle_calls: dict[str, int] = field(default_factory=dict[str, int])
    """By name of a routine that neither moves nor sets tool, base and the like: how often it was followed."""
    dropped: dict[Text, Dropped] = field(default_factory=dict[Text, Dropped])
    """By label to which lines lead back: what they had changed when it was gone through last."""
    elements: dict[Text, set[str] | None] = field(default_factory=dict[Text, set[str] | None])
    """By assignment to an element by a computed index: which elements it sets; None where that is not known."""

    def may(self, lines: int) -> bool:
        """Whether so many lines may still be gone through once more; if so, they count."""
        if lines > self.left:
            return False
        self.left -= lines
        return True

    def idle(self, name: str) -> bool:
        """Whether a call is not followed because the routine moves nothing and was followed often, as those for messages are."""
        if self.alters[name]:
            return False
        self.idle_calls[name] = self.idle_calls.get(name, 0) + 1
        return self.idle_calls[name] > MOST_IDLE_CALLS

    def forget(self, name: str, state: State) -> State:
        """What holds behind a routine that is not followed."""
        if name not in self.routines:
            return state
        self.anywhere.add(name)
        return self.lost_by(name, state)

    def lost_by(self, name: str, state: State) -> State:
        """Where a routine may have left anything that it changes."""
        variables = forgotten(state.variables, self.changes[name])
        armed = state.armed | self.actions.by_routine.get(name, frozenset())
        return replace(state.forgotten(f"{name} sets it", self.alters[name]), variables=variables, armed=armed)

    def armed_by(self, routine: Routine, lines: Sequence[Statement]) -> frozenset[Text]:
        """What some lines of a routine may start."""
        started, by_routine = self.actions.started, self.actions.by_routine
        return frozenset[Text]().union(
            *(started.get((routine.file.number, line.start), frozenset()) for line in lines),
            *(by_routine.get(name, frozenset()) for line in lines for name in calls_of(line)),
        )

    def anything(self, reason: str) -> State:
        """Where anything may hold, and any action may have been started."""
        return replace(State.unset().forgotten(reason), armed=self.actions.all)
