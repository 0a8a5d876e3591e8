"""Labels of KRL: what holds where lines jump to them."""

from collections.abc import Sequence
from dataclasses import dataclass

from taskcal.programs.krl.blocks import Node, lines_in, name_of_label
from taskcal.programs.krl.flow import JUMPED, MOST_SCOUTS, NOTHING, Dropped
from taskcal.programs.krl.passing import Pass
from taskcal.programs.krl.state import State, merged
from taskcal.programs.krl.syntax import Control


@dataclass(eq=False, kw_only=True)
class Jumps(Pass):
    """A pass that goes through labels."""

    def at_label(self, label: Control, state: State) -> State:
        """What holds at a label, where the lines before it and all jumps so far lead to it."""
        name = name_of_label(label)
        waiting = self.gotos.setdefault(name, [])
        state = merged([state, *waiting], JUMPED)
        waiting.clear()
        if name in self.tree.labels.entered or (self.flow.all_ways and not state.reached):
            return self.lost(JUMPED)
        return state

    def again_from(self, nodes: Sequence[Node], i: int, label: Control, state: State) -> State:
        """From a label on, to which lines behind it may lead back."""
        flow, rest = self.flow, nodes[i + 1 :]
        waiting = self.gotos[name_of_label(label)]
        if flow.scouting or flow.all_ways:
            state = self.widened(state, rest, JUMPED)
            return self._once_from(nodes, i, waiting, state)[0]
        text = (self.routine.file.number, label.start)
        entry, cost = state, 1 + sum(1 for _ in lines_in(rest))
        state = flow.dropped.get(text, NOTHING).of(
            entry
        )  # most often a loop leads back with what it did in the turn before
        for _ in range(MOST_SCOUTS):
            end, joined = self._once_from(nodes, i, waiting, state)
            if joined == state:
                flow.dropped[text] = Dropped.between(entry, state)
                return end
            state = joined
            if not flow.may(cost):
                break
        return self._once_from(nodes, i, waiting, self.widened(state, rest, JUMPED))[0]

    def _once_from(self, nodes: Sequence[Node], i: int, waiting: list[State], state: State) -> tuple[State, State]:
        """What holds behind the lines from a label on, and what held there or holds where they lead back to it."""
        end = self.body(nodes, state, i + 1)
        joined = merged([state, *waiting], JUMPED)
        waiting.clear()
        return end, joined
