"""Reading KRL programs: from the routines that nothing calls through all that they call."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

from robot_programs.core import flow
from robot_programs.core.errors import FileError
from robot_programs.core.flow import MIN_LINES, Body, Counts, Group, Loop, Node, lines_in
from robot_programs.core.program import Diagnostic, Frame, Unresolved
from robot_programs.core.source import Source
from robot_programs.krl.data import Data, File, Routine, Text
from robot_programs.krl.frames import EVERYTHING, UNREACHED, Frames, State
from robot_programs.krl.resolve import Findings, Resolver
from robot_programs.krl.rewrite import KrlProgram
from robot_programs.krl.routines import (
    Actions,
    actions_of,
    callers_of,
    calls_of,
    changed_by,
    changing,
    declared_in,
    matters,
    only_computes,
    read_names,
    resuming,
    roots_of,
    routines_of,
    unasked,
)
from robot_programs.krl.syntax import (
    LOOPS,
    Assignment,
    Begin,
    Beside,
    Call,
    Condition,
    Control,
    Motion,
    Statement,
    Tree,
    Word,
    lines_of_words,
    parse,
    passed_by_reference,
    passed_in_motion,
    tree_of,
    whole_call,
)
from robot_programs.krl.values import (
    HERE,
    AbstractValue,
    Adjustable,
    Lost,
    Names,
    Value,
    Variables,
    after_assignment,
    bound,
    element_assigned,
    evaluated,
    forgotten,
    given_by,
    number_of,
    without_own,
    without_places,
)

# One pass through the lines of a KRL routine, and through the routines that it calls.


MAX_IDLE_CALLS = 40
"""So often a routine without motions is followed, as those for messages are; behind further calls, what it changes is not known."""

MAX_IDLE_LINES = 1000
"""Lines of all turns of a loop without motions that is gone through turn by turn."""


@dataclass(eq=False, kw_only=True)
class Flow(flow.Flow[State, Routine]):
    """The routines of a program, and how far they have been followed."""

    findings: Findings
    routines: Mapping[str, Sequence[Routine]]
    trees: Mapping[Routine, Tree]
    frames: Callable[[Routine], Frames]
    changes: Mapping[str, frozenset[str]]
    """By name of a routine: keys of the variables it changes, and what of tool, base and the like."""
    by_value: Mapping[str, tuple[bool, ...]]
    actions: Actions
    """What may run beside the lines."""
    resuming: frozenset[str]
    """Routines behind whose calls an interrupt may resume that left what they call."""
    idle_calls: dict[str, int] = field(default_factory=dict[str, int])
    """By name of a routine that neither moves nor sets tool, base and the like: how often it was followed."""
    elements: dict[Text, set[str] | None] = field(default_factory=dict[Text, set[str] | None])
    """By assignment to an element by a computed index: which elements it sets; None where that is not known."""

    def body(self, routine: Routine) -> Body:
        """The lines of a routine; see `flow.Flow.body`."""
        return self.trees[routine].body

    def name(self, routine: Routine) -> str:
        """Name of a routine."""
        return routine.name

    def walk(self, routine: Routine, inside: tuple[Routine, ...]) -> "_Walk":
        """A pass through a routine; see `flow.Flow.walk`."""
        odd = self.trees[routine].odd
        if odd is not None and not self.scouting:
            text = f"{odd.keyword} does not match the blocks of {routine.name}; what holds behind it is not known"
            self.findings.diagnose(routine.file, odd.start, text)
        return _Walk(flow=self, routine=routine, inside=inside, tree=self.trees[routine], frames=self.frames(routine))

    def anything(self, why: str) -> State:
        """State in which anything may hold, and any action may have been started."""
        return replace(State.unset().forgotten(why), armed=self.actions.all)

    def start(self, routine: Routine) -> State:
        """State where a program begins."""
        return State.unset()

    def found_all(self, routine: Routine) -> bool:
        """Whether all motions of a routine were found."""
        motions = {(routine.file.number, line.start) for line in routine.lines if isinstance(line, Motion)}
        return motions <= self.findings.seen

    def idle(self, name: str) -> bool:
        """Whether a call is not followed because the routine moves nothing and was followed often."""
        if self.changes[name] & EVERYTHING:
            return False
        self.idle_calls[name] = self.idle_calls.get(name, 0) + 1
        return self.idle_calls[name] > MAX_IDLE_CALLS

    def forget(self, name: str, state: State) -> State:
        """State after a routine that is not followed."""
        if name not in self.routines:
            return state
        self.anywhere.update(self.routines[name])
        return self.lost_by(name, state)

    def lost_by(self, name: str, state: State) -> State:
        """State after a routine that may have left anything that it changes."""
        variables = forgotten(state.variables, self.changes[name])
        armed = state.armed | self.actions.by_routine.get(name, frozenset())
        return replace(state.forgotten(f"{name} sets it", self.changes[name]), variables=variables, armed=armed)

    def armed_by(self, routine: Routine, lines: Sequence[Statement]) -> frozenset[Text]:
        """Actions that some lines of a routine may start."""
        started, by_routine = self.actions.started, self.actions.by_routine
        return frozenset[Text]().union(
            *(started.get((routine.file.number, line.start), frozenset()) for line in lines),
            *(by_routine.get(name, frozenset()) for line in lines for name in calls_of(line)),
        )


@dataclass(eq=False, kw_only=True)
class _Walk(flow.Walk[State, Routine]):
    """One pass through a routine."""

    flow: Flow  # pyright: ignore[reportIncompatibleVariableOverride]
    tree: Tree
    frames: Frames
    in_spline: bool = False
    trigger: bool = False
    """A TRIGGER waits for the next motion."""

    @property
    def unreached(self) -> State:
        """State of places that control does not reach."""
        return UNREACHED

    def through(self, entry: State) -> tuple[State, AbstractValue | None]:
        """State after the routine, its own variables included, and what it returns."""
        state, value = super().through(entry)
        local = state.armed & self.flow.actions.local.get(self.routine.name, frozenset())
        return replace(state, armed=state.armed - local) if local else state, value

    def between(self, state: State) -> State:
        """State where started actions may have run."""
        return self.flow.actions.weakened(state)

    def behind(self, state: State) -> State:
        """State after the last line of a block, where started actions may have run."""
        return self.flow.actions.weakened(state)

    # Conditions, and loops that count.

    def asked(self, line: Statement, state: State, node: Node | None = None) -> State:
        """State after functions in the expressions of a line."""
        for name in calls_of(line):
            state = self.flow.forget(name, state)
        return self._forgotten(line.changed, state) if isinstance(line, Control) else state

    def truth(self, condition: Condition, state: State) -> bool | None:
        """Whether a condition holds; None where the text does not tell."""
        value = self._value(condition.words, state)
        if condition.cases is None:
            return value if isinstance(value, bool) else None
        cases = [self._value(words, state) for words in condition.cases]
        if value is None or any(type(case) is not type(value) for case in cases):
            return None
        return value in cases

    def reads_data(self, condition: Condition) -> bool:
        """Whether a condition names anything."""
        return any(word.kind == "name" for word in condition.words)

    def widened(self, state: State, nodes: Sequence[Node], why: str) -> State:
        """State after lines that may have changed all that they change."""
        lines = tuple(lines_in(nodes))
        changed = frozenset[str]().union(*map(self._changed_by, lines))
        keys = changed - EVERYTHING
        variables = {key: Lost(reason=f"{key.rpartition(':')[2]} is not the same in every turn") for key in keys}
        state = replace(
            state,
            variables={**without_places(forgotten(state.variables, keys)), **variables},
            armed=state.armed | self.flow.armed_by(self.routine, lines),
        )
        return state.forgotten(why, changed | {"motion"})

    def counts(self, loop: Loop, state: State) -> Counts | None:
        """Bounds and step of a FOR; None where the text does not tell, or no counter is named."""
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
        return Counts(first=first, last=last, step=step) if whole and step else None

    def counting(self, loop: Loop, state: State, count: float | None) -> State:
        """State in which the counter of a FOR has a value; None for any."""
        if loop.kind != "counted":
            return state
        if count is None:
            return replace(state, variables=forgotten(state.variables, self._changed_by(loop.line)))
        return replace(state, variables={**state.variables, self._counter(loop): count})

    def counted(self, loop: Loop, state: State, count: float) -> float | None:
        """Value of the counter at the end of a turn, which may set it, too."""
        now = state.variables.get(self._counter(loop))
        return now if isinstance(now, float) else None

    def by_turns(self, loop: Loop, turns: int) -> bool:
        """Whether a loop moves, or is short, as one that computes points is."""
        if turns * loop.size <= MAX_IDLE_LINES:
            return True
        return any("motion" in self._changed_by(line) for line in lines_in(loop.body))

    def _counter(self, loop: Loop) -> str:
        return self.frames.names.key(loop.line.words[0].upper)

    def _value(self, words: Sequence[Word], state: State) -> Value | None:
        """The value of an expression by which ways are chosen; None where the text does not tell, or all are gone through."""
        if self.flow.all_ways:
            return None
        try:
            return evaluated(words, replace(self.frames.known(state), deciding=True))
        except Unresolved:
            return None

    def _changed_by(self, line: Statement) -> frozenset[str]:
        return changed_by(line, self.frames.names, self.flow.by_value, self.flow.changes)

    def _forgotten(self, variables: Sequence[str], state: State) -> State:
        """State in which some variables, by their names in the routine, may hold anything."""
        if not variables:
            return state
        keys = map(self.frames.names.key, variables)
        return replace(state, variables=forgotten(state.variables, keys))

    # Lines.

    def within(self, group: Group, state: State) -> State:
        """State after a SPLINE block."""
        self.in_spline = True
        state = self.block(group.body, replace(state, last=None))
        self.in_spline = False
        return state

    def returned(self, line: Control, state: State) -> AbstractValue | None:
        """Value of a RETURN."""
        return given_by(line.words, self.frames.known(state)) if line.keyword == "RETURN" and line.words else None

    def step(self, line: Statement, state: State) -> State:
        """State after a line."""
        match line:
            case Motion():
                return self._motion(line, state)
            case Assignment():
                return self._assignment(line, state)
            case Call():
                return self._call(line, state)
            case Beside():
                return self._beside(line, state)
            case Control() if self.tree.odd is None and line.keyword in LOOPS:  # without any line of consequence
                state = self.asked(line, state)
                return replace(state, variables=forgotten(state.variables, self._changed_by(line)))
            case Control():
                return self.flow.anything(f"the blocks of {self.routine.name} do not match")
            case _:
                return state

    def _beside(self, line: Beside, state: State) -> State:
        actions, text = self.flow.actions, (self.routine.file.number, line.start)
        if not self.flow.scouting:
            self.trigger = self.trigger or line.keyword == "TRIGGER"
            for said in actions.missing.get(text, ()):
                self.flow.findings.diagnose(self.routine.file, line.start, said)
        started, ended = actions.started.get(text, frozenset()), actions.ended.get(text, frozenset())
        return replace(state, armed=(state.armed - ended) | started)

    def _assignment(self, line: Assignment, state: State) -> State:
        returned = None
        called = self._function(line.words)
        if called is None:
            state = self._forgotten(line.changed, self.asked(line, state))
        else:
            state, returned = self._followed(called, state)
            if returned is None:
                returned = Lost(reason=f"what {called.name} returns is known only at run time")
            if not state.reached:
                return UNREACHED
        known = self.frames.known(state)
        if line.index is not None and not self.flow.scouting and line.variable not in self.frames.names.own:
            self._note_element(line, element_assigned(known, line))
        # what is set to the robot's place as a whole is that place, wherever it is
        if line.component or len(line.words) > 1:
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
            keys = changed_by(line, self.frames.names, self.flow.by_value, {})
            return self.frames.after_bas(replace(state, variables=forgotten(state.variables, keys)), line)
        for name in calls_of(line)[1:]:
            state = self.flow.forget(name, state)
        if line.name in self.flow.routines:
            state, _ = self._followed(line, state)
            return state
        if not self.flow.scouting:
            text = f"{line.name} is not in the files given; it is taken to leave $TOOL, $BASE and $IPO_MODE as they are"
            self.flow.findings.diagnose(self.routine.file, line.start, text)
        return replace(self._forgotten(passed_by_reference(line, self.flow.by_value), state), last=None)

    def _function(self, words: Sequence[Word]) -> Call | None:
        """The function of the program whose value is all of an expression; None where it is anything else."""
        called = whole_call(words)
        return called if called is not None and called.name in self.flow.routines else None

    def _followed(self, call: Call, state: State) -> tuple[State, AbstractValue | None]:
        """State after a call of a routine of the files, and what it returns."""
        program, known = self.flow, self.frames.known(state)
        by_reference = passed_by_reference(call, program.by_value)
        left = self._forgotten(by_reference, state)
        if program.idle(call.name):
            return program.lost_by(call.name, left), None
        keys = frozenset(map(self.frames.names.key, by_reference))

        def entry(routine: Routine) -> State:
            given = zip(routine.parameters, call.arguments, strict=False)
            # what is passed by reference has two names inside: only the parameter's is followed
            return replace(state, variables=forgotten(bound(known, given, program.frames(routine).names), keys))

        followed = self.follow(program.routines[call.name], entry)
        if followed is None:
            return program.lost_by(call.name, left), None
        behind, value = followed
        if self.routine.name in program.resuming:
            left = replace(program.lost_by(call.name, left), last=None)
            behind = self.merged([behind, left], "an interrupt may resume behind it")
        if not behind.reached:
            return UNREACHED, value
        if program.all_ways:
            return replace(behind, variables=forgotten(behind.variables, keys)), value
        return replace(behind, variables=self._behind_call(call, by_reference, behind.variables)), value

    def _behind_call(self, call: Call, by_reference: Sequence[str], variables: Variables) -> Variables:
        """Variables after a call: those passed by reference as a whole have the final values of the parameters."""
        names, (routine,) = self.frames.names, self.flow.routines[call.name]
        back = dict(forgotten(without_own(variables, routine.prefix), map(names.key, by_reference)))
        for parameter, words in zip(routine.parameters, call.arguments, strict=False):
            if len(words) != 1 or by_reference.count(words[0].upper) != 1:
                continue
            key, value = names.key(words[0].upper), variables.get(f"{routine.prefix}{parameter}")
            changed = key in self.flow.changes[call.name] or key in names.volatile
            if value is None or changed or (isinstance(value, str) and value in HERE):
                continue
            plain = value.value if isinstance(value, Adjustable) else value
            if isinstance(plain, float) and not plain.is_integer() and words[0].upper in names.whole_numbers:
                continue
            back[key] = value
        return back

    def _motion(self, line: Motion, state: State) -> State:
        findings, file = self.flow.findings, self.routine.file
        resolver = Resolver(findings=findings, routine=self.routine, frames=self.frames)
        if resolver.stays_there(line, state):
            return state
        state, returned = self._points_returned(line, state)
        if not state.reached:
            return UNREACHED
        behind = replace(state, last=None, variables=without_places(state.variables))
        if self.flow.scouting:
            return behind
        trigger, self.trigger = self.trigger, False
        text = (file.number, line.start)
        if self.flow.all_ways and text in findings.seen:
            return behind
        try:
            move, site = resolver.resolve(line, state, in_spline=self.in_spline, returned=returned)
        except Unresolved as trouble:
            findings.fail(text, file, f"{line.keyword} stays as it is: {trouble}")
            return behind
        if trigger:
            said = "a TRIGGER acts along this motion; check it if the motion is divided"
            findings.diagnose(file, line.start, said)
        number = findings.note(move, site, None if self.in_spline else state.last)
        return replace(behind, last=number)

    def _points_returned(self, line: Motion, state: State) -> tuple[State, dict[int, AbstractValue]]:
        """State after the program's functions in a motion, and what they return of its points, by their first character."""
        returned: dict[int, AbstractValue] = {}
        for operand in line.operands:
            words = () if operand.parts else line.words_of(operand)
            called = self._function(words)
            if called is not None and state.reached:
                state, value = self._followed(called, state)
                returned[operand.start] = self._of_function(called.name, value)
        if len(returned) < sum(name in self.flow.routines for name in calls_of(line)):
            state = self._forgotten(passed_in_motion(line, self.flow.by_value), self.asked(line, state))
        return state, returned

    def _of_function(self, name: str, value: AbstractValue | None) -> AbstractValue:
        """Point returned by a function, whose numbers may take the place of its call."""
        if value is None:
            return Lost(reason=f"what {name} returns is known only at run time")
        if not all(only_computes(routine, self.flow.routines) for routine in self.flow.routines[name]):
            return Lost(reason=f"its point comes from {name}, which does more than compute it")
        return value


# Reading KRL programs: from the routines that nothing calls through all that they call.


MAX_PASSES = 30
"""As many lines as the program has, so many times, are gone through again for calls and the turns of loops; behind that, what
routines set is taken as not known, and loops are not taken turn by turn."""


def read_krl(sources: Sequence[Source]) -> KrlProgram:
    """Read a KRL program.

    Args:
        sources: its ``.src`` files, with their ``.dat`` and, for tools and bases by number, ``$config.dat``.

    Raises:
        FileError: a file is no KRL, or none holds a program.
    """
    files = tuple(
        File(number=i, source=source, statements=tuple(parse(source.text))) for i, source in enumerate(sources)
    )
    for file in files:
        if not any(isinstance(line, Begin) for line in file.statements):
            raise FileError(file.source.path, f"is not a KRL file: no {'DEFDAT' if file.holds_data else 'DEF'} line")
    if sources and all(file.holds_data for file in files):
        raise FileError(sources[0].path, "holds data only; pass the .src with the motions, too")
    return _Reading(files=files).program()


@dataclass(frozen=True, eq=False, kw_only=True)
class _Reading:
    files: tuple[File, ...]
    findings: Findings = field(default_factory=Findings)
    elements: Mapping[Text, frozenset[str]] = field(default_factory=dict[Text, frozenset[str]])
    """What assignments by a computed index set, where that is known already."""

    def program(self) -> KrlProgram:
        """Follow the program from all routines that nothing calls."""
        routines = routines_of(self.files)
        callers = callers_of(routines)
        for routine, line in declared_in(routines).values():
            for name in calls_of(line.action) if line.action is not None else ():
                callers.get(name, set()).add(routine.name)
        always = frozenset(line.name for file in self.files if file.submits for line in file.heads)
        data = Data(files=self.files, roots=roots_of(callers), always=always, elements=self.elements)
        flow = self._flow(routines, data)
        beside = unasked(self.files, routines)
        roots = [name for name in routines if not callers[name] - {name} or name in beside]
        everywhere = [routine for same in routines.values() for routine in same]
        begin = {routine for routine in everywhere if routine.name in roots}
        flow.follow(everywhere, begin)
        known = {text: frozenset(names) for text, names in flow.elements.items() if names is not None}
        if not self.elements and data.refused & {name.partition("[")[0] for names in known.values() for name in names}:
            return _Reading(files=self.files, elements=known).program()
        self.findings.close()
        flow.follow_rest(everywhere, begin)
        self._warn()
        self._say_set_elsewhere(data)
        return self._ordered(data)

    def _flow(self, routines: Mapping[str, list[Routine]], data: Data) -> Flow:
        changes = changing(routines, data)
        volatile = frozenset[str]().union(*(changes[name] for name in unasked(self.files, routines)))
        made: dict[tuple[str, bytes], Frame] = {}
        frames: dict[Routine, Frames] = {}

        def frames_of(routine: Routine) -> Frames:
            if routine not in frames:
                frames[routine] = Frames(data=data, names=Names.of(routine, data, volatile), made=made)
            return frames[routine]

        read = read_names(self.files)
        followed = lambda key: key not in volatile and key.rpartition(":")[2] in read  # noqa: E731
        size = sum(len(file.statements) for file in self.files)
        return Flow(
            findings=self.findings,
            routines=routines,
            trees={
                r: tree_of(r.lines, lambda x: matters(x, read, routines)) for same in routines.values() for r in same
            },
            frames=frames_of,
            changes=changes,
            by_value=data.by_value,
            actions=actions_of(routines, data, changes, followed),
            resuming=resuming(routines),
            left=MIN_LINES + MAX_PASSES * size,
        )

    def _say_set_elsewhere(self, data: Data) -> None:
        """Say which tools and bases another program may change."""
        for name, place in data.set_elsewhere.items():
            number = next(i for i, file in enumerate(self.files) if file.source.path == place.path)
            text = (
                f"{name} is changed here, in a program of its own; motions are corrected for the value in the data list"
            )
            lines = self.files[number].source.text.split("\n")
            position = sum(len(line) + 1 for line in lines[: place.line - 1])
            self.findings.diagnose(self.files[number], position, text)

    def _warn(self) -> None:
        """Say where the controller may correct its geometry by itself."""
        for file in self.files:
            for words in lines_of_words(file.source.text) if "$ABS_" in file.source.text.upper() else ():
                if any(word.upper in ("$ABS_ACCUR", "$ABS_CONVERT") for word in words):
                    self.findings.diagnose(
                        file,
                        words[0].start,
                        "the controller's own absolute accuracy may be on; a corrected program would then correct twice",
                    )

    def _ordered(self, data: Data) -> KrlProgram:
        """Moves in the order of the text."""
        try:
            T_world_base = data.robroot
        except Unresolved:  # the motions to poses say so
            T_world_base = None
        found = list(self.findings.finished())
        failed = ((number, start, text) for (number, start), (_, text) in self.findings.reasons.items())
        return KrlProgram(
            sources=tuple(file.source for file in self.files),
            moves=tuple(move for move, _ in found),
            diagnostics=tuple(
                Diagnostic(place=self.files[file].source.place(position), text=text)
                for file, position, text in sorted({*self.findings.diagnostics, *failed})
            ),
            sites=tuple(site for _, site in found),
            files=self.files,
            read=read_krl,
            T_world_base=T_world_base,
        )
