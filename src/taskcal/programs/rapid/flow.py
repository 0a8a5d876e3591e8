"""The flow of a RAPID program: what holds where each motion begins, through calls, branches and loops."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace

from taskcal.programs.call_graph import DEEPEST
from taskcal.programs.rapid.assigning import after_assignment, counting
from taskcal.programs.rapid.calls import at_entry, handed_over, own_symbols
from taskcal.programs.rapid.effects import SOFT, Effects
from taskcal.programs.rapid.held import ANY, NOWHERE, Before, Held, State, merged
from taskcal.programs.rapid.motion_forms import MOTION_FORMS, ONLY_EXTERNAL
from taskcal.programs.rapid.moving import called, calls, is_late, is_motion, is_read, moves, nested
from taskcal.programs.rapid.names import Context, Scope, Symbol
from taskcal.programs.rapid.predefined import SOFTENING, STIFFENING
from taskcal.programs.rapid.syntax import (
    Assignment,
    Branches,
    Expression,
    Instruction,
    Label,
    Leave,
    Loop,
    Reference,
    Routine,
    Statement,
    Unparsed,
    parts,
)
from taskcal.programs.rapid.values import Values
from taskcal.programs.unresolved import Unresolved

LEAVING = ("exitcycle", "systemstopaction")

MOST_TURNS = 1000
"""A loop of more turns is not gone through turn by turn."""


Resolve = Callable[[Instruction, Scope, Context, State], int | None]
"""Resolves a motion, given what holds before it, and says its number; None where it could not be resolved."""


@dataclass(eq=False, kw_only=True)
class Flow:
    """The routines of a program, and how far they have been followed."""

    contexts: Mapping[Routine, Context]
    effects: Effects
    values: Values
    resolve: Resolve
    left: int
    """How many statements may still be gone through for calls and the turns of loops, in all."""
    anywhere: set[Routine] = field(default_factory=set[Routine])
    """Routines that are called where that is not followed, so that anything may hold there."""
    all_ways: bool = False
    """Ways that are never taken are gone through, too."""
    scopes: dict[Loop, Scope] = field(default_factory=dict[Loop, Scope])
    """Of the bodies of loops, so that one counter is one symbol."""
    sizes: dict[Routine | Loop, int] = field(default_factory=dict[Routine | Loop, int])

    def through(self, context: Context, entry: State, inside: tuple[Routine, ...] = ()) -> State:
        """Go through a routine.

        Args:
            context: the routine.
            entry: what holds at its start, its parameters included.
            inside: routines that are being gone through.

        Returns:
            What holds behind it.
        """
        routine = context.routine
        if routine is None:
            return entry
        # an error handler may move the robot and then resume anywhere
        resumes = any(moves(handler, context.scope) for handler in routine.handlers)
        walk = _Walk(flow=self, context=context, always=ANY if resumes else frozenset(), inside=(*inside, routine))
        end = walk.block(routine.body, context.scope, entry)
        own = self.effects.of_routine[routine] if routine.handlers else frozenset[Symbol]()
        for handler in routine.handlers:
            walk.block(handler, context.scope, replace(entry, before=ANY).forgotten(own))
        return merged([*walk.returns, end])

    def size(self, of: Routine | Loop, body: Iterable[Statement]) -> int:
        """How many statements a routine or a loop has."""
        if of not in self.sizes:
            self.sizes[of] = 1 + sum(1 for _ in nested(body))
        return self.sizes[of]

    def may(self, statements: int) -> bool:
        """Whether so many statements may still be gone through once more; if so, they count."""
        if statements > self.left:
            return False
        self.left -= statements
        return True


@dataclass(eq=False, kw_only=True)
class _Walk:
    """One pass through a routine."""

    flow: Flow
    context: Context
    always: Before
    inside: tuple[Routine, ...]
    returns: list[State] = field(default_factory=list[State])
    """What holds where the routine is left before its end."""

    def block(self, block: Iterable[Statement], scope: Scope, state: State) -> State:
        for statement in block:
            if self.always - state.before:
                state = replace(state, before=state.before | self.always)
            if self.flow.all_ways and not state.reached:
                state = State(before=ANY)
            state = self.statement(statement, scope, state)
        return state

    def statement(self, statement: Statement, scope: Scope, state: State) -> State:
        match statement:
            case Instruction():
                return self._instruction(statement, scope, state)
            case Assignment():
                return self._assignment(statement, scope, state)
            case Branches():
                return self._branches(statement, scope, state)
            case Loop():
                return self._loop(statement, scope, state)
            case Leave():
                if statement.value is not None:
                    state = self._asked(statement, [statement.value], scope, state)
                if statement.keyword == "return":
                    self.returns.append(state)
                return NOWHERE
            case Label() | Unparsed():
                self.flow.anywhere.update(called([statement], scope))
                return self._lost(state)

    def _assignment(self, assignment: Assignment, scope: Scope, state: State) -> State:
        state = self._asked(assignment, [assignment.value], scope, state)
        values = self.flow.values.at(state.variables)
        return after_assignment(assignment, scope, state, values, self.flow.effects.volatile)

    def _lost(self, state: State) -> State:
        """Where control may come from anywhere in the routine: what nothing ever changes still holds."""
        changed = self.flow.effects.changes.assigned.keys()
        parameters = {symbol for symbol in state.variables if self._assigned(symbol.parameter_of, symbol.name)}
        return replace(state, before=ANY).forgotten(changed | parameters | {SOFT})

    def _assigned(self, routine: str, parameter: str) -> bool:
        return (routine, parameter.lower()) in self.flow.effects.changes.parameters

    def _asked(
        self, statement: Assignment | Leave, expressions: Iterable[Expression], scope: Scope, state: State
    ) -> State:
        """What holds behind the functions in some expressions of a statement."""
        if not any(calls(expression, scope) for expression in expressions):
            return state
        self.flow.anywhere.update(called([statement], scope))
        state = state.forgotten(self.flow.effects.of(statement, scope, self.context.file))
        return replace(state, before=ANY) if state.reached else state

    def _instruction(self, instruction: Instruction, scope: Scope, state: State) -> State:
        key = instruction.name.key
        effects = self.flow.effects
        if is_read(instruction, scope):
            number = self.flow.resolve(instruction, scope, self.context, state)
            state = state.forgotten(effects.of(instruction, scope, self.context.file))
            return state.behind(number) if MOTION_FORMS[key].ends_there else state.behind(None)
        if key in scope.routines:
            return self._call(instruction, scope, state)
        if (counted := counting(instruction)) is not None:
            return self._assignment(counted, scope, state)
        if key in LEAVING:
            return NOWHERE
        if is_late(instruction, scope):
            self.flow.anywhere.update(self.flow.contexts)
            return self._lost(state)
        if key != ONLY_EXTERNAL and is_motion(instruction, scope):
            self.flow.resolve(instruction, scope, self.context, state)
        moved = key == ONLY_EXTERNAL or is_motion(instruction, scope) or moves([instruction], scope)
        self.flow.anywhere.update(called([instruction], scope))
        state = state.forgotten(effects.of(instruction, scope, self.context.file))
        if key in (SOFTENING, STIFFENING) and SOFT not in effects.volatile:
            state = state.holding({SOFT: Held(value=key == SOFTENING)})
        return replace(state, before=ANY) if moved and state.reached else state

    def _call(self, instruction: Instruction, scope: Scope, state: State) -> State:
        flow, file = self.flow, self.context.file
        (routine, *others) = scope.routines[instruction.name.key]
        context = flow.contexts[routine]
        asked = [a.value for a in instruction.arguments if a.value is not None]
        if any(calls(node, scope) for node in asked):
            flow.anywhere.update(r for r in called([instruction], scope) if r is not routine)
        cost = flow.size(routine, routine.body)
        hidden = routine.local and context.module is not self.context.module
        if others or hidden or routine in self.inside or len(self.inside) > DEEPEST or not flow.may(cost):
            flow.anywhere.update((routine, *others))
            state = state.forgotten(flow.effects.of(instruction, scope, file))
            return replace(state, before=ANY) if state.reached else state
        handed = dict(handed_over(instruction, context, scope, file, flow.values.at(state.variables)))
        changed = flow.effects.of_arguments(instruction, scope, file)
        state = state.forgotten(changed)
        behind = flow.through(context, at_entry(state, context, flow.effects.volatile).holding(handed), self.inside)
        return behind.forgotten(changed | own_symbols(context))

    def _branches(self, statement: Branches, scope: Scope, state: State) -> State:
        """IF and TEST; of an IF only the branches that may be taken, as far as the text tells."""
        state = self._conditions_asked(statement, scope, state)
        tests = len(statement.conditions) != len(statement.branches) - statement.exhaustive
        ends: list[State] = []
        for i, branch in enumerate(statement.branches):
            last = statement.exhaustive and i == len(statement.branches) - 1
            taken = True if last and not tests else None
            if not last and not tests:
                taken = self._truth(statement.conditions[i], scope, state)
            if taken is not False:
                ends.append(self.block(branch, scope, state))
            if taken:
                return merged(ends)
        return merged(ends if statement.exhaustive else [*ends, state])

    def _conditions_asked(self, statement: Branches | Loop, scope: Scope, state: State) -> State:
        if not any(calls(condition, scope) for condition in statement.conditions):
            return state
        self.flow.anywhere.update(called([statement], scope))
        state = state.forgotten(self.flow.effects.of(statement, scope, self.context.file))
        return replace(state, before=ANY) if state.reached else state

    def _truth(self, condition: Expression, scope: Scope, state: State) -> bool | None:
        """Whether a condition holds; None where the text does not tell."""
        if self.flow.all_ways:
            return None
        values = self.flow.values.at(state.variables)
        try:
            value = None if values.settable(condition, scope) else values.of(condition, scope)
        except Unresolved:
            return None
        return value if isinstance(value, bool) else None

    def _loop(self, loop: Loop, scope: Scope, state: State) -> State:
        state = self._conditions_asked(loop, scope, state)
        inside = self.flow.scopes.setdefault(loop, scope.with_counter(loop.counter))
        if not state.reached:
            return self._some_turns(loop, inside, state)
        if loop.counter is None:
            return self._while(loop, inside, state)
        counts = self._counts(loop, scope, state)
        size = self.flow.size(loop, loop.body)
        if counts is None or not self.flow.may(size * len(counts)):
            return self._some_turns(loop, inside, state)
        counter = inside.own[loop.counter.key][0]
        for count in counts:
            state = self.block(loop.body, inside, state.holding({counter: Held(value=count)}))
        return state.forgotten([counter])

    def _counts(self, loop: Loop, scope: Scope, state: State) -> list[float] | None:
        """What a FOR counts; None where the text does not tell, or it is much."""
        if self.flow.all_ways:
            return None
        values = self.flow.values.at(state.variables)
        try:
            if any(values.settable(bound, scope) for bound in loop.conditions):
                return None
            first, last, *step = (values.number(bound, scope) for bound in loop.conditions)
        except Unresolved:
            return None
        by = step[0] if step else (1.0 if first <= last else -1.0)
        turns = (last - first) / by + 1.0 if by else 0.0
        if not by or not 0.0 <= turns <= MOST_TURNS:
            return [] if by and turns < 0.0 else None
        return [first + k * by for k in range(int(turns + 1e-9))]

    def _while(self, loop: Loop, inside: Scope, state: State) -> State:
        (condition,) = loop.conditions
        size = self.flow.size(loop, loop.body)
        for _ in range(MOST_TURNS if any(isinstance(part, Reference) for part in parts(condition)) else 0):
            holds = self._truth(condition, inside, state)
            if holds is False:
                return state
            if holds is None or not self.flow.may(size):
                break
            before, state = state, self.block(loop.body, inside, state)
            if not state.reached or merged([before, state]).variables == before.variables:
                break
        endless = self._truth(condition, inside, state.forgotten(self.flow.effects.of(loop, inside, self.context.file)))
        behind = self._some_turns(loop, inside, state)
        return NOWHERE if endless else behind

    def _some_turns(self, loop: Loop, inside: Scope, state: State) -> State:
        """A loop of which it is not known how often it is gone through."""
        state = state.forgotten(self.flow.effects.of(loop, inside, self.context.file))
        if state.reached and moves(loop.body, inside):
            state = replace(state, before=state.before | ANY)
        return merged([state, self.block(loop.body, inside, state)])
