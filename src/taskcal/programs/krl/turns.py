"""Loops of KRL: turn by turn where the text decides how many there are, else with what holds in all of them."""

from dataclasses import dataclass, replace

from taskcal.programs.krl.blocks import Loop, exits_of, lines_in
from taskcal.programs.krl.expressions import number_of
from taskcal.programs.krl.passing import Pass
from taskcal.programs.krl.routines import altered_by, keys_changed_by
from taskcal.programs.krl.state import NOWHERE, State, merged
from taskcal.programs.krl.variables import (
    forgotten,
)
from taskcal.programs.unresolved import Unresolved

MOST_TURNS = 1000
"""A loop of more turns is not gone through turn by turn."""

MOST_IDLE = 1000
"""Lines of all turns of a loop without motions that is gone through turn by turn."""


@dataclass(eq=False, kw_only=True)
class Turns(Pass):
    """A pass that goes through loops."""

    def loop(self, loop: Loop, state: State) -> State:
        """Go through a loop."""
        if not loop.body:
            return self._idle(loop, state)
        self.exits.append([])
        turns = {"FOR": self._for, "WHILE": self._while, "REPEAT": self._repeat, "LOOP": self._endless}
        once = self.flow.scouting or self.flow.all_ways
        end = self._some_turns(loop, state) if once else turns[loop.line.keyword](loop, state)
        return merged([end, *self.exits.pop()], f"it differs between the ways out of the {loop.line.keyword} before")

    def turn(self, loop: Loop, state: State) -> State:
        """One turn of a loop, with the functions that its conditions ask behind it."""
        return self.asked(loop.end, self.asked(loop.line, self.body(loop.body, state)))

    def _idle(self, loop: Loop, state: State) -> State:
        """A loop without any line of consequence."""
        if loop.line.keyword == "LOOP":
            return NOWHERE
        keys = keys_changed_by(loop.line, self.frames.names, self.flow.by_value, self.flow.changes)
        return replace(state, variables=forgotten(state.variables, keys))

    def _for(self, loop: Loop, state: State) -> State:
        counts = self._counts(loop, state)
        if counts is None:
            return self._some_turns(loop, state)
        first, last, step = counts
        turns = int((last - first) / step + 1e-9) + 1 if (last - first) / step >= 0.0 else 0
        if turns > MOST_TURNS or not self._worth(loop, turns) or not self.flow.may(turns * loop.size):
            return self._some_turns(loop, state)
        key, count = self.frames.names.key(loop.line.words[0].upper), first
        for _ in range(turns + 1):
            state = replace(state, variables={**state.variables, key: count})
            if not state.reached or (last - count) * step < 0.0:
                return state
            state = self.turn(loop, state)
            now = state.variables.get(key)  # the loop may set it, too, which then counts
            if state.reached and not isinstance(now, float):
                return self._some_turns(loop, state)
            count = now + step if isinstance(now, float) else count
        return self._some_turns(loop, state)

    def _worth(self, loop: Loop, turns: int) -> bool:
        """Whether a loop is gone through turn by turn: one without motions only if it is short, as one that computes points is."""
        if turns * loop.size <= MOST_IDLE:
            return True
        return any("motion" in altered_by(line, self.flow.alters) for line in lines_in(loop.body))

    def _counts(self, loop: Loop, state: State) -> tuple[float, float, float] | None:
        """First value, last one and step of a FOR; None where the text does not tell, or no counter is named."""
        words, names = loop.line.words, self.frames.names
        upper = [word.upper for word in words]
        if len(words) < 5 or upper[1] != "=" or "TO" not in upper or names.key(upper[0]) in names.volatile:
            return None
        to = upper.index("TO")
        by = upper.index("STEP") if "STEP" in upper else len(words)
        known = replace(self.frames.known(state), deciding=True)
        try:
            first, last = number_of(words[2:to], known), number_of(words[to + 1 : by], known)
            step = number_of(words[by + 1 :], known) if by < len(words) else 1.0
        except Unresolved:
            return None
        whole = first.is_integer() and last.is_integer() and step.is_integer()
        return (first, last, step) if whole and step else None

    def _while(self, loop: Loop, state: State) -> State:
        words = loop.line.words
        for _ in range(MOST_TURNS if any(word.kind == "name" for word in words) else 0):
            holds = self.truth(words, state)
            if holds is False or not state.reached:
                return state
            if holds is None or not self.flow.may(loop.size):
                break
            before, state = state, self.turn(loop, state)
            if state == before:
                return NOWHERE
        behind = self._some_turns(loop, state)
        return NOWHERE if [word.upper for word in words] == ["TRUE"] else behind

    def _repeat(self, loop: Loop, state: State) -> State:
        for _ in range(MOST_TURNS):
            holds = None
            with self.scouting():  # whether the condition is decided shows behind the turn
                end = self.turn(loop, state) if self.flow.may(loop.size) else None
                if end is not None:
                    holds = self.truth(loop.end.words, end)
            if end is None or (holds is None and end.reached) or not self.flow.may(loop.size):
                return self._some_turns(loop, state)
            state = self.turn(loop, state)
            if holds or not state.reached:
                return state
        return self._some_turns(loop, state)

    def _endless(self, loop: Loop, state: State) -> State:
        for _ in range(MOST_TURNS if exits_of(loop.body) else 0):
            with self.scouting():
                left = len(self.exits[-1])
                end = self.turn(loop, state) if self.flow.may(loop.size) else None
                undecided = end is not None and end.reached and len(self.exits[-1]) > left
            if end is None or undecided or not self.flow.may(loop.size):
                break
            before, state = state, self.turn(loop, state)
            if not state.reached or state == before:
                return NOWHERE
        return self._some_turns(loop, state)

    def _some_turns(self, loop: Loop, state: State) -> State:
        """A loop of which it is not known how often it is gone through: what holds behind it without EXIT."""
        keyword, reason = loop.line.keyword, "it is set further down in the same loop"
        if keyword == "FOR":
            keys = keys_changed_by(loop.line, self.frames.names, self.flow.by_value, self.flow.changes)
            state = replace(state, variables=forgotten(state.variables, keys))
        head = self.stable(state, (loop,), lambda entry: self.turn(loop, entry), reason)
        end = self.turn(loop, head)
        match keyword:
            case "LOOP":
                return NOWHERE
            case "REPEAT":
                return end
            case _:
                return head
