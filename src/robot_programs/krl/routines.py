"""The routines of a KRL program: what each alters, which calls which, and what may run beside their lines."""

from collections.abc import Callable, Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise

from robot_programs.core.flow import Effects, Thing, with_called
from robot_programs.core.values import Lost
from robot_programs.krl.data import BUILT_IN, Data, File, Routine, Text, plain_value
from robot_programs.krl.frames import EVERYTHING, FrameVariable, State
from robot_programs.krl.syntax import (
    Assignment,
    Beside,
    Call,
    Control,
    Declaration,
    MotionLine,
    Statement,
    Word,
    passed_in,
)
from robot_programs.krl.values import Names, forgotten

Routines = Mapping[str, Sequence[Routine]]
"""The routines of each name, which several files may have."""
Declared = Mapping[Text, tuple[Routine, Beside]]
"""By file and first character, the lines that declare an action, with their routines."""


def routines_of(files: tuple[File, ...]) -> dict[str, list[Routine]]:
    """The routines of some files by name, which routines of several files may share."""
    out: dict[str, list[Routine]] = {}
    for file in files:
        for routine in file.sections if not file.holds_data and file.module != BUILT_IN else ():
            if routine.head is not None:
                out.setdefault(routine.name, []).append(routine)
    return out


_VARIABLES = {
    "$TOOL": "tool", "$BASE": "base", "$IPO_MODE": "mode", "FDAT_ACT": "parameters", "$VEL": "speed", "$APO": "approximation",
}  # fmt: skip
_COMMANDS = {
    "#INITMOV": EVERYTHING - {"motion"},
    "#PTP_PARAMS": frozenset({"tool", "base", "mode", "approximation"}),
    "#PTP_DAT": frozenset({"tool", "base", "mode", "approximation"}),
    "#FRAMES": frozenset({"tool", "base", "mode"}),
    "#CP_PARAMS": frozenset({"tool", "base", "mode", "speed", "approximation"}),
    "#CP_DAT": frozenset({"tool", "base", "mode", "approximation"}),
    "#VEL_CP": frozenset({"speed"}),
    "#TOOL": frozenset({"tool"}),
    "#BASE": frozenset({"base"}),
    "#EX_BASE": frozenset({"base"}),
}


def changed_by(
    line: Statement, names: Names, by_value: Mapping[str, tuple[bool, ...]], routines: Mapping[str, frozenset[str]]
) -> frozenset[str]:
    """Keys of the variables that a line assigns or hands over, and which of `EVERYTHING` it alters.

    Args:
        line: the line.
        names: of its routine.
        by_value: by name of a routine, which parameters are given by value.
        routines: by name, the same of what it calls.
    """
    facts, own = frozenset[str](), {*passed_in(line, by_value)}
    match line:
        case Assignment():
            own.add(line.variable)
            facts = frozenset({_VARIABLES[line.variable]} if line.variable in _VARIABLES else ())
        case Call(name="BAS"):
            facts = _COMMANDS.get(line.command, frozenset[str]())
            own = {variable for variable, what in _VARIABLES.items() if what in facts - {"parameters"}}
        case MotionLine():
            facts = frozenset({"motion"})
        case Control(keyword="FOR"):
            own.update(word.upper for word in line.words[:1])
        case _:
            pass
    return facts.union(map(names.key, own), *(routines.get(name, frozenset()) for name in calls_of(line)))


def calls_of(line: Statement) -> tuple[str, ...]:
    """Names that a line calls: of a routine, or of functions in its expressions."""
    match line:
        case Call():
            words = (word for argument in line.arguments for word in (*argument, None))
            return (line.name, *_before_parentheses(tuple(words)))
        case Assignment() | Control() | MotionLine():
            return _before_parentheses(line.words)
        case _:
            return ()


def _before_parentheses(words: Sequence[Word | None]) -> tuple[str, ...]:
    return tuple(
        a.upper for a, b in pairwise(words) if a is not None and b is not None and a.kind == "name" and b.text == "("
    )


def only_computes(routine: Routine, routines: Container[str]) -> bool:
    """Whether a call of a routine can be left out, once its value is known: it sets variables of its own and nothing else."""
    for line in routine.lines:
        match line:
            case Declaration():
                continue
            case Assignment() if line.variable in routine.declared:
                pass
            case Control():
                pass
            case _:
                return False
        if any(name in routines for name in calls_of(line)):
            return False
    return True


def effects_of(files: Iterable[File], routines: Routines, data: Data) -> Effects[str, str]:
    """What the routines of each name change; see `changed_by`.

    Those run beside the lines of others that are not called from the line before: by interrupts, beside a motion, or in the
    submit interpreter.
    """
    submitted = (line.name for file in files if file.submits for line in file.heads)
    acting = (name for _, line in declared_in(routines).values() for name in _called_by_action(line))

    def changed(routine: Routine) -> Iterator[frozenset[str]]:
        names = Names.of(routine, data)
        return (changed_by(line, names, data.by_value, {}) for line in routine.lines)

    return Effects(
        own={
            name: frozenset[str]().union(*(one for r in same for one in changed(r))) for name, same in routines.items()
        },
        calls={name: _called(same, routines) for name, same in routines.items()},
        beside=frozenset(routines).intersection((*submitted, *acting)),
    )


def concerned(routines: Routines, data: Data, changes: Mapping[str, frozenset[str]]) -> dict[str, frozenset[str]]:
    """Keys of the variables that the routines of each name read or change, or that what runs beside them changes."""
    beside = frozenset[str]().union(
        *(
            changed_by(line.action, Names.of(routine, data), data.by_value, changes)
            for routine, line in declared_in(routines).values()
            if line.action is not None
        )
    )

    def own(routine: Routine) -> Iterator[str]:
        names = Names.of(routine, data)
        yield from map(names.key, (*routine.file.read, *routine.own, *_BY_BAS))

    read = _through_calls(routines, own)
    return {name: read[name] | changes[name] | beside for name in routines}


def _through_calls(routines: Routines, own: Callable[[Routine], Iterable[Thing]]) -> dict[str, frozenset[Thing]]:
    """What the routines of each name have, by themselves or by those that they call."""
    return with_called(
        {
            name: (frozenset(thing for r in same for thing in own(r)), _called(same, routines))
            for name, same in routines.items()
        }
    )


def _called(same: Sequence[Routine], routines: Mapping[str, object]) -> frozenset[str]:
    return frozenset(name for r in same for line in r.lines for name in calls_of(line) if name in routines)


def callers_of(routines: Routines) -> Mapping[str, frozenset[str]]:
    """By name of routines: names of those that call them, or declare what runs beside them and does."""
    calls = {name: _called(same, routines) for name, same in routines.items()}
    for routine, line in declared_in(routines).values():
        calls[routine.name] |= frozenset(_called_by_action(line))
    return Effects(own=dict.fromkeys(routines, frozenset[str]()), calls=calls).callers


def roots_of(callers: Mapping[str, frozenset[str]]) -> dict[str, frozenset[str]]:
    """By name of routines: those that nothing calls, from which they are reached; themselves where nothing calls them."""
    own = {name: frozenset() if others else frozenset({name}) for name, others in callers.items()}
    return with_called({name: (own[name], others) for name, others in callers.items()})


_BY_BAS = frozenset({"LDAT_ACT", "PDAT_ACT", "TOOL_DATA", "BASE_DATA", *_VARIABLES})
"""Variables that the controller's own routine reads."""


def read_names(files: Iterable[File]) -> frozenset[str]:
    """Variables, and other names, that code reads anywhere."""
    return _BY_BAS.union(*(file.read for file in files if not file.holds_data))


def matters(line: Statement, read: frozenset[str], routines: Container[str]) -> bool:
    """Whether a line is of any consequence for motions: not what sets a variable that nothing reads.

    Args:
        line: the line.
        read: names that code reads.
        routines: names of the routines of the files.
    """
    match line:
        case Assignment():
            asks = passed_in(line, {}) or any(name in routines for name in calls_of(line))
            return bool(asks) or line.variable in read
        case MotionLine() | Call() | Control() | Beside():
            return True
        case _:
            return False


def _resuming(routines: Routines, declared: Declared) -> dict[str, frozenset[Text]]:
    """By name of a routine: interrupts that it declares whose routine resumes, which leaves what it calls."""
    resumes = _through_calls(routines, lambda r: (line.start for line in r.lines if _resumes(line)))
    return {
        name: frozenset(
            text
            for text, (routine, line) in declared.items()
            if routine.name == name
            and line.keyword == "INTERRUPT"
            and any(resumes.get(called) for called in _called_by_action(line))
        )
        for name in {routine.name for routine, _ in declared.values()}
    }


def _resumes(line: Statement) -> bool:
    return isinstance(line, Control) and line.keyword == "RESUME"


# Actions that run beside the lines of a KRL program: interrupts, TRIGGER, and analog signals that are followed.
#
# From the line that starts an action (INTERRUPT ON, TRIGGER, ANIN ON) to the one that ends it (INTERRUPT OFF, ANIN
# OFF), it may run between any two lines (KUKA System Software, interrupt programming; cyclic analog inputs and
# outputs; path-related switching actions). A TRIGGER runs once, but the advance run does not tell before which
# line.

HARMLESS = frozenset({"IR_STOPM"})
"""Routines of KUKA's own interrupts, which every controller has; as delivered they set neither frames nor points."""

_FRAMES = {"tool": "$TOOL", "base": "$BASE", "mode": "$IPO_MODE", "parameters": "FDAT_ACT"}


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
            state = state.lost(self._reason(_FRAMES.get(what, what)), frozenset({what}))
        if "mode" in self.what:
            state = replace(state, base=FrameVariable(frame=None, reason=self._reason("$IPO_MODE")))
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
    """Only of those that have any, or resume."""
    resuming: Mapping[str, frozenset[Text]] = field(default_factory=dict[str, frozenset[Text]])
    """By name of a routine: interrupts that it declares, and that leave what it calls."""
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


def declared_in(routines: Routines) -> Declared:
    """The lines that declare an action, with their routines."""
    return {
        _text(routine, line): (routine, line)
        for same in routines.values()
        for routine in same
        for line in routine.lines
        if isinstance(line, Beside) and line.action is not None
    }


def actions_of(
    routines: Routines,
    data: Data,
    changes: Mapping[str, frozenset[str]],
    followed: Callable[[str], bool],
) -> Actions:
    """The actions of a program.

    Args:
        routines: by name.
        data: the data lists.
        changes: by name of a routine, what it changes.
        followed: by key of a variable, whether its value is followed at all.
    """
    declared = declared_in(routines)
    lines = [(r, line) for same in routines.values() for r in same for line in r.lines if isinstance(line, Beside)]
    if not lines:
        return Actions()
    effects: dict[Text, Action] = {}
    resuming = _resuming(routines, declared)
    leaving = frozenset[Text]().union(*resuming.values())
    for text, (routine, line) in declared.items():
        action = _effect(routine, line, data, changes, followed)
        if action.what or action.keys or text in leaving:
            effects[text] = action
    meant = _Meant(routines=routines, data=data, declared=declared)
    own: dict[Text, frozenset[Text]] = {}
    ended: dict[Text, frozenset[Text]] = {}
    missing: dict[Text, tuple[str, ...]] = {}
    for routine, line in lines:
        found, text = meant.by(routine, line), _text(routine, line)
        if line.verb == "ON":
            own[text] = found
            missing[text] = tuple(_missing(line, [declared[of][1].action for of in sorted(found)], routines))
        elif line.verb == "OFF":
            exact = found if not line.number else frozenset(of for of in found if meant.certain(routine, line, of))
            ended[text] = exact.intersection(effects)
    starts = {
        name: frozenset[Text]().union(*(own.get(_text(r, line), frozenset()) for r in same for line in r.lines))
        for name, same in routines.items()
    }
    calls = {
        name: frozenset(called for r in same for line in r.lines for called in calls_of(line)).union(
            *(_called_by_action(declared[of][1]) for of in starts[name])
        )
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
        resuming=resuming,
        started={
            text: found.union(
                *(by_routine.get(name, frozenset()) for of in found for name in _called_by_action(declared[of][1]))
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

    routines: Routines
    data: Data
    declared: Declared

    @cached_property
    def reachable(self) -> dict[str, frozenset[Text]]:
        """By name of a routine: interrupts that it and those that it calls declare."""
        declares = {text for text, (_, line) in self.declared.items() if line.verb == "DECL"}
        return _through_calls(self.routines, lambda r: declares.intersection(_text(r, line) for line in r.lines))

    def by(self, routine: Routine, line: Beside) -> frozenset[Text]:
        """Declarations of an interrupt in the routine and the ones it calls, else any of that number."""
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


def _text(routine: Routine, line: Statement) -> Text:
    return routine.file.number, line.start


def _called_by_action(line: Beside) -> tuple[str, ...]:
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
    changes: Mapping[str, frozenset[str]],
    followed: Callable[[str], bool],
) -> Action:
    assert line.action is not None
    changed = changed_by(line.action, Names.of(routine, data), data.by_value, changes)
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
        what=changed & EVERYTHING,
        keys=frozenset(filter(followed, changed - EVERYTHING)),
        source=source,
        end=end,
    )


def _missing(line: Beside, actions: Sequence[Statement | None], routines: Routines) -> Iterable[str]:
    """Diagnostics of what a line starts and the files do not have."""
    leaves = "is taken to leave $TOOL, $BASE and $IPO_MODE as they are"
    names = dict.fromkeys(action.name for action in actions if isinstance(action, Call))
    for name in names:
        if name not in routines and name not in HARMLESS:
            yield f"{name} is not in the files given; the {line.keyword} that calls it {leaves}"
    if not actions and line.keyword == "INTERRUPT" and line.number:
        number = "".join(word.text for word in line.number)
        yield f"interrupt {number} is declared in none of the files given; it {leaves}"
