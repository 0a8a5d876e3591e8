"""Where a RAPID program begins, and what holds there."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

from taskcal.programs.call_graph import MOST_PASSES, with_called
from taskcal.programs.rapid.calls import at_entry, initial
from taskcal.programs.rapid.effects import SOFT, Effects
from taskcal.programs.rapid.findings import Findings
from taskcal.programs.rapid.flow import Flow
from taskcal.programs.rapid.held import ANY, Held, State, merged
from taskcal.programs.rapid.moving import ANY_ROUTINE, called, is_motion, is_read, may_call, nested
from taskcal.programs.rapid.names import Context, Symbol
from taskcal.programs.rapid.syntax import Instruction, Routine
from taskcal.programs.rapid.values import Values

LEAST_LEFT = 5000
"""As many statements may be gone through again in any program."""

MAIN = "main"
"""The routine in which a program begins, again and again."""


def follow_program(everywhere: Sequence[Context], effects: Effects, values: Values, findings: Findings) -> None:
    """Go through a program from each routine that nothing calls, and find its motions."""
    contexts = {context.routine: context for context in everywhere if context.routine is not None}
    size = sum(1 for routine in contexts for _ in nested(routine.statements))
    flow = Flow(
        contexts=contexts, effects=effects, values=values, resolve=findings, left=MOST_PASSES * size + LEAST_LEFT
    )
    roots = _roots(contexts)
    lent = _lent(contexts, effects)

    def begin(routine: Routine) -> None:
        own = lent.get(routine)
        flow.values = Values(assigned={**own, **values.assigned}) if own else values
        findings.settings = replace(findings.settings, values=flow.values)

    for routine, context in contexts.items():
        if routine in roots:
            begin(routine)
            flow.through(context, at_entry(_start(flow, context, everywhere), context, effects.volatile))
    done = set[Routine]()
    while flow.anywhere - done:  # called where that is not followed: anything may hold there
        for routine in [routine for routine in contexts if routine in flow.anywhere - done]:
            done.add(routine)
            begin(routine)
            flow.through(contexts[routine], at_entry(State(before=ANY), contexts[routine], effects.volatile))
    findings.seldom = flow.all_ways = True
    flow.left = 0
    for routine, context in contexts.items():
        if any(_is_left(statement, context, findings) for statement in nested(routine.statements)):
            begin(routine)
            flow.through(context, at_entry(State(before=ANY), context, effects.volatile))


def _lent(contexts: Mapping[Routine, Context], effects: Effects) -> dict[Routine, dict[Symbol, str]]:
    """Tools and work objects that are given to routines that are not in the files, on any way that leads through a routine.

    They may be changed there, and stay so when the way is gone again. A routine that nothing in the files calls is a program of
    its own, such as one by which an operator calibrates a tool: the others start from what the files declare.
    """
    own = effects.changes.lent
    if not own:
        return {}
    calls = {routine: may_call(routine.statements, context.scope) for routine, context in contexts.items()}
    if any(ANY_ROUTINE in others for others in calls.values()):
        calls[ANY_ROUTINE] = frozenset(contexts)
    within = with_called({r: (frozenset(own.get(r, {}).items()), others) for r, others in calls.items()})
    callers: dict[Routine, set[Routine]] = {routine: set() for routine in calls}
    for routine, others in calls.items():
        for other in others:
            callers[other].add(routine)
    given = with_called({routine: (within[routine], frozenset(ways)) for routine, ways in callers.items()})
    return {routine: dict(sorted(lent, key=lambda one: one[1])) for routine, lent in given.items()}


def _is_left(statement: object, context: Context, findings: Findings) -> bool:
    if not isinstance(statement, Instruction) or statement in findings.seen:
        return False
    return is_read(statement, context.scope) or is_motion(statement, context.scope)


def _roots(contexts: dict[Routine, Context]) -> frozenset[Routine]:
    """Routines that nothing calls, and those that are called from elsewhere as well: traps and functions."""
    own = frozenset(
        other
        for routine, context in contexts.items()
        for other in called(routine.statements, context.scope)
        if other is not routine
    )
    return frozenset(r for r in contexts if r not in own or r.kind != "proc" or r.name.key == MAIN)


def _start(flow: Flow, context: Context, everywhere: Sequence[Context]) -> State:
    """What holds where a root begins: in main the declared values of variables, if it leaves them as they were.

    A controller declares variables anew where the program pointer is moved to main, and keeps them where main begins again
    behind its end.
    """
    routine, effects = context.routine, flow.effects
    softened = any(SOFT in changed for changed in effects.of_routine.values()) and SOFT not in effects.volatile
    stiff = {SOFT: Held(value=False)} if softened else {}
    if routine is None or routine.name.key != MAIN:
        return State(before=ANY, variables=stiff)
    fresh = {symbol: held for symbol, held in _declared(everywhere).items() if symbol not in effects.volatile} | stiff
    if not fresh:
        return State(before=ANY)
    start = State(before=ANY, variables=fresh)
    quiet = Flow(
        contexts=flow.contexts, effects=flow.effects, values=flow.values, resolve=lambda *_: None, left=flow.left
    )
    while True:
        behind = quiet.through(context, at_entry(start, context, flow.effects.volatile))
        again = merged([start, behind])
        if len(again.variables) >= len(start.variables) or not behind.reached:
            return start
        kept = {symbol: held for symbol, held in start.variables.items() if symbol in again.variables}
        start = State(before=ANY, variables=kept)


def _declared(everywhere: Sequence[Context]) -> dict[Symbol, Held]:
    return {
        symbol: held
        for context in everywhere
        if context.routine is None
        for symbol in context.declared
        for held in [initial(symbol)]
        if held is not None
    }
