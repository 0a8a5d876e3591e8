"""From the files of a RAPID program to its motions: what holds where each begins, through calls, branches and loops."""

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

from robot_programs.core import flow as form
from robot_programs.core.errors import FileError
from robot_programs.core.flow import MIN_LINES
from robot_programs.core.program import Diagnostic, Frame, Unresolved
from robot_programs.core.source import Source, uncollected
from robot_programs.core.values import Lost
from robot_programs.rapid.changes import (
    SOFT,
    Effects,
    called,
    calls,
    changed_by,
    changed_in,
    changes,
    effects_of,
    is_late,
    is_motion,
    is_read,
    is_strange,
    moves,
    returns_values,
    uses,
)
from robot_programs.rapid.names import (
    BY_NAME,
    FUNCTIONS,
    IDENTITY,
    LATE,
    MOTIONLESS,
    MOVING,
    OFFSETTING,
    SHIFTING,
    SOFTENING,
    STIFFENING,
    TURNING,
    ZERO_LOAD,
    Context,
    File,
    Scope,
    Symbol,
    Value,
    contexts,
)
from robot_programs.rapid.parse import parse
from robot_programs.rapid.resolve import (
    MOTION_FORMS,
    ONLY_EXTERNAL,
    SUFFIX,
    Resolved,
    Settings,
    Site,
    TargetArgument,
    base_frame,
    motion_of,
    poses_of,
    resolve,
    target_arguments,
)
from robot_programs.rapid.rewrite import RapidProgram
from robot_programs.rapid.syntax import (
    Aggregate,
    Argument,
    Assignment,
    Call,
    Control,
    Expression,
    Instruction,
    Line,
    Module,
    Number,
    Operation,
    Parameter,
    Problem,
    Reference,
    Routine,
    Token,
    TooMuch,
    Unparsed,
    expressions_of,
    inside,
    parts,
)
from robot_programs.rapid.values import (
    UNREACHED,
    AbstractValue,
    PassedArgument,
    State,
    Values,
    as_pose,
    replaced,
    steps,
)

# What assignments and calls make of data.


def counting(instruction: Instruction) -> Assignment | None:
    """The assignment that Incr, Decr, Add and Clear stand for (RAPID instructions); None where it is another instruction."""
    nodes = [argument.value for argument in instruction.arguments if not argument.option]
    if len(nodes) != len(instruction.arguments) or not nodes or not isinstance(target := nodes[0], Reference):
        return None
    at = {"start": instruction.start, "end": instruction.end}
    match instruction.name.key, nodes[1:]:
        case ("incr" | "decr") as key, []:
            one = Number(**at, value=1.0)
            value = Operation(**at, operator="+" if key == "incr" else "-", operands=(target, one))
        case "add", [node] if node is not None:
            value = Operation(**at, operator="+", operands=(target, node))
        case "clear", []:
            value = Number(**at, value=0.0)
        case _:
            return None
    return Assignment(**at, target=target, value=value)


def _assigned(assignment: Assignment, symbol: Symbol, scope: Scope, values: Values) -> AbstractValue | None:
    """Abstract value of data after an assignment; None where the text does not tell."""
    target, node = assignment.target, assignment.value
    value = values.partly(node, scope)
    whole = Reference(start=target.start, end=target.end, name=target.name, selectors=())
    try:
        path = [
            (at, record) for at, record, _ in steps(target, symbol, scope, lambda one: values.number(one, scope, 1))
        ]
        if path:
            value = replaced(_before(whole, symbol, scope, values), path, value, scope.types)
    except Unresolved:
        return None
    if isinstance(value, Lost):
        return None
    read = (node, target, whole) if path else (node,)
    name = values.found(node, scope).name if isinstance(node, Reference) and not path else ""
    return AbstractValue(value=value, name=name, settable=any(values.settable(part, scope) for part in read))


def _before(whole: Reference, symbol: Symbol, scope: Scope, values: Values) -> Value:
    """What data hold before one of their components is assigned to, as far as that is known."""
    try:
        return values.of(whole, scope)
    except Unresolved as reason:
        lost = Lost(reason=str(reason))
    return lost if symbol.declaration is None else values.blank(symbol, lambda _: lost)


INITIAL: dict[str, Value] = {"num": 0.0, "dnum": 0.0, "bool": False, "string": ""}
"""What variables hold that are declared without a value (RAPID overview, variable declarations)."""


def given(arguments: Iterable[Argument], routine: Routine) -> Iterator[tuple[Parameter, Argument]]:
    """Parameters of a routine with the arguments of a call; those that are not given are missing."""
    required = iter([p for p in routine.parameters if not p.optional])
    for argument in arguments:
        named = next((p for p in routine.parameters if p.name.key == argument.option), None)
        parameter = named if argument.option else next(required, None)
        if parameter is not None:
            yield parameter, argument


def initial_values(context: Context, volatile: frozenset[Symbol], values: Values) -> dict[Symbol, AbstractValue]:
    """Initial values of the variables of a module or a routine, as far as that is known."""
    own = {symbol: initial(symbol, values) for symbol in context.declared if symbol not in volatile}
    return {symbol: value for symbol, value in own.items() if value is not None}


def initial(symbol: Symbol, values: Values) -> AbstractValue | None:
    """Initial value of a variable; None where it is not known, and of other data."""
    declaration = symbol.declaration
    if declaration is None or declaration.storage != "var":
        return None
    if declaration.value is not None:
        return AbstractValue(value=0.0, declared=True)
    nothing = Lost(reason=symbol.obstacle)
    try:
        value = values.blank(symbol, lambda type_: INITIAL.get(type_, nothing))
    except Unresolved:
        return None
    return None if isinstance(value, Lost) else AbstractValue(value=value)


def own_symbols(context: Context) -> frozenset[Symbol]:
    """Variables and parameters of a routine."""
    routine = context.routine
    parameters = () if routine is None else routine.parameters
    return frozenset(context.declared) | {context.scope.own[p.name.key][0] for p in parameters}


# Going through the statements of a program.


def _calls_in(node: Expression) -> Iterator[Call]:
    """Functions in an expression, those in arguments before the one that is given them."""
    for part in inside(node):
        yield from _calls_in(part)
    if isinstance(node, Call):
        yield node


LEAVING = ("exitcycle", "systemstopaction")

MAX_PASSES = 4
"""As many lines as the program has, so many times, are gone through again for calls and the turns of loops; behind that, what
routines set is taken as not known."""

MAIN = "main"
"""The routine in which a program begins, again and again."""


@dataclass(eq=False, kw_only=True)
class _Flow(form.Flow[State, Routine]):
    """The routines of a program, and how far they have been followed."""

    everywhere: Sequence[Context]
    contexts: Mapping[Routine, Context]
    effects: Effects
    declared: Values
    """What data are declared as, which nothing assigns to."""
    values: Values
    """The same on the way that is gone through, where more may be changed."""
    lent: Mapping[Routine, Mapping[Symbol, str]]
    """Tools and work objects that may be changed on the ways through a routine."""
    findings: "Findings | None"
    """None where nothing is to be noted."""
    bodies: dict[Routine, form.Body] = field(default_factory=dict[Routine, form.Body])
    computing: dict[Routine, bool] = field(default_factory=dict[Routine, bool])
    """Which functions only compute a value, as far as that was asked."""
    scopes: dict[form.Loop, Scope] = field(default_factory=dict[form.Loop, Scope])
    """What names mean in loops that declare their counters."""

    def body(self, routine: Routine) -> form.Body:
        if routine not in self.bodies:
            size = 1 + sum(1 for _ in form.lines_in(routine.body))
            backward, entered = form.labels_of(routine.body, routine.handlers)
            unread = (line for line in routine.lines if isinstance(line, Unparsed))
            entered = entered.union(token.key for line in unread for token in line.tokens)  # a GOTO may stand there
            self.bodies[routine] = form.Body(
                nodes=routine.body, handlers=routine.handlers, size=size, backward=backward, entered=entered
            )
        return self.bodies[routine]

    def inside(self, node: form.Node, scope: Scope) -> Scope:
        """What names mean in a statement, given what they mean around it."""
        if not isinstance(node, form.Loop) or node.line.counter is None:
            return scope
        return self.scopes.setdefault(node, scope.with_counter(node.line.counter))

    def name(self, routine: Routine) -> str:
        return routine.name.text

    def walk(self, routine: Routine, inside: tuple[Routine, ...]) -> "_Walk":
        context = self.contexts[routine]
        resumes = any(moves(form.lines_in(handler), context.scope) for handler in routine.handlers)
        return _Walk(flow=self, routine=routine, inside=inside, context=context, scope=context.scope, resumes=resumes)

    def anything(self, why: str) -> State:
        return State()

    def start(self, routine: Routine) -> State:
        """State where a routine begins that nothing calls; in main variables may have their declared values."""
        if self.all_ways:
            return self.called_anywhere(routine, "")
        self._begin(routine)
        return self.entered(routine, _start(self, self.contexts[routine]))

    def called_anywhere(self, routine: Routine, why: str) -> State:
        self._begin(routine)
        return self.entered(routine, State())

    def entered(self, routine: Routine, state: State) -> State:
        """State at the start of a routine: variables of its own get their declared values there."""
        context = self.contexts[routine]
        own = initial_values(context, self.effects.unseen, self.declared)
        return state.forgotten(own_symbols(context)).holding(own)

    def only_computes(self, routine: Routine) -> bool:
        """Whether a function does nothing but give a value, so that its call can be left out once that is known."""
        if routine not in self.computing:
            self.computing[routine] = False  # of one that calls itself nothing is known
            scope = self.contexts[routine].scope
            self.computing[routine] = not routine.handlers and all(
                self._computes(line, scope, routine) for line in routine.lines
            )
        return self.computing[routine]

    def _computes(self, line: Line, scope: Scope, routine: Routine) -> bool:
        match line:
            case Assignment():
                own = scope.own.get(line.target.name.key)
                given = {p.name.key for p in routine.parameters if p.changed}
                if own is None or line.target.name.key in given:
                    return False
            case Control():
                pass
            case _:
                return False
        return all(self.computed(expression, scope) for expression in expressions_of(line))

    def computed(self, expression: Expression, scope: Scope) -> bool:
        """Whether the functions in an expression only give values."""
        return not returns_values(expression) and all(
            part.name.key in FUNCTIONS
            if part.name.key not in scope.routines
            else all(map(self.only_computes, scope.routines[part.name.key]))
            for part in parts(expression)
            if isinstance(part, Call)
        )

    def found_all(self, routine: Routine) -> bool:
        scope = self.contexts[routine].scope
        return self.findings is None or all(
            line in self.findings.seen or not (is_read(line, scope) or is_motion(line, scope))
            for line in routine.lines
            if isinstance(line, Instruction)
        )

    def _begin(self, routine: Routine) -> None:
        own, assigned = self.lent.get(routine), self.declared.assigned
        lent = {symbol: {(): how} for symbol, how in (own or {}).items() if () not in assigned.get(symbol, {})}
        self.values = Values(assigned={**assigned, **lent}) if own else self.declared


@dataclass(eq=False, kw_only=True)
class _Walk(form.Walk[State, Routine]):
    """One pass through a routine."""

    SCOUTS = 0

    flow: _Flow  # pyright: ignore[reportIncompatibleVariableOverride]
    context: Context
    scope: Scope
    """What names mean in the innermost loop that is gone through."""
    resumes: bool
    """An error handler may move the robot and then resume anywhere."""
    values_returned: tuple[Mapping[Symbol, AbstractValue], dict[Call, AbstractValue]] | None = None
    """What functions of the program returned that were called last, and in which state."""

    @property
    def unreached(self) -> State:
        return UNREACHED

    def between(self, state: State) -> State:
        return replace(state, last=None, reached=True) if self.resumes else state

    def at_error(self, entry: State) -> State:
        return replace(entry, last=None).forgotten(self.flow.effects.within[self.routine])

    def unknown(self, line: Line, state: State) -> State:
        """State after text that was not understood."""
        self.flow.anywhere.update(called([line], self.scope))
        return self._lost(state)

    def turn(self, loop: form.Loop, state: State) -> State:
        outside, self.scope = self.scope, self.flow.inside(loop, self.scope)
        state = super().turn(loop, state)
        self.scope = outside
        return state

    def _lost(self, state: State) -> State:
        """State where control may come from anywhere in the routine: only data that nothing changes are known."""
        changes = self.flow.effects.changes
        parameters = {s for s in state.variables if (s.parameter_of, s.name.lower()) in changes.parameters}
        return replace(state, last=None, reached=True).forgotten(changes.assigned.keys() | parameters | {SOFT})

    # Conditions, and loops that count.

    def asked(self, line: Line, state: State, node: form.Node) -> State:
        expressions = expressions_of(line)
        if not isinstance(node, form.Branches):
            # the bounds of a FOR are read once, while they are asked for in every turn
            counts = isinstance(node, form.Loop) and node.kind == "counted"
            return self._after_functions(expressions, state, follow=not counts)
        for i, expression in enumerate(expressions):  # those behind the first are asked only where none before is taken
            behind = self._after_functions((expression,), state, keep=i > 0)
            if behind is state:
                continue
            state = self.merged([state, behind], "a condition may change it") if i else behind
            if self.values_returned is not None:
                self.values_returned = (state.variables, self.values_returned[1])
        return state

    def _after_functions(
        self, expressions: Sequence[Expression], state: State, *, follow: bool = True, keep: bool = False
    ) -> State:
        """State after the functions in some expressions, whose values are noted.

        Args:
            expressions: they, in the order in which they are evaluated.
            state: before them.
            follow: whether they are evaluated once, and all of them.
            keep: whether values that were noted before still count.
        """
        returned = dict(self.values_returned[1]) if keep and self.values_returned else dict[Call, AbstractValue]()
        self.values_returned = None
        called_here = [part for expression in expressions for part in _calls_in(expression)]
        if not any(calls(call, self.scope) or returns_values(call) for call in called_here):
            self.values_returned = (state.variables, returned) if returned else None
            return state
        for call in called_here:
            changed = changed_in(call, self.context, self.scope, self.flow.effects.changes)
            routines = self.scope.routines.get(call.name.key, ())
            if routines:
                self.values_returned = (state.variables, returned)
                state, value = self._through(call.arguments, routines, changed, state, follow=follow)
                if not state.reached:
                    return UNREACHED
                returned |= {} if value is None else {call: value}
            else:
                known = call.name.key in FUNCTIONS
                state = replace(state.forgotten(changed), last=state.last if known else None)
        self.values_returned = (state.variables, returned)
        return state

    def _values(self, state: State) -> Values:
        """Values in a state, which is that behind the functions that were called last."""
        noted = self.values_returned
        return self.flow.values.at(state.variables, noted[1] if noted and noted[0] is state.variables else {})

    def returned(self, line: Line, state: State) -> AbstractValue | None:
        for node in expressions_of(line):
            values = self._values(state)
            try:
                return AbstractValue(value=values.of(node, self.scope), settable=values.settable(node, self.scope))
            except Unresolved:
                break
        return None

    def truth(self, condition: Expression, state: State) -> bool | None:
        if self.flow.all_ways:
            return None
        values = self._values(state)
        try:
            value = None if values.settable(condition, self.scope) else values.of(condition, self.scope)
        except Unresolved:
            return None
        return value if isinstance(value, bool) else None

    def reads_data(self, condition: Expression) -> bool:
        return any(isinstance(part, Reference) for part in parts(condition))

    def widened(self, state: State, nodes: Sequence[form.Node], why: str) -> State:
        state = state.forgotten(frozenset[Symbol]().union(*self._all_changed_by(nodes, self.scope)))
        return replace(state, last=None) if moves(form.lines_in(nodes), self.scope) else state

    def _all_changed_by(self, nodes: Sequence[form.Node], scope: Scope) -> Iterator[frozenset[Symbol]]:
        for node in nodes:
            yield self.flow.effects.of(node, scope, self.context.file)
            for body in form.bodies_of(node):
                yield from self._all_changed_by(body, self.flow.inside(node, scope))

    def counts(self, loop: form.Loop, state: State) -> form.Counts | None:
        bounds = expressions_of(loop.line)
        values = self._values(state)
        try:
            if any(values.settable(bound, self.scope) for bound in bounds):
                return None
            first, last, *step = (values.number(bound, self.scope) for bound in bounds)
        except Unresolved:
            return None
        by = step[0] if step else (1.0 if first <= last else -1.0)
        return form.Counts(first=first, last=last, step=by) if by else None

    def counting(self, loop: form.Loop, state: State, count: float | None) -> State:
        if loop.kind != "counted":
            return state
        (counter,) = self.flow.inside(loop, self.scope).own[loop.line.counter.key]
        return state.forgotten([counter]) if count is None else state.holding({counter: AbstractValue(value=count)})

    def _changed_by(self, node: form.Node) -> frozenset[Symbol]:
        return self.flow.effects.of(node, self.scope, self.context.file)

    # Statements.

    def step(self, line: Line, state: State) -> State:
        if not (isinstance(line, Instruction) and line.plain):
            state = self._after_functions(expressions_of(line), state)
            if not state.reached:
                return UNREACHED
        match line:
            case Instruction():
                return self._instruction(line, state)
            case Assignment():
                return self._assignment(line, state)
            case _:
                return state

    def _assignment(self, assignment: Assignment, state: State) -> State:
        symbol, values = self.scope.known(assignment.target.name.text), self._values(state)
        if symbol is None:
            return state
        volatile = symbol in self.flow.effects.unseen
        known = None if volatile else _assigned(assignment, symbol, self.scope, values)
        state = state.forgotten([symbol])
        return state if known is None else state.holding({symbol: known})

    def _instruction(self, instruction: Instruction, state: State) -> State:
        key, scope, effects, node = instruction.name.key, self.scope, self.flow.effects, form.Step(line=instruction)
        if is_read(instruction, scope):
            number = self._resolve(instruction, scope, state)
            state = state.forgotten(self._changed_by(node))
            last = number if MOTION_FORMS[key].ends_there else None
            return State(last=last, reached=state.reached, variables=state.variables)
        if key in scope.routines:
            return self._call(instruction, state)
        if (counted := counting(instruction)) is not None:
            return self._assignment(counted, state)
        if key in LEAVING:
            return UNREACHED
        if is_late(instruction, scope):
            self.flow.anywhere.update(self.flow.contexts)
            return self._lost(state)
        if key != ONLY_EXTERNAL and is_motion(instruction, scope):
            self._resolve(instruction, scope, state)
        moved = key == ONLY_EXTERNAL or is_motion(instruction, scope) or moves([instruction], scope)
        self.flow.anywhere.update(called([instruction], scope))
        state = state.forgotten(self._changed_by(node))
        if key in (SOFTENING, STIFFENING) and SOFT not in effects.unseen:
            state = state.holding({SOFT: AbstractValue(value=key == SOFTENING)})
        return replace(state, last=None) if moved else state

    def _resolve(self, instruction: Instruction, scope: Scope, state: State) -> int | None:
        findings = self.flow.findings
        if findings is None or self.flow.scouting or (self.flow.all_ways and instruction in findings.seen):
            return None
        return findings.resolve(instruction, scope, self.context, state, self._values(state), self.flow.computed)

    def _call(self, instruction: Instruction, state: State) -> State:
        changed = changed_by([form.Step(line=instruction)], self.scope, self.context.file, self.flow.effects.changes)
        routines = self.scope.routines[instruction.name.key]
        return self._through(instruction.arguments, routines, changed, state)[0]

    def _through(
        self,
        arguments: Sequence[Argument],
        routines: Sequence[Routine],
        changed: frozenset[Symbol],
        state: State,
        *,
        follow: bool = True,
    ) -> tuple[State, AbstractValue | None]:
        """State after a call, and what it returns; None where that is not known.

        Args:
            arguments: what it gives.
            routines: those that may be meant.
            changed: data that it hands over to be changed.
            state: before it.
            follow: whether it can be followed.
        """
        program, values = self.flow, self._values(state)

        def entry(routine: Routine) -> State:
            own = program.contexts[routine].scope.own
            passed = {
                own[parameter.name.key][0]: known
                for parameter, argument in given(arguments, routine)
                if (known := self._passed(argument, own[parameter.name.key][0], values)) is not None
            }
            return program.entered(routine, state.forgotten(changed)).holding(passed)

        context = program.contexts[routines[0]]
        hidden = context.routine is not None and context.routine.local and context.module is not self.context.module
        followed = self.follow(routines, entry) if follow and not hidden else None
        if followed is None:
            program.anywhere.update(routines)
            lost = changed.union(*(program.effects.within[routine] for routine in routines))
            return replace(state.forgotten(lost), last=None), None
        behind, value = followed
        return behind.forgotten(changed | own_symbols(context)), value

    def _passed(self, argument: Argument, parameter: Symbol, values: Values) -> AbstractValue | None:
        """Abstract value of a parameter at a call; None where it is not given one, or the text does not tell."""
        node, file = argument.value, self.context.file
        if node is None or argument.conditional:
            return None
        try:
            settable = values.settable(node, self.scope)
            if not isinstance(node, Reference):
                literal = node if isinstance(node, Aggregate) else None
                passed = PassedArgument(
                    argument=argument, file=file, origin=None, literal=literal, parameters=(parameter,)
                )
                passed = passed if self.flow.computed(node, self.scope) else None
                return AbstractValue(value=values.of(node, self.scope), passed=passed, settable=settable)
            found = values.found(node, self.scope)
        except Unresolved:
            return None
        if found.passed is not None:  # a parameter is passed on
            passed = replace(
                found.passed,
                origin=found.origin,
                literal=found.literal if isinstance(found.literal, Aggregate) else None,
                reads=found.passed.reads | {(file, node.start)},
                parameters=(*found.passed.parameters, parameter),
            )
        elif found.origin is None:  # what was assigned to a variable of the caller has to be written where it is used
            passed = None
        else:
            passed = PassedArgument(
                argument=argument, file=file, origin=found.origin, literal=None, parameters=(parameter,)
            )
        return AbstractValue(value=found.value, passed=passed, name=found.name, settable=settable)


# The motions that were found in a RAPID program, each with all the ways that lead to it.


@dataclass(eq=False, kw_only=True)
class Findings(form.Findings[Instruction, Resolved]):
    """Resolves motions, and keeps what comes of it."""

    settings: Settings
    files: Sequence[File]
    soft: dict[Instruction, File] = field(default_factory=dict[Instruction, File])
    """Motions in which a servo may give way."""

    def resolve(
        self,
        instruction: Instruction,
        scope: Scope,
        context: Context,
        state: State,
        values: Values,
        computed: Callable[[Expression, Scope], bool],
    ) -> int | None:
        """Resolve a motion; says its number, or None where that could not be done."""
        try:
            if not is_read(instruction, scope):
                raise Unresolved("this motion is not read")
            for target in target_arguments(instruction) if values.returned else ():
                if target is not None and target.value is not None and not computed(target.value, scope):
                    raise Unresolved("its point comes from a function that does more than compute it")
            name = context.routine.name.text if context.routine else ""
            found = resolve(instruction, scope, context.file, self.settings, values, name)
        except Unresolved as reason:
            self.fail(instruction, context.file, str(reason))
            return None
        if self.settings.soft and (SOFT not in state.variables or state.variables[SOFT].value is True):
            self.soft[instruction] = context.file
        via = _meaning(found.via) if found.via else ()
        return self.number(
            instruction, found, (instruction, *_meaning(found.end), *via, found.manner.meaning), state.last
        )

    def sites(self) -> list[Site]:
        """All that can be rewritten, in the order of the text."""
        order = {id(file): i for i, file in enumerate(self.files)}
        file_of = {found.text: order[id(found.motion.file)] for found in self.occurrences}
        found = list(
            self.ordered(lambda found: not self._is_torn(found.motion), lambda text: (file_of[text], text.start))
        )
        ends, vias = poses_of([one.motion.end for one in found]), poses_of([one.motion.via for one in found])
        # those of calls that nobody could follow count, too
        return [
            motion_of(
                one.motion,
                end,
                via,
                one.follows,
                self.settings,
                one.same_text + (one.motion.instruction in self.reasons),
            )
            for one, end, via in zip(found, ends, vias, strict=True)
        ]

    def _is_torn(self, motion: Resolved) -> bool:
        """Whether a motion's own text would have to change, while on other ways nobody knows where it leads."""
        if motion.instruction not in self.reasons:
            return False
        return any(target.passed is None for target in (motion.end, motion.via) if target is not None)

    def diagnostics(self, sites: Iterable[Site]) -> Iterator[Diagnostic]:
        """Why motions stay as they are, on all ways or on some."""
        partly = {motion.instruction for motion in sites}
        for instruction, (file, reason) in self.reasons.items():
            where = " in some calls" if instruction in partly else ""
            text = f"{instruction.name.text} stays as it is{where}: {reason}"
            yield Diagnostic(place=file.source.place(instruction.start), text=text)
        for instruction, file in self.soft.items():
            text = (
                f"a servo may be soft here ({self.settings.soft}): the robot gives way, and the tool is not where the program "
                "says; corrected as if it were stiff"
            )
            yield Diagnostic(place=file.source.place(instruction.start), text=text)


def _meaning(target: TargetArgument) -> tuple[object, ...]:
    if target.origin is None and target.passed is None and target.literal is not None and not target.shifted:
        return (target.argument,)  # whose text says all of it
    origin = None if target.origin is None else (target.origin.symbol, target.origin.path)
    return (target.argument, origin, target.shifted, target.meant, target.external, target.read_at)


# Where a RAPID program begins, and what holds there.


def follow_program(everywhere: Sequence[Context], effects: Effects, values: Values, findings: Findings) -> "_Flow":
    """Go through a program from each routine that nothing calls, and find its motions."""
    contexts = {context.routine: context for context in everywhere if context.routine is not None}
    size = sum(1 for routine in contexts for _ in routine.lines)
    flow = _Flow(
        everywhere=everywhere, contexts=contexts, effects=effects, declared=values, values=values, findings=findings,
        lent=_lent(effects), left=MAX_PASSES * size + MIN_LINES,
    )  # fmt: skip
    routines = tuple(contexts)
    called_by = {r: {by for by in effects.callers[r] if by in contexts and by is not r} for r in contexts}
    roots = [r for r, others in called_by.items() if not others or r.kind == "trap" or r.name.key == MAIN]
    flow.follow(routines, roots)
    findings.close()
    flow.follow_rest(routines, roots)
    return flow


def _lent(effects: Effects) -> dict[Routine, dict[Symbol, str]]:
    """Tools and work objects that are given to routines that are not in the files, on any way that leads through a routine.

    They may be changed there, and stay so when the way is gone again. A routine that nothing in the files calls is a program of
    its own, such as one by which an operator calibrates a tool: the others start from what the files declare.
    """
    own = effects.changes.lent
    if not own:
        return {}
    lent = form.Effects(own={r: frozenset(own.get(r, {}).items()) for r in effects.own}, calls=effects.calls)
    return {routine: dict(sorted(given, key=lambda one: one[1])) for routine, given in lent.around.items()}


def _start(flow: _Flow, context: Context) -> State:
    """State where a root begins: in main the declared values of variables, if it leaves them as they were.

    A controller declares variables anew where the program pointer is moved to main, and keeps them where main begins again
    behind its end.
    """
    routine, effects = context.routine, flow.effects
    assert routine is not None
    softened = any(SOFT in changed for changed in effects.within.values()) and SOFT not in effects.unseen
    stiff = {SOFT: AbstractValue(value=False)} if softened else {}
    if routine.name.key != MAIN:
        return State(variables=stiff)
    fresh = {
        symbol: value
        for context in flow.everywhere
        if context.routine is None
        for symbol, value in initial_values(context, effects.unseen, flow.declared).items()
    } | stiff
    start = State(variables=fresh)
    quiet = replace(flow, findings=None, anywhere=set[Routine]())
    while start.variables:
        behind, _ = quiet.through(routine, quiet.entered(routine, start))
        if not behind.reached:
            return start
        again = start.joined(
            [behind], f"{MAIN} begins again behind its end, where it may hold something else"
        ).variables
        if again == start.variables:
            return start
        start = State(variables=again)
    return start


# From the files of a RAPID program to its motions.


@uncollected()
def read_rapid(
    sources: Sequence[Source], tools: Mapping[str, Frame] | None = None, parts: Mapping[str, Frame] | None = None
) -> RapidProgram:
    """Read the modules of a program: those with its routines and those with its tools, work objects and targets.

    Args:
        sources: the files.
        tools: those that the files do not declare, held by the robot, by name.
        parts: work objects that the files do not declare, which stand still in the world, by name.

    Raises:
        FileError: a file is no RAPID module.
    """
    diagnostics: list[Diagnostic] = []
    files: list[File] = []
    parameters = [source for source in sources if source.path.suffix.lower() == SUFFIX]
    if len(parameters) > 1:
        raise FileError(parameters[1].path, f"is motion parameters as {parameters[0].path} is; pass one MOC.cfg")
    if len(parameters) == len(sources):
        raise FileError(parameters[0].path, "holds motion parameters only; pass the modules with the motions, too")
    T_world_base = base_frame(parameters[0]) if parameters else None
    for source in sources:
        if source in parameters:
            continue
        modules, problems = _parsed(source)
        files.append(File(source=source, modules=modules))
        diagnostics += [Diagnostic(place=source.place(p.position), text=p.text) for p in problems]
    everywhere = tuple(contexts(files, _given(tools or {}, parts or {})))
    changed = changes(everywhere)
    values = Values(assigned=changed.assigned)
    settings = replace(_settings(everywhere), T_world_base=T_world_base)
    findings = Findings(settings=settings, files=files)
    flow = follow_program(everywhere, effects_of(everywhere, changed), values, findings)
    sites = findings.sites()
    diagnostics += findings.diagnostics(sites)
    for context in everywhere:
        diagnostics += _lost_motions(context)
    diagnostics += _cautions(everywhere)
    diagnostics += [Diagnostic(place=file.source.place(at), text=text) for text, (file, at) in settings.notes.items()]
    order = {source.path: i for i, source in enumerate(sources)}
    diagnostics.sort(key=lambda diagnostic: (order[diagnostic.place.path], diagnostic.place.line))
    return RapidProgram(
        sources=tuple(sources), motions=tuple(motion.move for motion in sites), diagnostics=tuple(diagnostics),
        sites=tuple(sites), uses=uses(everywhere, values), everywhere=everywhere, turns=flow.turns, begun=flow.begun,
        read=partial(read_rapid, tools=tools, parts=parts),
        T_world_base=T_world_base,
        shift=settings.shift, unresolved=frozenset(findings.reasons).difference(motion.instruction for motion in sites),
    )  # fmt: skip


def _given(tools: Mapping[str, Frame], parts: Mapping[str, Frame]) -> Iterator[Symbol]:
    """Tools and work objects as data of the program."""
    for name, frame in tools.items():
        yield Symbol(name=name, type="tooldata", value=(True, as_pose(frame.T), ZERO_LOAD))
    for name, frame in parts.items():
        yield Symbol(name=name, type="wobjdata", value=(False, True, "", as_pose(frame.T), IDENTITY))


def _parsed(source: Source) -> tuple[tuple[Module, ...], tuple[Problem, ...]]:
    if "\0" in source.text:
        raise FileError(source.path, "is a binary file; give a RAPID module as text")
    # looked for first: of a file that has none, every word would be taken apart for nothing
    try:
        modules, problems = parse(source.text) if re.search("MODULE", source.text, re.IGNORECASE) else ((), ())
    except TooMuch as much:
        raise FileError(source.path, much.text, line=source.line(much.position)) from None
    if not modules:
        raise FileError(source.path, "has no MODULE; give a RAPID module (.mod, .sys, .prg, .modx or .sysx)")
    return modules, problems


def _settings(everywhere: Iterable[Context]) -> Settings:
    """Settings of the program's instructions for all of it: where they do so sometimes, they may do so always."""
    off: set[str] = set()
    shift = offset = soft = ""
    for file, name, options in _words(everywhere):
        if name.key == "confj" and "off" in options:
            off.add("joint")
        elif name.key == "confl" and "off" in options:
            off |= {"linear", "circular"}
        elif name.key in SHIFTING and not shift:
            shift = f"a program displacement may shift it ({name.text} in {file.source.place(name.start)})"
        elif name.key in OFFSETTING and not offset:
            offset = f"{name.text} in {file.source.place(name.start)}"
        elif name.key == SOFTENING and not soft:
            soft = f"{name.text} in {file.source.place(name.start)}"
    return Settings(
        postures_off=frozenset(off), shift=shift, external_offset=offset, soft=soft,
    )  # fmt: skip


def _cautions(everywhere: Sequence[Context]) -> Iterator[Diagnostic]:
    """Warnings of instructions that act on motions elsewhere."""
    for file, name, options in _words(everywhere):
        if name.key in SHIFTING:
            text = f"{name.text} begins a program displacement, which may shift any motion to a pose; none is read"
        elif name.key == "singarea" and any(option in TURNING for option in options):
            text = (
                f"{name.text} lets the tool turn in another way along lines and arcs; "
                "its orientation between targets is not as predicted"
            )
        elif name.key in OFFSETTING:
            text = f"{name.text} shifts the external axes by what is not read; where one carries robot or part, no motion is"
        elif name.key in BY_NAME:
            text = f"{name.text} sets data by their names; they are taken to stay as they are declared"
        else:
            continue
        yield Diagnostic(place=file.source.place(name.start), text=text)
    for context in everywhere:
        for statement in context.lines:
            if not isinstance(statement, Instruction):
                continue
            name = statement.name.text
            if is_late(statement, context.scope):
                name = "this" if name == LATE[0] else name
                text = (
                    f"{name} calls a procedure whose name is known only at run time; one that is not in the files given is "
                    "taken to leave all data as they are"
                )
            elif is_strange(statement.name.key, context.scope):
                text = (
                    f"{name} is not in the files given; it is taken to leave all data as they are that it is not given"
                )
            else:
                continue
            yield Diagnostic(place=context.file.source.place(statement.start), text=text)


def _words(everywhere: Iterable[Context]) -> Iterator[tuple[File, Token, frozenset[str]]]:
    """Names of instructions with the options they are given; all names in text that is not understood."""
    for context in everywhere:
        for statement in context.lines:
            match statement:
                case Instruction():
                    yield context.file, statement.name, statement.options
                case Unparsed():
                    options = frozenset(token.key for token in statement.tokens if token.kind == "name")
                    for token in statement.tokens:
                        if token.kind == "name":
                            yield context.file, token, options
                case _:
                    pass


def _lost_motions(context: Context) -> Iterator[Diagnostic]:
    """Motions in text that was not understood."""
    for unparsed in (statement for statement in context.lines if isinstance(statement, Unparsed)):
        for token in unparsed.tokens:
            if token.kind == "name" and token.key.startswith(MOVING) and token.key not in MOTIONLESS:
                why = unparsed.trouble(context.file.source)
                text = f"{token.text} stays as it is: the text around it is not understood ({why})"
                yield Diagnostic(place=context.file.source.place(token.start), text=text)
