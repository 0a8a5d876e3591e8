"""One pass through the lines of a KRL routine, and through the routines that it calls."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Container, Generator, Iterable, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace

from robot_programs.core.flow import DEEPEST, with_called
from robot_programs.core.program import Unresolved
from robot_programs.krl.data import Data, plain_value
from robot_programs.krl.frames import Frames
from robot_programs.krl.parse import (
    Branches,
    Loop,
    Node,
    Spline,
    Tree,
    exits_of,
    handed_in_motion,
    handed_over,
    lines_in,
    name_of_label,
    whole_call,
)
from robot_programs.krl.resolve import Findings, Resolver, Text
from robot_programs.krl.routines import Routine, altered_by, calls_of, keys_changed_by, only_computes
from robot_programs.krl.state import NOWHERE, Held, State, differing, merged
from robot_programs.krl.syntax import Assignment, Beside, Call, Control, Motion, Statement, Word, split_at_commas
from robot_programs.krl.values import (
    HERE,
    Adjustable,
    Holding,
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

# Actions that run beside the lines of a KRL program: interrupts, TRIGGER, and analog signals that are followed.
#
# From the line that starts an action (INTERRUPT ON, TRIGGER, ANIN ON) to the one that ends it (INTERRUPT OFF, ANIN
# OFF), it may run between any two lines (KUKA System Software, interrupt programming; cyclic analog inputs and
# outputs; path-related switching actions). A TRIGGER runs once, but the advance run does not tell before which
# line.

HARMLESS = frozenset({"IR_STOPM"})
"""Routines of KUKA's own interrupts, which every controller has; as delivered they set neither frames nor points."""

_FRAMES = {"tool": "$TOOL", "base": "$BASE", "mode": "$IPO_MODE", "parameters": "FDAT_ACT"}

Declared = Mapping[Text, tuple[Routine, Beside]]


@dataclass(frozen=True, kw_only=True)
class Action:
    """An action with an effect on motions."""

    what: frozenset[str]
    """What of `EVERYTHING` it alters."""
    keys: frozenset[str]
    """Keys of the variables it assigns, beside those that are never followed."""
    source: str
    """What runs it."""
    end: str
    """What would work."""

    def on(self, state: State) -> State:
        """The state after it may have run."""
        for what in sorted(self.what):
            state = state.forgotten(self._reason(_FRAMES.get(what, what)), frozenset({what}))
        if "mode" in self.what:
            state = replace(state, base=Held(frame=None, reason=self._reason("$IPO_MODE")))
        lost = {key: Lost(reason=self._reason(key.rpartition(":")[2])) for key in sorted(self.keys)}
        if state.variables.items() >= lost.items():
            return state
        return replace(state, variables={**forgotten(state.variables, lost), **lost})

    def _reason(self, name: str) -> str:
        return f"{name} may be set at any time by {self.source}; {self.end} and set {name} again before the motion"


@dataclass(frozen=True, eq=False, kw_only=True)
class Actions:
    """The actions of a program, by number of the file and first character of the line that declares them."""

    effects: Mapping[Text, Action] = field(default_factory=dict[Text, Action])
    """Only of those that have any."""
    started: Mapping[Text, frozenset[Text]] = field(default_factory=dict[Text, frozenset[Text]])
    """By line that starts some: those, and those that they start themselves."""
    ended: Mapping[Text, frozenset[Text]] = field(default_factory=dict[Text, frozenset[Text]])
    """By line that ends some."""
    local: Mapping[str, frozenset[Text]] = field(default_factory=dict[str, frozenset[Text]])
    """By name of a routine: interrupts that it declares for itself and those it calls, which end where it ends."""
    by_routine: Mapping[str, frozenset[Text]] = field(default_factory=dict[str, frozenset[Text]])
    """By name of a routine: what it leaves started, at most."""
    missing: Mapping[Text, tuple[str, ...]] = field(default_factory=dict[Text, tuple[str, ...]])
    """By line that starts some: diagnostics of routines and interrupts that the files do not have."""

    @property
    def all(self) -> frozenset[Text]:
        """All that some line starts."""
        return frozenset[Text]().union(*self.started.values())

    def weakened(self, state: State) -> State:
        """A state before a line, where started actions may have run."""
        for text in sorted(state.armed):
            state = self.effects[text].on(state)
        return state


def declared_in(routines: Mapping[str, Sequence[Routine]]) -> Declared:
    """The lines that declare an action, with their routines."""
    return {
        _text(routine, line): (routine, line)
        for same in routines.values()
        for routine in same
        for line in routine.lines
        if isinstance(line, Beside) and line.action is not None
    }


def actions_of(
    routines: Mapping[str, Sequence[Routine]],
    data: Data,
    alters: Mapping[str, frozenset[str]],
    changes: Mapping[str, frozenset[str]],
    followed: Callable[[str], bool],
) -> Actions:
    """The actions of a program.

    Args:
        routines: by name.
        data: the data lists.
        alters: by name of a routine, what of tool, base and the like it alters.
        changes: by name of a routine, keys of the variables it changes.
        followed: by key of a variable, whether its value is followed at all.
    """
    declared = declared_in(routines)
    if not any(isinstance(line, Beside) for same in routines.values() for r in same for line in r.lines):
        return Actions()
    effects: dict[Text, Action] = {}
    for text, (routine, line) in declared.items():
        action = _effect(routine, line, data, alters, changes, followed)
        if action.what or action.keys:
            effects[text] = action
    meant = _Meant(routines=routines, data=data, declared=declared)
    own: dict[Text, frozenset[Text]] = {}
    ended: dict[Text, frozenset[Text]] = {}
    missing: dict[Text, tuple[str, ...]] = {}
    for routine, line in _lines(routines):
        found, text = meant.by(routine, line), _text(routine, line)
        if line.verb == "ON":
            own[text] = found
            missing[text] = tuple(_missing(line, [declared[of][1].action for of in sorted(found)], routines))
        elif line.verb == "OFF":
            exact = found if not line.number else frozenset(of for of in found if meant.certain(routine, line, of))
            ended[text] = exact.intersection(effects)
    calls = {
        name: frozenset(called for r in same for line in r.lines for called in calls_of(line))
        | frozenset(
            called
            for r in same
            for line in r.lines
            for of in own.get(_text(r, line), ())
            for called in _called(declared[of][1])
        )
        for name, same in routines.items()
    }
    starts = {
        name: frozenset[Text]().union(*(own.get(_text(r, line), frozenset()) for r in same for line in r.lines))
        for name, same in routines.items()
    }
    by_routine = with_called({name: (starts[name], calls[name]) for name in routines})
    local = {
        name: frozenset(
            text for text, (r, line) in declared.items() if r.name == name and line.verb == "DECL" and not line.shared
        )
        for name in routines
    }
    inner = with_called({name: (local[name], calls[name]) for name in routines})
    return Actions(
        effects=effects,
        started={
            text: found.union(
                *(by_routine.get(name, frozenset()) for of in found for name in _called(declared[of][1]))
            ).intersection(effects)
            for text, found in own.items()
        },
        ended=ended,
        local=local,
        by_routine={name: (found - inner[name]).intersection(effects) for name, found in by_routine.items()},
        missing={text: said for text, said in missing.items() if said},
    )


@dataclass(frozen=True, eq=False, kw_only=True)
class _Meant:
    """Which declarations a line that starts or ends actions may mean."""

    routines: Mapping[str, Sequence[Routine]]
    data: Data
    declared: Declared
    reachable: dict[str, frozenset[Text]] = field(default_factory=dict[str, frozenset[Text]])

    def __post_init__(self) -> None:
        own = {
            name: (
                frozenset(text for text, (r, line) in self.declared.items() if r.name == name and line.verb == "DECL"),
                frozenset(called for r in same for line in r.lines for called in calls_of(line)),
            )
            for name, same in self.routines.items()
        }
        self.reachable.update(with_called(own))

    def by(self, routine: Routine, line: Beside) -> frozenset[Text]:
        """Of an interrupt those that the routine and the ones it calls declare, else any of that number."""
        if line.keyword != "INTERRUPT":
            if line.verb == "ON":
                return frozenset({_text(routine, line)}).intersection(self.declared)
            names = _spelled(line)
            return frozenset(
                text
                for text, (_, other) in self.declared.items()
                if other.keyword == line.keyword and _within(names, _spelled(other))
            )
        everywhere = frozenset(text for text, (_, other) in self.declared.items() if other.verb == "DECL")
        number = self._number(routine, line)
        for texts in (self.reachable[routine.name], everywhere):
            if not line.number or number is None:
                found = texts
            else:
                found = frozenset(text for text in texts if self._number(*self.declared[text]) in (number, None))
            if found:
                return found
        return frozenset()

    def certain(self, routine: Routine, line: Beside, text: Text) -> bool:
        """Whether a line that ends actions ends that one for sure."""
        if line.keyword != "INTERRUPT":
            return True
        number = self._number(routine, line)
        return number is not None and self._number(*self.declared[text]) == number

    def _number(self, routine: Routine, line: Beside) -> float | bool | None:
        """The number of an interrupt; None where the text does not give it."""
        if len(line.number) != 1:
            return None
        (word,) = line.number
        if word.kind == "number":
            return plain_value(word.text)
        return self.data.number(word.upper, routine.file.module, routine.name)


def _lines(routines: Mapping[str, Sequence[Routine]]) -> Iterable[tuple[Routine, Beside]]:
    for same in routines.values():
        for routine in same:
            yield from ((routine, line) for line in routine.lines if isinstance(line, Beside))


def _text(routine: Routine, line: Statement) -> Text:
    return routine.file.number, line.start


def _called(line: Beside) -> tuple[str, ...]:
    """Names that an action calls."""
    return () if line.action is None else calls_of(line.action)


def _spelled(line: Beside) -> list[str]:
    return [word.upper for word in line.number]


def _within(names: Sequence[str], words: Sequence[str]) -> bool:
    """Whether the words of a signal's name stand in a row among those of the line that follows it."""
    return any(list(words[i : i + len(names)]) == list(names) for i in range(len(words) - len(names) + 1))


def _effect(
    routine: Routine,
    line: Beside,
    data: Data,
    alters: Mapping[str, frozenset[str]],
    changes: Mapping[str, frozenset[str]],
    followed: Callable[[str], bool],
) -> Action:
    assert line.action is not None
    keys = keys_changed_by(line.action, routine.names(data), data.by_value, changes)
    place = routine.file.source.place(line.start)
    match line.keyword, line.action:
        case "INTERRUPT", Call(name=name):
            source = f"{name}, which the interrupt of {place} calls"
        case "TRIGGER", Call(name=name):
            source = f"{name}, which the TRIGGER of {place} calls"
        case keyword, _:
            source = f"the {keyword} of {place}"
    end = "take it out" if line.keyword == "TRIGGER" else "turn that off"
    return Action(
        what=altered_by(line.action, alters),
        keys=frozenset(filter(followed, keys)),
        source=source,
        end=end,
    )


def _missing(
    line: Beside, actions: Sequence[Statement | None], routines: Mapping[str, Sequence[Routine]]
) -> Iterable[str]:
    """Diagnostics of what a line starts and the files do not have."""
    leaves = "is taken to leave $TOOL, $BASE and $IPO_MODE as they are"
    names = dict.fromkeys(action.name for action in actions if isinstance(action, Call))
    for name in names:
        if name not in routines and name not in HARMLESS:
            yield f"{name} is not in the files given; the {line.keyword} that calls it {leaves}"
    if not actions and line.keyword == "INTERRUPT" and line.number:
        number = "".join(word.text for word in line.number)
        yield f"interrupt {number} is declared in none of the files given; it {leaves}"


# The flow of a KRL program: what holds where each motion begins, through calls, branches, loops and jumps.
#
# What cannot be decided is gone through in all ways; behind them holds what is the same in all.

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


# What all passes through the lines of a KRL routine need: the expressions of a line, and what holds where ways meet.


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


# Labels of KRL: what holds where lines jump to them.


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


# Loops of KRL: turn by turn where the text decides how many there are, else with what holds in all of them.

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


# What calls of KRL routines are given, and what they give back.


@dataclass(frozen=True, kw_only=True)
class Arguments:
    """A call of a routine."""

    name: str
    """In capitals."""
    words: tuple[tuple[Word, ...], ...]
    """What each parameter is given."""
    handed: tuple[str, ...]
    """Variables that it may change, because they are not given by value."""


def function_called(
    words: Sequence[Word], routines: Container[str], by_value: Mapping[str, tuple[bool, ...]]
) -> Arguments | None:
    """The function of the program whose value is all of an expression; None where it is anything else."""
    called = whole_call(words)
    if called is None or called.name not in routines:
        return None
    return Arguments(name=called.name, words=called.arguments, handed=handed_over(called, by_value))


def behind_call(
    call: Arguments, routine: Routine, variables: Variables, names: Names, changed: Container[str]
) -> Variables:
    """Variables of the caller behind a call: those that it handed over as a whole hold what the parameters held at the end.

    Args:
        call: the call.
        routine: what is called.
        variables: behind its last line.
        names: of the caller.
        changed: keys of variables that the routine changes under their own names.
    """
    back = forgotten(without_own(variables, routine.prefix), map(names.key, call.handed))
    for parameter, words in zip(routine.parameters, call.words, strict=False):
        if len(words) != 1 or call.handed.count(words[0].upper) != 1:
            continue
        key, value = names.key(words[0].upper), variables.get(f"{routine.prefix}{parameter}")
        if value is None or key in changed or key in names.volatile or (isinstance(value, str) and value in HERE):
            continue
        plain = value.value if isinstance(value, Adjustable) else value
        if isinstance(plain, float) and not plain.is_integer() and words[0].upper in names.whole_numbers:
            continue
        back = {**back, key: value}
    return back


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
