"""One pass through the lines of a KRL routine, and through the routines that it calls."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from taskcal.programs.call_graph import DEEPEST
from taskcal.programs.krl.blocks import Branches, Loop, Node, Spline, name_of_label
from taskcal.programs.krl.calls import Arguments, behind_call, function_called
from taskcal.programs.krl.cursor import split_at_commas
from taskcal.programs.krl.flow import Flow
from taskcal.programs.krl.jumps import Jumps
from taskcal.programs.krl.parameters import handed_in_motion, handed_over
from taskcal.programs.krl.resolve import Resolver
from taskcal.programs.krl.routines import Routine, calls_of, keys_changed_by, only_computes
from taskcal.programs.krl.state import NOWHERE, State, merged
from taskcal.programs.krl.syntax import Assignment, Beside, Call, Control, Motion
from taskcal.programs.krl.turns import Turns
from taskcal.programs.krl.variables import (
    Holding,
    Lost,
    after_assignment,
    bound,
    element_assigned,
    forgotten,
    given_by,
    without_places,
)
from taskcal.programs.unresolved import Unresolved


@dataclass(eq=False, kw_only=True)
class Walk(Turns, Jumps):
    """One pass through a routine."""

    in_spline: bool = False

    def body(self, nodes: Sequence[Node], state: State, start: int = 0) -> State:
        """Go through some lines, from one of them on."""
        for i in range(start, len(nodes)):
            node = nodes[i]
            if isinstance(node, Control) and node.keyword == "LABEL":
                state = self.at_label(node, state)
                if state.reached and name_of_label(node) in self.tree.labels.backward:
                    return self.again_from(nodes, i, node, state)
                continue
            if not state.reached:
                if not self.flow.all_ways:
                    continue
                state = self.lost("nothing leads to it")
            state = self._step(node, self.flow.actions.weakened(state))
        return self.flow.actions.weakened(state)

    def _step(self, node: Node, state: State) -> State:
        match node:
            case Motion():
                return self._motion(node, state)
            case Assignment():
                return self._assignment(node, state)
            case Call():
                return self._call(node, state)
            case Branches():
                return self._branches(node, self.asked(node.line, state))
            case Loop():
                return self.loop(node, self.asked(node.line, state))
            case Beside():
                return self._beside(node, state)
            case Spline():
                self.in_spline = True
                state = self.body(node.body, replace(state, last=None))
                self.in_spline = False
                return state
            case Control():
                return self._control(node, self.asked(node, state))
            case _:
                return state

    def _control(self, line: Control, state: State) -> State:
        match line.keyword:
            case "RETURN":
                self.returns.append((state, self._returned(line, state)))
                return NOWHERE
            case "GOTO":
                self.gotos.setdefault(name_of_label(line), []).append(state)
                return NOWHERE
            case "EXIT" if self.exits and self.tree.odd is None:
                self.exits[-1].append(state)
                return NOWHERE
            case "RESUME":
                return NOWHERE
            case _:
                return self.lost(f"the blocks of {self.routine.name} do not match")

    def _beside(self, line: Beside, state: State) -> State:
        self.trigger = self.trigger or line.keyword == "TRIGGER"
        actions, text = self.flow.actions, (self.routine.file.number, line.start)
        if not self.flow.scouting:
            for said in actions.missing.get(text, ()):
                self.flow.findings.diagnose(self.routine.file, line.start, said)
        started, ended = actions.started.get(text, frozenset()), actions.ended.get(text, frozenset())
        return replace(state, armed=(state.armed - ended) | started)

    def _returned(self, line: Control, state: State) -> Holding | None:
        return given_by(line.words, self.frames.known(state)) if line.words else None

    def _assignment(self, line: Assignment, state: State) -> State:
        returned = None
        called = function_called(line.words, self.flow.routines, self.flow.by_value)
        if called is None:
            state = self.asked(line, state)
            keys = (self.frames.names.key(name) for name in line.changed)
            state = replace(state, variables=forgotten(state.variables, keys))
        else:
            state, returned = self._follow(called, state)
            returned = (
                Lost(reason=f"what {called.name} returns is known only at run time") if returned is None else returned
            )
            if not state.reached:
                return NOWHERE
        known = self.frames.known(state)
        if line.index is not None and not self.flow.scouting and line.variable not in self.frames.names.own:
            self._note_element(line, element_assigned(known, line))
        if (
            line.component or len(line.words) > 1
        ):  # what is set to the robot's place as a whole is that place, wherever it is
            resolver = Resolver(findings=self.flow.findings, routine=self.routine, frames=self.frames)
            known = replace(known, here=resolver.position(state))
        variables = after_assignment(known, line, returned)
        return replace(self.frames.after_assignment(state, line, variables), variables=variables)

    def _note_element(self, line: Assignment, element: str | None) -> None:
        """Note which element an assignment sets."""
        text = (self.routine.file.number, line.start)
        known = self.flow.elements.setdefault(text, set())
        if element is None or self.flow.all_ways:
            self.flow.elements[text] = None
        elif known is not None:
            known.add(f"{line.variable}[{element.partition('[')[2]}")

    def _call(self, line: Call, state: State) -> State:
        if line.name == "BAS":
            keys = keys_changed_by(line, self.frames.names, self.flow.by_value, {})
            return self.frames.after_bas(replace(state, variables=forgotten(state.variables, keys)), line)
        for name in calls_of(line)[1:]:
            state = self.flow.forget(name, state)
        arguments = Arguments(name=line.name, words=line.arguments, handed=handed_over(line, self.flow.by_value))
        if line.name in self.flow.routines:
            state, _ = self._follow(arguments, state)
            return state
        if not self.flow.scouting:
            text = f"{line.name} is not in the files given; it is taken to leave $TOOL, $BASE and $IPO_MODE as they are"
            self.flow.findings.diagnose(self.routine.file, line.start, text)
        keys = (self.frames.names.key(name) for name in arguments.handed)
        return replace(state, last=None, variables=forgotten(state.variables, keys))

    def _follow(self, call: Arguments, state: State) -> tuple[State, Holding | None]:
        """What holds behind a call of a routine of the files, and what it returns."""
        flow, names = self.flow, self.frames.names
        known = self.frames.known(state)
        (routine, *others) = flow.routines[call.name]
        keys = frozenset(map(names.key, call.handed))
        too_deep = call.name in self.inside or len(self.inside) > DEEPEST
        if flow.idle(call.name):
            return flow.lost_by(call.name, replace(state, variables=forgotten(state.variables, keys))), None
        if others or too_deep or not flow.may(1 + len(routine.lines)):
            state = replace(state, variables=forgotten(state.variables, keys))
            return flow.forget(call.name, state), None
        inner = flow.frames(routine).names
        given = zip(routine.parameters, call.words, strict=False)
        # what is handed over by reference has two names inside: only the parameter's is followed
        variables = forgotten(bound(known, given, inner), keys)
        behind, value = through(flow, routine, replace(state, variables=variables), self.inside)
        if self.routine.name in flow.resuming:
            left = flow.lost_by(call.name, replace(state, variables=forgotten(state.variables, keys)))
            behind = merged([behind, replace(left, last=None)], "an interrupt may resume behind it")
        if not behind.reached:
            return NOWHERE, value
        if not flow.all_ways:
            variables = behind_call(call, routine, behind.variables, names, flow.changes[call.name])
        else:
            variables = forgotten(behind.variables, keys)
        return replace(behind, variables=variables), value

    def _motion(self, line: Motion, state: State) -> State:
        findings, file = self.flow.findings, self.routine.file
        resolver = Resolver(findings=findings, routine=self.routine, frames=self.frames)
        if resolver.stays_there(line, state):
            return state
        state, returned = self._points_returned(line, state)
        if not state.reached:
            return NOWHERE
        behind = replace(state, last=None, variables=without_places(state.variables))
        if self.flow.scouting:
            return behind
        trigger, self.trigger = self.trigger, False
        if self.flow.all_ways and (file.number, line.start) in findings.seen:
            return behind
        try:
            move, site = resolver.resolve(line, state, in_spline=self.in_spline, returned=returned)
        except Unresolved as trouble:
            findings.fail(file, line, str(trouble))
            return behind
        if trigger:
            text = "a TRIGGER acts along this motion; check it if the motion is divided"
            findings.diagnose(file, line.start, text)
        number = findings.note(move, site, None if self.in_spline else state.last)
        return replace(behind, last=number)

    def _points_returned(self, line: Motion, state: State) -> tuple[State, dict[int, Holding]]:
        """What holds behind the program's functions in a motion, and what they return of its points, by their first character."""
        returned: dict[int, Holding] = {}
        for operand in line.operands:
            words = () if operand.parts else line.words_of(operand)
            called = function_called(words, self.flow.routines, self.flow.by_value)
            if called is not None and state.reached:
                state, value = self._follow(called, state)
                returned[operand.start] = self._of_function(called.name, value)
        if len(returned) < sum(name in self.flow.routines for name in calls_of(line)):
            state = self.asked(line, state)
            keys = map(self.frames.names.key, handed_in_motion(line, self.flow.by_value))
            state = replace(state, variables=forgotten(state.variables, keys))
        return state, returned

    def _of_function(self, name: str, value: Holding | None) -> Holding:
        """What a function returns of a point, whose numbers may take the place of its call."""
        if value is None:
            return Lost(reason=f"what {name} returns is known only at run time")
        if not all(only_computes(routine, self.flow.routines) for routine in self.flow.routines[name]):
            return Lost(reason=f"its point comes from {name}, which does more than compute it")
        return value

    def _branches(self, node: Branches, state: State) -> State:
        reason = f"it is set in one branch of the {node.line.keyword} before and not, or differently, in another"
        ends: list[State] = []
        for line, body in node.branches:
            taken = self._taken(node, line, state)
            if taken is not False:
                ends.append(self.body(body, state))
            if taken or line.keyword in ("ELSE", "DEFAULT"):
                return merged([NOWHERE, *ends], reason)
        return merged([*ends, state], reason)

    def _taken(self, node: Branches, line: Control, state: State) -> bool | None:
        """Whether a branch is taken, if none before it is; None where the text does not tell."""
        if node.line.keyword == "IF":
            words = node.line.words
            words = words[:-1] if words and words[-1].upper == "THEN" else words
            holds = self.truth(words, state)
            return holds if line is node.line or holds is None else not holds
        if line.keyword == "DEFAULT":
            return None
        chosen = self.value(node.line.words, state)
        cases = [self.value(words, state) for words in split_at_commas(line.words)]
        if chosen is None or any(type(case) is not type(chosen) for case in cases):
            return None
        return chosen in cases


def through(flow: Flow, routine: Routine, entry: State, inside: tuple[str, ...] = ()) -> tuple[State, Holding | None]:
    """Go through a routine.

    Args:
        flow: the program.
        routine: the routine.
        entry: what holds at its start, its parameters included.
        inside: names of the routines that are being gone through.

    Returns:
        What holds behind it, its own variables included, and what it returns.
    """
    tree = flow.trees[routine]
    walk = Walk(flow=flow, routine=routine, tree=tree, frames=flow.frames(routine), inside=(*inside, routine.name))
    if tree.odd is not None and not flow.scouting:
        text = f"{tree.odd.keyword} does not match the blocks of {routine.name}; what holds behind it is not known"
        flow.findings.diagnose(routine.file, tree.odd.start, text)
    end = walk.body(tree.nodes, entry)
    states = [*(state for state, _ in walk.returns), end]
    values = {repr(value): value for _, value in walk.returns}
    value = next(iter(values.values())) if len(values) == 1 else None
    state = merged(states, f"it differs between the ends of {routine.name}")
    local = state.armed & flow.actions.local.get(routine.name, frozenset())
    return replace(state, armed=state.armed - local) if local else state, value
