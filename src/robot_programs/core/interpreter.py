"""The one interpreter: what the data of a program hold where each motion begins, of any language lowered to `form`.

A language says what is declared, how parts are named, what its operators make of values, and what a motion is; all else is here.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Hashable, Iterable, Iterator, Mapping, Sequence, Set
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

from robot_programs.core import flow
from robot_programs.core.flow import Counts, Loop, Node
from robot_programs.core.form import (
    HERE,
    Arming,
    Ask,
    Assign,
    Check,
    Do,
    Expression,
    Hole,
    Key,
    Line,
    Lit,
    MoveLine,
    Op,
    Rec,
    Ref,
    Routine,
    asks_in,
    called,
    changed,
    expressions,
    inside,
)
from robot_programs.core.program import Cause, Motion, Unresolved
from robot_programs.core.values import (
    Here,
    Lost,
    Origin,
    Structure,
    blurred,
    by_hand,
    common,
    is_settable,
    operated,
    plain,
)

Path = tuple[Hashable, ...]
"""Names of parts of a datum."""

RESUMED = "it is not the same wherever the call may be left: an interrupt may resume behind it"

MAX_ROUNDS = 4
"""So often a program is gone through for what its computed indices set; behind that, they may set anything."""


@dataclass(frozen=True, eq=False, kw_only=True)
class FoundMotion:
    """A motion as it was found on some way."""

    motion: Any
    """It, or None where the language makes it of what is written when all are found."""
    written: Any
    """What the language needs to write it again."""
    meaning: tuple[Hashable, ...]
    """Equal where motions of one line do the same, from numbers of the same places."""


def known_motions(
    findings: flow.Findings[MoveLine, FoundMotion],
) -> Iterator[tuple[Motion, flow.Ordered[FoundMotion]]]:
    """Motions in the order of the text, each with how it was found, but for those of lines that are not known on all ways."""
    reasons = findings.reasons
    for one in findings.ordered(lambda each: each.text not in reasons, lambda line: line.at[:2]):
        move: Motion = one.motion.motion
        divisible = move.divisible and one.same_text == 1
        yield replace(
            move, follows=one.follows, begins_at_motion=one.begins_at_motion, texts_motions=one.same_text, divisible=divisible
        ), one  # fmt: skip


class LanguageMeaning(ABC):
    """What a language says of its data and motions."""

    PASSES: ClassVar[int]
    """So often all lines may be gone through again, for calls and the turns of loops."""
    SET: ClassVar[str]
    """What is said behind the name of a datum that a program sets, where to is not known."""
    UNSEEN: ClassVar[str] = ""
    """The same of a datum that is set beside the lines; empty where nothing else is said."""
    kept: Collection[Key] = ()
    """Data that are as declared where a program begins, but for what programs of the files set; strange ones did not run yet."""
    apart: Collection[Key] = ()
    """Data that are as declared where a program begins, but for what it sets itself: others of the files do not run with it."""
    HANDS_BACK: ClassVar[bool] = False
    """A parameter that is set stands for the datum that was given, which holds behind the call what it held."""
    ARMED: ClassVar[bool] = False
    """What routines set is known where they are not armed; they begin as those do that nothing calls, and what they call that is
    not in the files does not move the robot."""
    GROWS: ClassVar[bool] = False
    """What is set to a structure may leave out parts that are set then."""
    INDEX_BY_HAND: ClassVar[bool] = False
    """An index may be what an operator can change, which then is taken as it is."""
    PLACES: ClassVar[bool] = False
    """Data may hold `Here`."""

    flow: "Interpreter"
    """Goes through the program; none is while it is asked for what is stated."""

    def begin(self, flow: "Interpreter") -> None:
        """Take what goes through the program from now on."""
        self.flow = flow

    @abstractmethod
    def declared(self, key: Key) -> Any:
        """The value that is declared; `Lost` where none is, with what is to be said behind its name. The same each time."""

    @abstractmethod
    def part_names(self, value: Structure, indices: Sequence[float]) -> Sequence[Hashable]:
        """Names of the parts of parts to which indices lead.

        Raises:
            Unresolved: there are none.
        """

    @abstractmethod
    def blank(self, key: Key, names: Sequence[Hashable], lost: Lost) -> Any:
        """What a part of something is set in that is not known; `lost` where the rest of it stays unknown then.

        Args:
            key: of the datum.
            names: of the parts of parts that lead to the something; none of the datum itself.
            lost: what is said of it.
        """

    @abstractmethod
    def coerced(self, key: Key, value: Any) -> Any:
        """What data hold when a value is assigned to them, or to a part of them."""

    @abstractmethod
    def motion(self, line: Any, points: Sequence[Any], settings: Mapping[str, Any]) -> FoundMotion:
        """The motion of a line.

        Args:
            line: as the language lowered it.
            points: values of its points, which are known.
            settings: values of its settings, known or not.

        Raises:
            Unresolved: it is not known.
        """

    def operate(self, sign: str, values: Sequence[Any]) -> Any:
        """Value of an operator applied to its operands.

        Raises:
            Unresolved: it has none.
        """
        return operated(sign, values)

    def stated(self, ref: Ref) -> Path:
        """Names of the parts of parts to which a path leads whose indices are stated, as far as there are such parts."""
        path, value = list[Hashable](), self.declared(ref.key)
        for step in ref.path:
            if not isinstance(value, Structure):
                break
            try:
                indices = [index.value for index in step if isinstance(index, Lit)] if isinstance(step, tuple) else []
                names = [step] if isinstance(step, str) else self.part_names(value, indices)
                for name in names:
                    value = value.part(name) if isinstance(value, Structure) else value
            except Unresolved:
                break
            path += names
        return tuple(path)

    def how_set(self, by: Line | Ask, ref: Ref) -> str:
        """What is said behind the name of a datum that a line sets, or a function may change, where to is not known."""
        return by.why if isinstance(by, Do) else self.SET

    def incomplete(self, line: Any, why: Unresolved, settings: Mapping[str, Any]) -> Unresolved:
        """What is said of a motion with a point that is not known."""
        return why

    def is_settable(self, key: Key) -> bool:
        """Whether an operator may change a datum by hand, as long as the program did not set it."""
        return False

    def is_fixed(self, key: Key) -> bool:
        """Whether nothing changes a datum, whatever it is given to."""
        return False

    def is_armed_alone(self, key: Key) -> bool:
        """Whether a datum is known, in a language with `ARMED`, that a routine sets which may run beside the lines of others."""
        return False

    def by_hand(self, value: Any) -> Any:
        """A number, truth value or text as one that an operator may change."""
        return by_hand(value)

    def beside(self, routine: Routine, key: Key) -> Lost | None:
        """What is said of a datum that a routine may set which runs beside the lines; None where nothing else is said."""
        return None

    def lost_all(self, keys: Iterable[Key] | None, why: str) -> Mapping[Key, Any]:
        """What is held by some data that are no longer known, or by all; of others, it is what is known of them anywhere."""
        return {}

    def where(self, place: Here, look: Callable[[Key], Any]) -> Any:
        """The place of the robot.

        Args:
            place: as a datum holds it.
            look: gives what a datum holds, `Lost` where it is not known.

        Raises:
            Unresolved: it is not known.
        """
        raise Unresolved("where the robot is, is known only at run time")

    def initial(self, key: Key) -> Any:
        """What a variable of a routine holds where that begins; None where nobody knows."""
        return None

    def fresh(self, routine: Routine) -> Mapping[Key, Any]:
        """What holds where a routine begins for the first time that nothing calls."""
        return {}

    def given(self, ask: "Do | Ask", argument: Expression, parameter: Key, value: Any) -> Any:
        """What a parameter holds that is given a value by a call."""
        return value

    def function(self, ask: Ask, values: Sequence[Any]) -> Any:
        """Value of a function of the language.

        Raises:
            Unresolved: it is not known.
        """
        raise Unresolved(f"the value of {ask.name}() is known only at run time")

    def lost(self, ref: Ref, name: str, reason: str) -> str:
        """What is said of a datum that is not known."""
        return Cause(f"{name} {reason}", of=[reason])

    def called(self, ref: Ref, indices: Sequence[float]) -> str:
        """Name of a datum with its indices, for messages."""
        return f"{ref.name}[{','.join(f'{index:g}' for index in indices)}]"

    def takes_unknown(self, sign: str) -> bool:
        """Whether an operator is given `Lost` for an operand that is not known; else its value is not known then."""
        return False

    def computed_index(self, name: str, why: Unresolved) -> Unresolved:
        """What is said where an index of a datum is not known."""
        return Unresolved(Cause(f"the index of {name} is not known: {why}", of=[str(why)]))


@dataclass(frozen=True, kw_only=True)
class Moment(flow.FlowState):
    """State at a place of a program, with the routines that may run beside it."""

    armed: frozenset[Routine] = frozenset()

    def joined(self, others: Sequence[Any], why: str) -> "Moment":
        """Join the states after several ways; see `flow.FlowState.joined`."""
        return super().joined(others, why).having(armed=self.armed.union(*(other.armed for other in others)))

    def common(self, values: Sequence[Any], why: str) -> Any:
        """What is known of a datum after several ways, with what is said behind its name where they differ."""
        return common(values, why.removeprefix("it "))


@dataclass(frozen=True, eq=False, kw_only=True)
class ProgramChanges:
    """What the routines of a program change."""

    effects: flow.Effects[Routine, Key]
    paths: Mapping[Key, Mapping[Path, str]]
    """Parts of data that are set anywhere, as far as they are stated, with what is said behind the name of each."""
    own_paths: Mapping[Key, Mapping[Path, str]]
    """Those of them that the routines set themselves."""
    changing: frozenset[Key]
    """Data that lines set, beside those in which loops count."""
    concerns: Mapping[Routine, frozenset[Key]]
    """All data on which depends what a routine does; none of one that may do anything."""
    moving: frozenset[Routine]
    """Routines that move the robot, or may."""
    driving: frozenset[Routine]
    """Routines that are taken to move it where they run beside the lines."""
    arming: Mapping[Routine, frozenset[Routine]]
    """What each may leave running beside."""
    asks: Mapping[Line, tuple[Ask, ...]]
    """Functions in the expressions of lines, of those that have any."""
    returned: frozenset[Key]
    """Parameters that routines set to hand that back."""
    lent: Mapping[Routine, Mapping[Key, str]]
    """What may be changed on the ways through a routine alone, with what is said behind its name."""
    roots: frozenset[Routine]
    """Routines that nothing calls, and in which the program begins."""
    resuming: frozenset[Routine]
    """Routines in which an error handler may move the robot, and go on anywhere."""
    left: frozenset[Routine]
    """Routines whose calls something may leave that runs beside the lines."""
    unseen: frozenset[Key]
    """Data that may change at any time."""
    running: frozenset[Routine]
    """Routines that may run beside the lines of which nothing is known."""
    unled: frozenset[Routine]
    """Routines of which is not followed how they are called."""
    apart: Mapping[Routine, frozenset[tuple[Key, Path, str]]]
    """By routine: parts of data of `LanguageMeaning.apart` set on the ways through it, with what is said behind their names."""

    def by(self, line: Line) -> tuple[Ref, ...]:
        """What a line changes, with what it gives to be changed, but for what its routines change otherwise."""
        return (*changed(line), *_handed((*self.asks.get(line, ()), line), self.returned))

    def run(self, line: Line) -> frozenset[Routine]:
        """Routines that may run in a line."""
        return _run(line, self.asks.get(line, ()))

    def moves(self, line: Line) -> bool:
        """Whether the robot may be elsewhere behind a line."""
        return _moves(line, self.asks.get(line, ())) or not self.moving.isdisjoint(self.run(line))


def _run(line: Line, asks: Sequence[Ask]) -> frozenset[Routine]:
    return frozenset(called(line)).union(*(ask.routines for ask in asks))


def _moves(line: Line, asks: Sequence[Ask]) -> bool:
    """Whether a line moves the robot itself, or may, but for the routines that it calls."""
    itself = isinstance(line, MoveLine) or (isinstance(line, Do) and (line.moves or line.any))
    return itself or any(ask.moves for ask in asks)


def _handed(calls: Iterable[Line | Ask], returned: Set[Key]) -> Iterator[Ref]:
    """Data that functions change, or that calls give to parameters that set them."""
    for call in calls:
        if not isinstance(call, Do | Ask):
            continue
        for k, argument in enumerate(call.arguments if call.routines else ()):
            sets = (k < len(r.parameters) and r.parameters[k] in returned for r in call.routines)
            if isinstance(argument, Ref) and any(sets):
                yield argument
        yield from call.changes if isinstance(call, Ask) else ()


Computed = Mapping[Ref, Set[Path]]
"""Parts to which assignments led whose indices are computed; the empty path stands for all."""


def changes_of(routines: Sequence[Routine], meaning: LanguageMeaning, computed: Computed) -> ProgramChanges:
    """What the routines of a program change, those included that run beside.

    Args:
        routines: of the files.
        meaning: of the language.
        computed: what is taken to be set by computed indices.
    """
    lines = {routine: list(routine.lines) for routine in routines}
    armed = {
        routine: frozenset(other for line in own if isinstance(line, Arming) and line.on for other in line.routines)
        for routine, own in lines.items()
    }
    lines |= {other: list(other.lines) for others in armed.values() for other in others if other not in lines}
    handling = {one: Routine(name=one.name, handlers=one.handlers) for one in lines if one.handlers}
    everything = lines | {handlers: list(handlers.lines) for handlers in handling.values()}
    reads, asks = dict[Routine, set[Key]](), dict[Line, tuple[Ask, ...]]()
    for routine, of in everything.items():
        reads[routine] = _read(of, asks)
    calls = {
        routine: frozenset[Routine]().union(*(_run(line, asks.get(line, ())) for line in of if _has_calls(line, asks)))
        for routine, of in everything.items()
    }
    callers = flow.Effects[Routine, Key](
        own={routine: frozenset() for routine in lines}, calls={r: calls[r] for r in lines}
    )
    late = [routine for routine, of in everything.items() if any(isinstance(line, Do) and line.any for line in of)]
    calls |= dict.fromkeys(late, frozenset(everything))
    returned = _returned(lines, asks)
    parts = {
        line: (*changed(line), *_handed((*asks.get(line, ()), line), returned))
        for of in everything.values() for line in of if line in asks or not isinstance(line, MoveLine | Arming)
    }  # fmt: skip
    own = {
        routine: frozenset(ref.key for line in of for ref in parts.get(line, ())) for routine, of in everything.items()
    }
    sole = frozenset(r for r in lines if r.beside).union(handling.values())
    beside = sole.union(*armed.values())
    effects = flow.Effects(own=own, calls=calls, beside=beside)
    unseen, running, unled = effects.unseen, frozenset(beside), frozenset(beside)
    if meaning.ARMED:
        kept = (key for routine in sole for key in effects.within[routine] if not meaning.is_armed_alone(key))
        unseen, running, unled = frozenset(kept), frozenset[Routine]().union(*armed.values()), frozenset[Routine]()
    paths: dict[Key, dict[Path, str]] = {}
    own_paths: dict[Key, dict[Path, str]] = {}
    for line, refs in parts.items():
        for ref in (ref for ref in refs if not meaning.is_fixed(ref.key)):
            why = meaning.UNSEEN if meaning.UNSEEN and ref.key in unseen else meaning.how_set(line, ref)
            for path in [meaning.stated(ref)] if _is_stated(ref) else computed.get(ref, ()):
                paths.setdefault(ref.key, {}).setdefault(path, why)
                if not isinstance(line, Do):
                    own_paths.setdefault(ref.key, {})[path] = why
    outside = (routine for routine in lines if not routine.name)
    apart = _set_apart(everything, calls, parts, meaning, computed, sole.union(outside)) if meaning.apart else {}
    always = frozenset[Key]().union(*(effects.within[routine] for routine in beside))
    concerns = {r: always.union(reads[r], own[r], r.parameters, r.variables) for r in lines}
    odd = {routine: frozenset({True} if _is_odd(routine.nodes) else ()) for routine in lines}
    odd = flow.with_called({routine: (found, calls[routine]) for routine, found in odd.items()})
    concerns = flow.with_called({routine: (found, calls[routine]) for routine, found in concerns.items()})
    moves = {
        routine: frozenset({True} if any(_moves(line, asks.get(line, ())) for line in of) else ())
        for routine, of in everything.items()
    }
    moving = {r for r, found in flow.with_called({r: (own, calls[r]) for r, own in moves.items()}).items() if found}
    driving = moving
    if meaning.ARMED:
        lead = {
            r: frozenset({True} if any(isinstance(line, MoveLine) for line in of) else ())
            for r, of in everything.items()
        }
        driving = {r for r, found in flow.with_called({r: (own, calls[r]) for r, own in lead.items()}).items() if found}
    lent = {
        routine: frozenset(
            (ref.key, meaning.how_set(by, ref))
            for line in of
            if _has_calls(line, asks)
            for by in (line, *asks.get(line, ()))
            if isinstance(by, Do | Ask)
            for ref in by.lends
        )
        for routine, of in everything.items()
    }
    around = flow.Effects(own=lent, calls=calls).around if any(lent.values()) else {}
    return ProgramChanges(
        effects=effects,
        paths=paths,
        own_paths=own_paths,
        changing=frozenset(
            ref.key for line, refs in parts.items() if not isinstance(line, Check) or line in asks for ref in refs
        ),
        concerns={routine: found for routine, found in concerns.items() if not odd[routine]},
        moving=frozenset(moving),
        driving=frozenset(driving),
        arming=_left_armed(lines, armed, calls),
        asks=asks,
        returned=returned,
        lent={routine: dict(sorted(found, key=lambda one: one[1])) for routine, found in around.items() if found},
        roots=frozenset(r for r in lines if r.begins or (meaning.ARMED and r.beside) or not callers.callers[r] - {r}),
        resuming=frozenset(r for r, handlers in handling.items() if handlers in moving),
        left=frozenset(r.resumes for r in lines if r.resumes is not None),
        unseen=unseen,
        running=running,
        unled=unled,
        apart=apart,
    )


def _left_armed(
    lines: Mapping[Routine, Any],
    armed: Mapping[Routine, frozenset[Routine]],
    calls: Mapping[Routine, frozenset[Routine]],
) -> dict[Routine, frozenset[Routine]]:
    """What each routine may leave running beside the lines, itself or by those that it calls."""
    none = frozenset[Routine]()
    started = {routine: armed.get(routine, none) for routine in lines}
    inner = {r: calls[r].union(*(calls[other] for other in started[r])) for r in lines}
    found = flow.with_called({routine: (started[routine], inner[routine]) for routine in lines})
    if not any(routine.disarms for routine in lines):
        return found
    local = flow.with_called({routine: (routine.disarms, inner[routine]) for routine in lines})
    return {routine: found[routine] - local[routine] for routine in lines}


def _set_apart(
    everything: Mapping[Routine, Sequence[Line]],
    calls: Mapping[Routine, frozenset[Routine]],
    parts: Mapping[Line, Sequence[Ref]],
    meaning: LanguageMeaning,
    computed: Computed,
    always: Iterable[Routine],
) -> dict[Routine, frozenset[tuple[Key, Path, str]]]:
    """Parts of data of `LanguageMeaning.apart` that routines set, with what runs beside all of them."""
    keys = frozenset(meaning.apart)
    own = {
        routine: frozenset(
            (ref.key, path, meaning.how_set(line, ref))
            for line in of for ref in parts.get(line, ()) if ref.key in keys
            for path in ([meaning.stated(ref)] if _is_stated(ref) else computed.get(ref, ()))
        )
        for routine, of in everything.items()
    }  # fmt: skip
    armed = {
        r: frozenset(o for line in of if isinstance(line, Arming) for o in line.routines)
        for r, of in everything.items()
    }
    found = flow.Effects(own=own, calls={routine: calls[routine] | armed[routine] for routine in everything})
    beside = frozenset[tuple[Key, Path, str]]().union(*(found.within[routine] for routine in always))
    return {routine: one | beside for routine, one in found.around.items()}


def _has_calls(line: Line, asks: Mapping[Line, Any]) -> bool:
    return isinstance(line, Do) or line in asks


def _read(lines: Iterable[Line], asks: dict[Line, tuple[Ask, ...]]) -> set[Key]:
    """Data that some lines read; functions in them are noted."""
    found, shared = set[Key](), set[int]()
    for line in lines:
        if isinstance(line, MoveLine):  # many have the same settings
            new = id(line.settings) not in shared
            shared.add(id(line.settings))
            whole = (*line.points, *line.settings.values()) if new else line.points
        else:
            whole = expressions(line)
        own: list[Ask] = []
        for one in whole:
            match one:
                case Lit() | Hole():
                    pass
                case Ref(path=()):
                    found.add(one.key)
                case _:
                    found.update(part.key for part in inside(one) if isinstance(part, Ref))
                    own += asks_in(one)
        if own:
            asks[line] = tuple(dict.fromkeys(own))
    return found


def _returned(lines: Mapping[Routine, Sequence[Line]], asks: Mapping[Line, tuple[Ask, ...]]) -> frozenset[Key]:
    """Parameters that routines set to hand that back, by themselves or through those that they give them to."""
    ways = frozenset[Key]().union(*(routine.returning for routine in lines))
    found = frozenset(ref.key for of in lines.values() for line in of for ref in changed(line)) & ways if ways else ways
    passing = [line for of in lines.values() for line in of if _has_calls(line, asks)] if ways else []
    while more := {ref.key for line in passing for ref in _handed((*asks.get(line, ()), line), found)} & ways - found:
        found |= more
    return found


def _is_odd(nodes: flow.Block) -> bool:
    """Whether anything may happen in some nodes, so that no summary tells what did."""
    return any(
        isinstance(node, flow.Unknown)
        or (isinstance(node, flow.FlowStep) and isinstance(node.line, Do) and node.line.any)
        for node in flow.nodes_in(nodes)
    )


def _is_stated(ref: Ref) -> bool:
    """Whether the text states all indices of a path."""
    return all(isinstance(index, Lit) for step in ref.path if isinstance(step, tuple) for index in step)


@dataclass(eq=False, kw_only=True)
class Interpreter(flow.Flow[Moment, Routine]):
    """A program that is gone through."""

    meaning: LanguageMeaning
    changes: ProgramChanges
    findings: flow.Findings[MoveLine, FoundMotion] = field(default_factory=flow.Findings[MoveLine, FoundMotion])
    bodies: dict[Routine, flow.RoutineBody] = field(default_factory=dict[Routine, flow.RoutineBody])
    dim: dict[Key, Any] = field(default_factory=dict[Key, Any])
    """Declared values without what is set anywhere."""
    computed: dict[Ref, set[Path]] = field(default_factory=dict[Ref, set[Path]])
    """What was set by computed indices."""
    met: dict[MoveLine, tuple[list[Any], FoundMotion]] = field(
        default_factory=dict[MoveLine, tuple[list[Any], FoundMotion]]
    )
    """By line, the motion that was found last, with all on which it depends."""
    routines: Sequence[Routine]
    lent: Mapping[Key, str] = field(default_factory=dict[Key, str])
    """What may be changed on the ways that are gone through, with what is said behind its name."""
    aside: Mapping[Key, Any] = field(default_factory=dict[Key, Any])
    """What is known of `LanguageMeaning.apart` on the ways that are gone through."""
    asides: dict[frozenset[Any], Mapping[Key, Any]] = field(default_factory=dict[frozenset[Any], Mapping[Key, Any]])
    """The same, by what is set there."""
    ends: dict[Routine, Moment] = field(default_factory=dict[Routine, Moment])
    """States behind routines that are gone through before others begin."""
    quiet: bool = False
    """Lines are gone through only for what they leave behind."""
    left_in: list[Moment] = field(default_factory=list[Moment])
    """What holds in all places at which the calls may be left that are being made, the innermost last."""
    disturbed: dict[frozenset[Routine], tuple[Mapping[Key, Lost], frozenset[Key], bool]] = field(
        default_factory=dict[Any, Any]
    )
    """What may happen beside the lines, by the routines that may run there."""

    def body(self, routine: Routine) -> flow.RoutineBody:
        """Nodes of a routine."""
        if routine not in self.bodies:
            backward, entered = flow.labels_of(routine.nodes, routine.handlers)
            size = 1 + sum(1 for _ in flow.lines_in(routine.nodes))
            self.bodies[routine] = flow.RoutineBody(
                nodes=routine.nodes, handlers=routine.handlers, size=size, backward=backward, entered=entered | routine.unread
            )  # fmt: skip
        return self.bodies[routine]

    def name(self, routine: Routine) -> str:
        """Name of a routine, for messages."""
        return routine.name

    def walk(self, routine: Routine, inside: tuple[Routine, ...]) -> "Walker":
        """A pass through a routine."""
        return Walker(flow=self, routine=routine, inside=inside)

    def anything(self, why: str) -> Moment:
        """State in which anything may hold, and all may run that ever does."""
        return Moment(variables={**self.meaning.lost_all(None, why), **self.aside}, armed=self.changes.running)

    def start(self, routine: Routine) -> Moment:
        """State where a routine begins that nothing calls."""
        if routine.behind is not None:
            before = self._end(routine.behind)
            return self.entered(routine, replace(before, last=None)) if before.reached else self.start(routine.behind)
        if self.all_ways:
            return self.called_anywhere(routine, "")
        self.lent, self.aside = self.changes.lent.get(routine, {}), self._apart(routine)
        kept = {
            key: blurred(self.meaning.declared(key), (own := self.changes.own_paths.get(key, {})), own)
            for key in self.meaning.kept
        }
        return self.entered(routine, self._repeated(routine, Moment(variables={**kept, **self.aside})))

    def _apart(self, routine: Routine) -> Mapping[Key, Any]:
        """What is known of data wherever a routine runs that others set which do not run with it; made once."""
        changed = self.changes.apart.get(routine, frozenset())
        if changed not in self.asides:
            found = {key: dict[Path, str]() for key in self.meaning.apart if key not in self.changes.unseen}
            for key, path, why in sorted(changed, key=lambda one: one[2]):
                found.get(key, {}).setdefault(path, why)
            self.asides[changed] = {key: blurred(self.meaning.declared(key), own, own) for key, own in found.items()}
        return self.asides[changed]

    def _end(self, routine: Routine) -> Moment:
        """State behind a routine that nothing calls."""
        if routine not in self.ends:
            self.ends[routine], _ = self.through(routine, self.start(routine))
        return self.ends[routine]

    def called_anywhere(self, routine: Routine, why: str) -> Moment:
        """State where a routine begins of which it is not followed how it is called."""
        self.lent, self.aside = self.changes.lent.get(routine, {}), self._apart(routine)
        return self.entered(routine, self.anything(why))

    def entered(self, routine: Routine, state: Moment) -> Moment:
        """State at the start of a routine, whose variables begin anew there."""
        own = (*routine.parameters, *routine.variables)
        if not own:
            return state
        unseen, found = self.changes.unseen, dict[Key, Any]()
        for key in routine.variables:
            value = None if key in unseen else self.meaning.initial(key)
            if value is not None:
                found[key] = value
        return state.forgotten(own).holding(found)

    def _repeated(self, routine: Routine, start: Moment) -> Moment:
        """State where a root begins, again and again behind its end: with what it leaves as it was."""
        unseen = self.changes.unseen
        fresh = {key: value for key, value in self.meaning.fresh(routine).items() if key not in unseen}
        if not (fresh and routine.begins):
            return start.holding(fresh)
        quiet = replace(
            self, quiet=True, anywhere=set[Routine](), summaries=dict[Hashable, Any](), entered_behind=[], computed={}
        )
        begins = start.holding(fresh)
        while fresh:
            behind, _ = quiet.through(routine, quiet.entered(routine, begins))
            if not behind.reached:
                break
            why = f"{routine.name} begins again behind its end, where it may hold something else"
            again = begins.joined([behind], why).variables
            kept = {key: again[key] for key in fresh if key in again}
            if kept == fresh:
                break
            fresh, begins = kept, start.holding(kept)
        return begins

    def disturbance(self, armed: frozenset[Routine]) -> tuple[Mapping[Key, Lost], frozenset[Key], bool]:
        """What routines may set that run beside the lines, with what is said of it, or else forgotten, and whether they move."""
        if armed not in self.disturbed:
            lost, every = dict[Key, Lost](), set[Key]()
            for routine in sorted(armed, key=lambda one: one.name):
                within = self.changes.effects.within[routine]
                every |= within
                for key in within - self.changes.unseen - lost.keys():
                    said = self.meaning.beside(routine, key)
                    lost |= {} if said is None else {key: said}
            moves = not self.changes.driving.isdisjoint(armed)
            self.disturbed[armed] = lost, frozenset(every - lost.keys()), moves
        return self.disturbed[armed]

    def evaluated(self, expression: Expression) -> Any:
        """Value of an expression by what is declared alone; `Lost` where it is not known."""
        lent, self.lent = self.lent, {}
        try:
            return Walker(flow=self, routine=Routine(name=""), inside=()).partly(expression, Moment())
        finally:
            self.lent = lent

    def found_all(self, routine: Routine) -> bool:
        """Whether all motions of a routine were found."""
        return all(line in self.findings.seen for line in routine.lines if isinstance(line, MoveLine))

    def link(self, number: int, before: int | None) -> None:
        """Note the number of the motion before one."""
        self.findings.link(number, before)

    def known_anywhere(self, key: Key) -> Any:
        """What is known of a datum at any place: what is declared, but for what is set anywhere."""
        if key in self.lent and () not in self.changes.paths.get(key, {}):
            return Lost(reason=self.lent[key])
        if key not in self.dim:
            paths = self.changes.paths.get(key, {})
            self.dim[key] = blurred(self.meaning.declared(key), paths, paths)
        return self.dim[key]

    def depends_on(self, routine: Routine, entry: Moment) -> Hashable | None:
        """All on which depends what a routine does, but the motion before it; None where it may do anything."""
        concerns = self.changes.concerns.get(routine)
        if concerns is None or self.left_in:  # what holds inside it counts, too
            return None
        held = frozenset((key, type(v), v) for key, v in entry.variables.items() if key in concerns)
        return routine, bool(self.scouting), entry.armed, held, id(self.lent), id(self.aside)

    def after_summary(self, routine: Routine, entry: Moment, end: Moment) -> Moment:
        """State after a routine, with all that does not concern it as it was before."""
        concerns = self.changes.concerns.get(routine)
        if concerns is None or not end.reached:
            return end
        kept = {key: value for key, value in entry.variables.items() if key not in concerns}
        if self.meaning.PLACES and routine in self.changes.moving:
            kept = {key: value for key, value in kept.items() if type(value) is not Here}
        return end.having(variables=kept | {key: value for key, value in end.variables.items() if key in concerns})


@dataclass(eq=False, kw_only=True)
class Walker(flow.FlowWalk[Moment, Routine]):
    """One pass through a routine."""

    SCOUTS = 2

    flow: Interpreter  # pyright: ignore[reportIncompatibleVariableOverride]
    noted: tuple[Mapping[Key, Any], Mapping[Ask, Any]] | None = None
    """What functions of the program returned that were called last, and in which state."""

    @property
    def unreached(self) -> Moment:
        """State of places that control does not reach."""
        return Moment(reached=False)

    # Values.

    def value(self, expression: Expression, state: Moment) -> Any:
        """Value of an expression.

        Raises:
            Unresolved: it is not known.
        """
        match expression:
            case Lit():
                return expression.value
            case Ref():
                held = self.held(expression, state)
                if isinstance(held, Lost) and held.told:
                    raise Unresolved(held.reason)
                if isinstance(held, Lost):
                    raise Unresolved(self.flow.meaning.lost(expression, self._name(expression, state), held.reason))
                if type(held) is Here:
                    return self.flow.meaning.where(held, lambda key: plain(self._whole(key, state)))
                return plain(held)
            case Op():
                meaning = self.flow.meaning
                value = self.partly if meaning.takes_unknown(expression.sign) else self.value
                return meaning.operate(expression.sign, [value(operand, state) for operand in expression.operands])
            case Rec():
                parts = {name: self._handed(part, state) for name, part in expression.parts.items()}
                origin = Origin(at=expression.at, owner=None)
                return Structure(kind=expression.kind, parts=parts, origin=origin).bounded()
            case Ask() if expression.routines:
                if self.noted is None or self.noted[0] is not state.variables or expression not in self.noted[1]:
                    raise Unresolved(f"the value of {expression.name}() is known only at run time")
                return plain(self.noted[1][expression])
            case Ask():
                given = [self.value(argument, state) for argument in expression.arguments]
                return self.flow.meaning.function(expression, given)
            case Hole():
                raise Unresolved(expression.why)

    def partly(self, expression: Expression, state: Moment) -> Any:
        """Value of an expression; `Lost` where it is not known."""
        try:
            return self.value(expression, state)
        except Unresolved as why:
            return Lost(reason=str(why), told=True)  # which may be a `Cause`

    def held(self, ref: Ref, state: Moment) -> Any:
        """What a datum holds; where it is not known, `Lost` with what is to be said behind its name.

        Raises:
            Unresolved: which part of it is meant is not known, or there is no such part.
        """
        value = self._whole(ref.key, state)
        if ref.path and not isinstance(value, Structure | Lost):
            raise Unresolved(f"{ref.name} has no parts")
        for name in self._part_names(ref, value, state) if isinstance(value, Structure) else ():
            if isinstance(value, Lost):
                break
            if not isinstance(value, Structure):
                raise Unresolved(f"{ref.name} has no part {name}")
            value = value.part(name)
        return value

    def _whole(self, key: Key, state: Moment) -> Any:
        if key == HERE:
            return self._before(state)
        found = state.variables.get(key)
        return self.flow.known_anywhere(key) if found is None else found

    def _before(self, state: Moment) -> FoundMotion | Lost:
        """The motion before a line."""
        last = state.last
        if last == flow.ENTRY:  # which one that is, no summary tells
            self.flow.unclear += 1
            last = self.flow.before(last)
        if last is None or last < 0:
            return Lost(reason="is not known")
        return self.flow.findings.occurrences[last].motion

    def _part_names(self, ref: Ref, value: Structure, state: Moment) -> list[Hashable]:
        """Names of the parts of parts to which the path of a datum leads."""
        names: list[Hashable] = []
        part: Any = value
        for step in ref.path:
            if isinstance(part, Lost):
                break
            if not isinstance(part, Structure):
                raise Unresolved(f"a part of {ref.name} has no parts")
            own = () if isinstance(step, str) else self._indices(ref, [step], state)
            more = [step] if isinstance(step, str) else self.flow.meaning.part_names(part, own)
            for name in more:
                part = part.part(name) if isinstance(part, Structure) else part
            names += more
        return names

    def _indices(self, ref: Ref, path: Sequence[Any], state: Moment) -> list[float]:
        """Indices in a part of the path of a datum."""
        try:
            by_hand = self.flow.meaning.INDEX_BY_HAND
            return [
                self._number(index, state, by_hand=by_hand)
                for step in path
                if isinstance(step, tuple)
                for index in step
            ]
        except Unresolved as why:
            raise self.flow.meaning.computed_index(ref.name, why) from None

    def _number(self, expression: Expression, state: Moment, *, by_hand: bool = False) -> float:
        """A number that decides which part is meant, or how often a loop is gone through."""
        value = self.value(expression, state)
        if not isinstance(value, float):
            raise Unresolved("a number is expected where there is none")
        if not by_hand and not isinstance(expression, Lit) and self._is_settable(expression, state):
            raise Unresolved("it may be changed by hand")
        return value

    def _name(self, ref: Ref, state: Moment) -> str:
        """Name of a datum with its indices, for messages."""
        if not ref.path:
            return ref.name
        return self.flow.meaning.called(ref, self._indices(ref, ref.path, state))

    def _is_settable(self, expression: Expression, state: Moment) -> bool:
        """Whether an operator may change by hand what an expression is computed of."""
        for one in inside(expression):
            if isinstance(one, Ref):
                if one.key not in state.variables and self.flow.meaning.is_settable(one.key):
                    return True
                try:
                    if is_settable(self.held(one, state)):
                        return True
                except Unresolved:
                    pass
            elif isinstance(one, Ask) and self.noted is not None and is_settable(self.noted[1].get(one)):
                return True
        return False

    # What a language says to `flow.FlowWalk`, here for all of them.

    def asked(self, line: Any, state: Moment, node: Node) -> Moment:
        """State after the functions in the conditions of a line."""
        if line not in self.flow.changes.asks:
            return state
        if not isinstance(node, flow.Branches):
            # the bounds of a counted loop are read once, while they are asked for in every turn
            counts = isinstance(node, Loop) and node.kind == "counted"
            return self._after_functions(self.flow.changes.asks[line], state, follow=not counts)
        for i, condition in enumerate(line.conditions):  # those behind the first only where none before is taken
            behind = self._after_functions(tuple(asks_in(condition)), state, keep=i > 0)
            if behind is not state:
                state = self.merged([state, behind], "a condition may change it") if i else behind
                if self.noted is not None:
                    self.noted = state.variables, self.noted[1]
        return state

    def _after_functions(
        self, asks: Sequence[Ask], state: Moment, *, follow: bool = True, keep: bool = False
    ) -> Moment:
        """State after some functions, whose values are noted.

        Args:
            asks: they, in the order in which they are evaluated.
            state: before them.
            follow: whether they are evaluated once, and all of them.
            keep: whether values that were noted before still count.
        """
        returned = dict(self.noted[1]) if keep and self.noted else dict[Ask, Any]()
        self.noted = (state.variables, returned) if returned else None
        for ask in asks:
            if ask.routines:
                self.noted = state.variables, returned
                state, value = self._call(ask, state, follow=follow and ask.sure)
                if not state.reached:
                    return state
                returned |= {} if value is None or isinstance(value, Lost) else {ask: value}
            elif ask.changes or ask.moves:
                state = state.forgotten(ref.key for ref in ask.changes)
                state = self._moved(state, None) if ask.moves else state
        self.noted = state.variables, returned
        return state

    def returned(self, line: Any, state: Moment) -> Any:
        """Value returned by a line that leaves the routine."""
        return next((self._handed(one, state) for one in line.conditions), None) if isinstance(line, Check) else None

    def unknown(self, line: Any, state: Moment) -> Moment:
        """State after text that was not understood."""
        if isinstance(line, Do):
            self.flow.anywhere.update(line.routines)
        return self._lost(state, "the text before it is not understood")

    def _lost(self, state: Moment, why: str) -> Moment:
        """State where control may come from anywhere in the routine: only what nothing changes is known."""
        anything = self.flow.anything(why)
        kept = self._moved(state, None).forgotten(self.flow.changes.changing).holding(anything.variables)
        return replace(kept, reached=True, armed=anything.armed)

    def at_error(self, entry: Moment) -> Moment:
        """State where an error handler begins, given what holds at the start of the routine."""
        return replace(entry, last=None).forgotten(self.flow.changes.effects.within[self.routine])

    def truth(self, condition: Any, state: Moment) -> bool | None:
        """Whether a condition holds; None where the text does not tell."""
        if self.flow.all_ways:
            return None
        value = self.partly(condition, state)
        return value if isinstance(value, bool) and not self._is_settable(condition, state) else None

    def reads_data(self, condition: Any) -> bool:
        """Whether a condition reads any data."""
        return any(isinstance(one, Ref) for one in inside(condition))

    def widened(self, state: Moment, nodes: Sequence[Node], why: str) -> Moment:
        """State after lines that may have changed all that they change."""
        lost, moves, armed = set[Key](), False, set(state.armed)
        for line in flow.lines_in(nodes):
            if line is None:
                continue
            changes = self.flow.changes
            lost |= {ref.key for ref in changes.by(line)}
            moves = moves or changes.moves(line)
            for routine in line.routines if isinstance(line, Arming) and line.on else ():
                armed |= {routine, *changes.arming.get(routine, ())}
            for routine in changes.run(line):
                lost |= changes.effects.within[routine]
                armed |= changes.arming[routine]
            if isinstance(line, Do) and line.any:
                lost |= changes.paths.keys()
        state = replace(self._moved(state, None) if moves else state, armed=frozenset(armed))
        return state.forgotten(lost).holding(self.flow.meaning.lost_all(lost, why))

    def counts(self, loop: Loop, state: Moment) -> Counts | None:
        """Bounds and step of a loop; None where the text does not tell."""
        try:
            first, last, step = (self._number(bound, state) for bound in loop.line.conditions)
        except Unresolved:
            return None
        return Counts(first=first, last=last, step=step) if step else None

    def by_turns(self, loop: Loop, turns: int) -> bool:
        """Whether a counted loop is gone through turn by turn: if it moves the robot, or is short."""
        return turns * loop.size <= flow.MAX_TURNS or any(
            isinstance(line, MoveLine) or not self.flow.changes.moving.isdisjoint(self.flow.changes.run(line))
            for line in flow.lines_in(loop.body) if line is not None
        )  # fmt: skip

    def counting(self, loop: Loop, state: Moment, count: float | None) -> Moment:
        """State in which the counter of a loop has a value; None for any."""
        if loop.kind != "counted":
            return state
        return self._set(loop.line.counter, Lost(reason=self.flow.meaning.SET) if count is None else count, state)

    def counted(self, loop: Loop, state: Moment, count: float) -> float | None:
        """Value of the counter at the end of a turn; None where it is not known."""
        now = self.partly(loop.line.counter, state)
        if loop.line.counter.key not in self.flow.changes.changing:  # no line can have set it
            return count
        return now if isinstance(now, float) else None

    def between(self, state: Moment) -> Moment:
        """State before a line, behind whatever runs beside the lines."""
        if self.routine in self.flow.changes.resuming:
            state = state.having(last=None, reached=True)
        if state.armed:
            lost, forgotten, moves = self.flow.disturbance(state.armed)
            if lost and not all(state.variables.get(key) is value for key, value in lost.items()):
                state = state.holding(lost)
            state = state.forgotten(forgotten)
            state = self._moved(state, None) if moves else state
        left_in = self.flow.left_in
        if left_in and state.reached:
            left_in[:] = [one.joined([state], RESUMED) if one.reached else state for one in left_in]
        return state

    def _moved(self, state: Moment, last: int | None) -> Moment:
        """State behind a motion, where data no longer say where the robot is."""
        if self.flow.meaning.PLACES and any(type(value) is Here for value in state.variables.values()):
            state = state.forgotten([key for key, value in state.variables.items() if type(value) is Here])
        return state if state.last == last else state.having(last=last)

    def behind(self, state: Moment) -> Moment:
        """State after the last line of a block, see `between`."""
        return self.between(state) if self.flow.left_in or state.armed else state

    def through(self, entry: Moment) -> tuple[Moment, Any]:
        """State after the routine, and what it returns; what it armed for itself alone no longer runs."""
        state, value = super().through(entry)
        local = self.routine.disarms & state.armed
        return replace(state, armed=state.armed - local) if local else state, value

    # Lines.

    def step(self, line: Line, state: Moment) -> Moment:
        """State after a line."""
        if line in self.flow.changes.asks:
            state = self._after_functions(self.flow.changes.asks[line], state)
            if not state.reached:
                return state
        match line:
            case Assign():
                return self._set(line.target, self._handed(line.value, state), state)
            case MoveLine():
                return self._move(line, state)
            case Do():
                return self._do(line, state)
            case Arming():
                arming = self.flow.changes.arming
                more = frozenset(line.routines).union(*(arming.get(routine, ()) for routine in line.routines))
                return self.between(
                    replace(state, armed=state.armed | more if line.on else state.armed.difference(line.routines))
                )
            case Check():
                return state

    def _handed(self, expression: Expression, state: Moment) -> Any:
        """What an assignment or an argument hands on; `Lost` where it is not known."""
        if self.flow.meaning.PLACES and isinstance(expression, Ref):
            held = self._place(expression, state)
            if held is not None:
                return held
        value = self.partly(expression, state)
        if not isinstance(value, float | bool | str) or is_settable(value) or not self._is_settable(expression, state):
            return value
        return self.flow.meaning.by_hand(value)

    def _place(self, ref: Ref, state: Moment) -> Here | None:
        """Where the robot is, if a datum says that."""
        held = None if ref.path else self._whole(ref.key, state)
        return held if type(held) is Here else None

    def _set(self, target: Ref, value: Any, state: Moment) -> Moment:
        """State in which a datum, or a part of it, holds a value."""
        meaning, key = self.flow.meaning, target.key
        if key in self.flow.changes.unseen:
            value = Lost(reason=meaning.UNSEEN or meaning.SET)
        value = meaning.coerced(key, value)
        if not target.path:
            return state.holding({key: value})
        whole, names = self._whole(key, state), list[Hashable]()
        if type(whole) is Here:
            whole = self.partly(replace(target, path=()), state)
        if isinstance(whole, Lost):
            whole = meaning.blank(key, (), whole)
        if not isinstance(whole, Structure):
            return state if isinstance(whole, Lost) else state.holding({key: Lost(reason=meaning.SET)})
        try:
            led = self._names_set(target, whole, state)
            if led is None:
                return state
            names = led
            for k in range(1, len(names)):
                whole = self._opened(key, whole, names[:k])
            whole = whole.with_part(names, value, grows=meaning.GROWS)
        except Unresolved:  # which part is set is not known
            names, whole = [], blurred(whole, [()], {(): meaning.SET})
        kept = isinstance(meaning.declared(key), Structure)
        if kept and not (self.flow.scouting or self.flow.all_ways or _is_stated(target)):
            self.flow.computed.setdefault(target, set()).add(tuple(names))
        return state.holding({key: whole})

    def _names_set(self, target: Ref, whole: Structure, state: Moment) -> list[Hashable] | None:
        """Names of the parts of parts that are set; None where they are parts of what is not known, which stays so.

        Raises:
            Unresolved: they are not known, or there are no such parts.
        """
        meaning, names, part = self.flow.meaning, list[Hashable](), whole
        for step in target.path:
            if isinstance(part, Lost) and not (meaning.GROWS and isinstance(step, str)):
                return None
            if not isinstance(part, Structure | Lost):
                raise Unresolved(f"a part of {target.name} has no parts")
            more: Sequence[Hashable] = [step] if isinstance(step, str) else ()
            if not isinstance(step, str) and isinstance(part, Structure):
                more = meaning.part_names(part, self._indices(target, [step], state))
            for name in more:
                if isinstance(part, Structure):
                    grows = meaning.GROWS and name not in part.parts and part.rest is None
                    part: Any = Lost(reason=meaning.SET) if grows else part.part(name)
            names += more
        return names

    def _opened(self, key: Key, whole: Structure, names: Sequence[Hashable]) -> Structure:
        """A datum in which a part can be set of what is not known."""
        part: Any = whole
        for name in names:
            if not isinstance(part, Structure):
                raise Unresolved(f"it has no part {name}")
            part = part.part(name)
        blank = self.flow.meaning.blank(key, names, part) if isinstance(part, Lost) else part
        return whole if blank is part else whole.with_part(names, blank)

    def _do(self, line: Do, state: Moment) -> Moment:
        if line.any:
            self.flow.anywhere.update(self.flow.routines)
            return self._lost(state, "a routine is called whose name is computed")
        if line.routines:
            state, _ = self._call(line, state, follow=line.sure)
        lost = Lost(reason=line.why)
        for ref in line.changes:
            if ref.path:
                state = self._set(ref, lost, state)
            else:
                state = state.holding({ref.key: blurred(self._whole(ref.key, state), [()], {(): line.why})})
        return self._moved(state, None) if line.moves else state

    def _call(self, line: Do | Ask, state: Moment, *, follow: bool) -> tuple[Moment, Any]:
        """State after a call, and what it returns; None where that is not known."""
        changes, meaning = self.flow.changes, self.flow.meaning
        given = [self._handed(argument, state) for argument in line.arguments]
        keys = {ref.key for ref in _handed([line], changes.returned)}

        def entry(routine: Routine) -> Moment:
            held = {
                key: meaning.given(line, argument, key, value)
                for key, argument, value in zip(routine.parameters, line.arguments, given, strict=False)
                if not isinstance(value, Lost | Here)
                and not (meaning.HANDS_BACK and self._has_two_names(line, routine, argument, key))
            }
            return self.flow.entered(routine, state.forgotten(keys)).holding(held)

        (routine, *_) = line.routines
        armed = state.armed.union(*(changes.arming[routine] for routine in line.routines))
        leaves = self.routine in changes.left and any(one.resumes is self.routine for one in armed)
        if leaves:
            self.flow.left_in.append(self.unreached)
        done = self.follow(line.routines, entry) if follow else None
        inside = self.flow.left_in.pop() if leaves else self.unreached
        if done is not None:
            behind, value = done
            own = {*keys, *routine.parameters, *routine.variables}
            back = self._handed_back(line, routine, behind) if meaning.HANDS_BACK else {}
            behind = behind.forgotten(own).holding(back)
            if leaves:
                behind, value = self.merged([behind, self._moved(inside, None).forgotten(own)], RESUMED), None
            return behind, value
        self.flow.anywhere.update(line.routines)
        lost = frozenset(keys).union(*(changes.effects.within[routine] for routine in line.routines))
        state = state if changes.moving.isdisjoint(line.routines) else self._moved(state, None)
        said = meaning.lost_all(lost, f"{routine.name} sets it")
        return state.forgotten(lost).holding(said).having(armed=armed), None

    def _has_two_names(self, call: Do | Ask, routine: Routine, argument: Expression, parameter: Key) -> bool:
        """Whether what a parameter stands for is set by another name, too: its own one, or another parameter."""
        if not isinstance(argument, Ref) or parameter not in routine.returning:
            return False
        changes = self.flow.changes
        others = (
            other for other, one in zip(routine.parameters, call.arguments, strict=False)
            if isinstance(one, Ref) and one.key == argument.key and other != parameter
        )  # fmt: skip
        return argument.key in changes.effects.within[routine] or not changes.returned.isdisjoint(others)

    def _handed_back(self, line: Do | Ask, routine: Routine, behind: Moment) -> dict[Key, Any]:
        """What data hold behind a call that were given as a whole to parameters that set them."""
        changes, found = self.flow.changes, dict[Key, Any]()
        if self.flow.all_ways or not behind.reached:
            return found
        given = [one.key for one in line.arguments if isinstance(one, Ref)]
        for parameter, argument in zip(routine.parameters, line.arguments, strict=False):
            if not isinstance(argument, Ref) or argument.path or parameter not in changes.returned:
                continue
            value, key = behind.variables.get(parameter), argument.key
            known = value is not None and not isinstance(value, Lost | Here)
            if known and key not in changes.effects.within[routine] | changes.unseen and given.count(key) == 1:
                found[key] = self.flow.meaning.coerced(key, value)
        return found

    def _move(self, line: MoveLine, state: Moment) -> Moment:
        flow_, findings = self.flow, self.flow.findings
        if (
            flow_.meaning.PLACES
            and len(line.points) == 1
            and isinstance(line.points[0], Ref)
            and self._place(line.points[0], state)
        ):
            return state  # it is there
        if flow_.quiet or (flow_.all_ways and line in findings.seen):
            return self._moved(state, None)
        if flow_.scouting:
            return self._moved(state, flow.SOMEWHERE if line.ends and line.linked else None)
        try:
            if line.why:
                raise Unresolved(line.why)
            found = self._found(line, state)
        except Unresolved as why:
            findings.fail(line, None, str(why))
            return self._moved(state, None)
        number = findings.number(line, found, (line, *found.meaning), flow_.before(state.last) if line.linked else None)
        if line.linked:
            flow_.note_order(number, state.last)
        return self._moved(state, number if line.ends else None)

    def _found(self, line: MoveLine, state: Moment) -> FoundMotion:
        """The motion of a line, which is the one found last where all is the same on which it depends."""
        given, unknown = list[Any](), list[Unresolved]()
        for point in line.points:
            try:
                given.append(self.value(point, state))
            except Unresolved as why:
                unknown.append(why)
        given += [
            plain(self.held(one, state)) if isinstance(one, Ref) else self.partly(one, state)
            for one in line.settings.values()
        ]
        if unknown:
            settings = dict(zip(line.settings, given[-len(line.settings) :], strict=False))
            raise self.flow.meaning.incomplete(line, unknown[-1], settings)
        before = self.flow.met.get(line)
        if before is not None and all(one is other for one, other in zip(before[0], given, strict=True)):
            return before[1]
        settings, asked = dict(zip(line.settings, given[len(line.points) :], strict=True)), list[Any]()

        def last() -> FoundMotion | Lost:
            asked.append(self._before(state))
            return asked[-1]

        if line.leans:
            settings["before"] = last
        found = self.flow.meaning.motion(line, given[: len(line.points)], settings)
        if not asked:
            self.flow.met[line] = given, found
        return found


def interpreted(routines: Sequence[Routine], meaning: LanguageMeaning) -> Interpreter:
    """A program that was gone through, from the routines that nothing calls.

    What is set by computed indices decides what holds where a program begins, and that may decide what they are: the program is
    gone through again until no index leads elsewhere than was taken before.
    """
    computed: dict[Ref, set[Path]] = {}
    for _ in range(MAX_ROUNDS):
        found = _gone_through(routines, meaning, computed)
        more = {ref: paths for ref, paths in found.computed.items() if not paths <= computed.get(ref, set())}
        if not more:
            return found
        computed |= {ref: paths | computed.get(ref, set()) for ref, paths in more.items()}
    by = changes_of(routines, meaning, computed).by
    refs = {ref for routine in routines for line in routine.lines for ref in by(line) if not _is_stated(ref)}
    return _gone_through(routines, meaning, {ref: {()} for ref in refs})


def _gone_through(routines: Sequence[Routine], meaning: LanguageMeaning, computed: Computed) -> Interpreter:
    """A program that was gone through once, with what is taken to be set by computed indices."""
    changes = changes_of(routines, meaning, computed)
    lines = sum(1 for routine in routines for _ in routine.lines)
    left = flow.MIN_LINES + meaning.PASSES * lines
    found = Interpreter(meaning=meaning, changes=changes, routines=routines, left=left)
    meaning.begin(found)
    found.anywhere |= changes.unled.intersection(routines)
    roots = [r for r in routines if r in changes.roots and r not in changes.unled]
    found.follow(routines, roots)
    found.findings.close()
    found.follow_rest(routines, roots)
    return found
