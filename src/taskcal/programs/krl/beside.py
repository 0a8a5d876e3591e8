"""Actions that run beside the lines of a KRL program: interrupts, TRIGGER, and analog signals that are followed.

From the line that starts an action (INTERRUPT ON, TRIGGER, ANIN ON) to the one that ends it (INTERRUPT OFF, ANIN OFF), it may run
between any two lines (KUKA System Software, interrupt programming; cyclic analog inputs and outputs; path-related switching
actions). A TRIGGER runs once, but the advance run does not tell before which line.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

from taskcal.programs.call_graph import with_called
from taskcal.programs.krl.data import Data
from taskcal.programs.krl.data_lists import plain_value
from taskcal.programs.krl.findings import Text
from taskcal.programs.krl.routines import Routine, altered_by, calls_of, keys_changed_by
from taskcal.programs.krl.state import Held, State
from taskcal.programs.krl.syntax import Beside, Call, Statement
from taskcal.programs.krl.variables import Lost, forgotten

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
