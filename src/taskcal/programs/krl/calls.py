"""What a KRL routine leaves behind where it is called: its lines are followed with what holds at the call."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

from taskcal.programs.krl.routines import Routine
from taskcal.programs.krl.state import State
from taskcal.programs.krl.syntax import Call
from taskcal.programs.krl.variables import Known, Names, bound, forgotten, without_own

DEEPEST = 12
"""Calls in each other that are followed."""

MOST_PASSES = 4
"""As many lines as the program has, so many times, are gone through again for calls; behind that, what routines set is taken as
not known."""

Follow = Callable[[Routine, State, "Calls"], State]
"""Goes through a routine from what holds where it is called, without taking note of its motions; says what holds behind it."""


@dataclass(eq=False, kw_only=True)
class Calls:
    """The routines of a program, and how far calls have been followed."""

    routines: Mapping[str, list[Routine]]
    alters: Mapping[str, frozenset[str]]
    """By name of a routine: what of tool, base and the like it alters."""
    changes: Mapping[str, frozenset[str]]
    """By name of a routine: keys of the variables it changes."""
    names: Callable[[Routine], Names]
    follow: Follow
    called_at: dict[str, list[State]]
    """By name of a routine: what holds where it is called."""
    notes: bool = True
    """Whether calls are noted: not where a routine is gone through only for what it leaves behind."""
    inside: tuple[str, ...] = ()
    """Routines that are being gone through."""
    left: list[int]
    """How many lines may still be gone through for calls, in all."""

    def through(self, line: Call, known: Known, state: State) -> State:
        """What holds behind a call of a routine of the files.

        Args:
            line: the call.
            known: the values of variables there.
            state: what holds there.
        """
        (routine, *others) = self.routines[line.name]
        names = self.names(routine)
        given = zip(routine.parameters, line.arguments, strict=False)
        entry = replace(state, variables=bound(known, given, names))
        if self.notes:
            self.called_at[line.name].append(entry)
        spent = len(routine.lines) + 1
        if others or line.name in self.inside or len(self.inside) >= DEEPEST or spent > self.left[0]:
            return self.forget(line.name, state)
        self.left[0] -= spent
        inner = replace(self, inside=(*self.inside, line.name), notes=False)
        behind = self.follow(routine, entry, inner)
        variables = without_own(behind.variables, routine.prefix)
        own = {k: v for k, v in state.variables.items() if k.startswith(known.names.prefix)}
        return replace(behind, variables={**variables, **own})

    def forget(self, name: str, state: State) -> State:
        """What holds behind a routine that is not followed."""
        if name not in self.routines:
            return state
        variables = forgotten(state.variables, self.changes[name])
        return replace(state.forgotten(f"{name} sets it", self.alters[name]), variables=variables)
