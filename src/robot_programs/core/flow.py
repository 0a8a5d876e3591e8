"""The flow of a program: what its data hold where each motion begins, through calls, branches, loops and jumps.

A language lowers the text of its routines to nodes: steps (motions, assignments, calls), branches, loops, labels, what leaves
them, and what is not understood. `FlowWalk` goes through the nodes of a routine; what a line makes of a `FlowState`, and whether a
condition holds, is said by the language, which derives its own walk. What cannot be decided is gone through in all ways, and
behind them holds what is the same in all.
"""

from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Callable, Collection, Generator, Hashable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, ClassVar, Generic, Literal, Self, TypeVar

R = TypeVar("R", bound=Hashable)
"""A routine of a language."""
Thing = TypeVar("Thing", bound=Hashable)

MAX_CALL_DEPTH = 12
"""Calls in each other that are followed; a deeper one is taken to change all that its routine may change."""

MAX_TURNS = 1000
"""A loop of more turns is not gone through turn by turn, which would take seconds."""

MAX_SCOUTS = 3
"""So often lines to which control leads back are gone through to find what holds each time; behind that, what they may change
is not known. Most loops come to rest in the second round."""

MIN_LINES = 5000
"""As many lines may be gone through again in any program, for calls and the turns of loops."""

COUNT_TOLERANCE = 1e-9
"""Turns by which the end of a counted loop may be missed: its bounds are rounded."""

JUMPED = "it can be reached by a GOTO"


def reached(starts: Iterable[Thing], behind: Callable[[Thing], Iterable[Thing]]) -> set[Thing]:
    """All to which some lead, themselves included, given what is right behind each."""
    waiting, seen = list(starts), set[Thing]()
    while waiting:
        one = waiting.pop()
        if one not in seen:
            seen.add(one)
            waiting += behind(one)
    return seen


def with_called(
    own: Mapping[R, tuple[frozenset[Thing], frozenset[R]]],
) -> dict[R, frozenset[Thing]]:
    """Properties of each routine, of itself or of those that it calls.

    Args:
        own: of each routine what it has by itself, and which it calls; those that are not keys count for nothing.
    """
    total = {name: has for name, (has, _) in own.items()}
    while True:
        wider = {
            name: total[name].union(*(total[other] for other in calls if other in total))
            for name, (_, calls) in own.items()
        }
        if wider == total:
            return total
        total = wider


@dataclass(frozen=True, eq=False, kw_only=True)
class Effects(Generic[R, Thing]):
    """What the routines of a program change, and what of it changes unseen; the rule of all languages.

    A call changes what its routine changes, and what those change that this calls. What runs beside the lines of others, such as
    interrupts, traps, threads and handlers of errors, may change its data between any two of these lines: they are never known.
    """

    own: Mapping[R, frozenset[Thing]]
    """What each changes by itself."""
    calls: Mapping[R, frozenset[R]]
    """Which each calls; those that change nothing by themselves, and are no keys of `own`, count for nothing."""
    beside: Collection[R] = ()
    """Those that run beside the lines of others."""

    @cached_property
    def within(self) -> Mapping[R, frozenset[Thing]]:
        """What each changes, by itself or by those that it calls."""
        return with_called({routine: (changed, self.calls[routine]) for routine, changed in self.own.items()})

    @cached_property
    def unseen(self) -> frozenset[Thing]:
        """What may change at any time."""
        return frozenset[Thing]().union(*(self.within[routine] for routine in self.beside))

    @cached_property
    def callers(self) -> Mapping[R, frozenset[R]]:
        """Which call each."""
        found: dict[R, set[R]] = {routine: set() for routine in self.own}
        for routine, called in self.calls.items():
            for other in called & found.keys():
                found[other].add(routine)
        return {routine: frozenset(others) for routine, others in found.items()}

    @cached_property
    def around(self) -> Mapping[R, frozenset[Thing]]:
        """What changes on the ways through each: what it changes, or any that leads to it."""
        return with_called({routine: (self.within[routine], self.callers[routine]) for routine in self.own})


# The form to which a language lowers its text. `line` is a statement of the language, for the language alone.


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class FlowStep:
    """A motion, an assignment, a call, or whatever else control goes on behind."""

    line: Any


@dataclass(frozen=True, eq=False, kw_only=True)
class Unknown:
    """Text that was not understood, to which control may come from anywhere in the routine."""

    line: Any


@dataclass(frozen=True, eq=False, kw_only=True)
class Label:
    """A place to which jumps lead."""

    line: Any
    name: str


@dataclass(frozen=True, eq=False, kw_only=True)
class Leave:
    """Statement after which control does not go on."""

    line: Any
    way: Literal["return", "exit", "jump", "stop"]
    """Out of the routine, out of the innermost loop, to a label, or to nowhere."""
    label: str = ""


@dataclass(frozen=True, eq=False, kw_only=True)
class LineGroup:
    """Lines that belong together, in the order of the text."""

    line: Any
    body: "Block"


@dataclass(frozen=True, eq=False, kw_only=True)
class Arm:
    """One of several branches."""

    line: Any = None
    """With which it begins; None of the first one, and where it has no line of its own."""
    condition: Any
    """For the language; None where it is taken in any case, if none before it was."""
    body: "Block"


@dataclass(frozen=True, eq=False, kw_only=True)
class Branches:
    """Branches of which one is taken, or none."""

    line: Any
    name: str
    """For messages."""
    arms: tuple[Arm, ...]


@dataclass(frozen=True, eq=False, kw_only=True)
class Loop:
    """Lines that are gone through again and again."""

    line: Any
    name: str
    """For messages."""
    kind: Literal["counted", "while", "until", "endless"]
    """By a counter, with a condition before or behind each turn, or until it is left."""
    condition: Any = None
    body: "Block"
    end: Any = None
    """The line that closes it, if that has a condition."""

    @cached_property
    def size(self) -> int:
        """Number of lines, its own included."""
        return 1 + sum(1 for _ in lines_in(self.body))


Node = FlowStep | Unknown | Label | Leave | LineGroup | Branches | Loop
Block = tuple[Node, ...]


@dataclass(frozen=True, eq=False, kw_only=True)
class RoutineBody:
    """Nodes of a routine."""

    nodes: Block
    handlers: tuple[Block, ...] = ()
    """To which control comes from anywhere in it, where an error is met."""
    size: int
    """How many lines it has."""
    backward: frozenset[str] = frozenset()
    """Labels to which a jump behind them leads."""
    entered: frozenset[str] = frozenset()
    """Labels to which a jump leads from outside the block that they are in."""


def bodies_of(node: Node) -> tuple[Block, ...]:
    """Blocks inside a node, branch by branch."""
    match node:
        case Branches():
            return tuple(arm.body for arm in node.arms)
        case Loop() | LineGroup():
            return (node.body,)
        case _:
            return ()


def lines_in(nodes: Iterable[Node]) -> Iterator[Any]:
    """All lines of some nodes, those inside them included."""
    for node in nodes:
        match node:
            case Branches():
                yield node.line
                for arm in node.arms:
                    if arm.line is not None:
                        yield arm.line
                    yield from lines_in(arm.body)
            case Loop():
                yield node.line
                yield from lines_in(node.body)
                if node.end is not None:
                    yield node.end
            case LineGroup():
                yield from lines_in(node.body)
            case _:
                yield node.line


def nodes_in(nodes: Iterable[Node]) -> Iterator[Node]:
    """Some nodes, and all inside them."""
    for node in nodes:
        yield node
        for body in bodies_of(node):
            yield from nodes_in(body)


def unread_in(nodes: Iterable[Node]) -> Iterator[Any]:
    """Lines of nodes that are not understood."""
    return (node.line for node in nodes_in(nodes) if isinstance(node, Unknown))


MAX_BACKWARD = 24
"""Labels of a routine to which lines after them lead back; of one with more, what holds at its labels is not followed."""


def labels_of(nodes: Block, beside: Sequence[Block] = ()) -> tuple[frozenset[str], frozenset[str]]:
    """Labels to which a jump behind them leads, and those to which one leads from outside the block that they are in.

    Args:
        nodes: of a routine.
        beside: its handlers.
    """
    backward, entered, seen = set[str](), set[str](), set[str]()

    def visit(body: Block, around: frozenset[str]) -> None:
        own = around | {node.name for node in body if isinstance(node, Label)}
        for node in body:
            match node:
                case Label():
                    seen.add(node.name)
                case Leave(way="jump"):
                    backward.update({node.label} & seen)
                    entered.update({node.label} - own)
                case _:
                    for inner in bodies_of(node):
                        visit(inner, own)

    visit(nodes, frozenset())
    for handler in beside:
        visit(handler, frozenset())
    if len(backward) > MAX_BACKWARD:
        return frozenset(), frozenset(entered | backward)
    return frozenset(backward), frozenset(entered)


def _behind_jumps(nodes: Block, label: int) -> int:
    """Number of the node behind the last one that leads back to a label, or to one between."""
    number, behind = label, label + 1
    while number < behind:
        node = nodes[number]
        if isinstance(node, Label):
            leads = (k for k in range(len(nodes) - 1, behind - 1, -1) if _jumps_to(nodes[k : k + 1], node.name))
            behind = max(behind, 1 + next(leads, 0))
        number += 1
    return behind


def _jumps_to(nodes: Block, label: str) -> bool:
    return any(isinstance(node, Leave) and node.way == "jump" and node.label == label for node in nodes_in(nodes))


def _may_end(nodes: Block) -> bool:
    """Whether a branch among some nodes leaves them, or leads back."""
    return any(isinstance(node, Branches) and any(_leaves(body) for body in bodies_of(node)) for node in nodes) or any(
        _may_end(body) for node in nodes if isinstance(node, LineGroup) for body in bodies_of(node)
    )


def _leaves(nodes: Block) -> bool:
    return any(isinstance(node, Leave) for node in nodes_in(nodes))


def leaves_loop(nodes: Iterable[Node]) -> bool:
    """Whether something among the nodes of a loop leaves that loop."""
    return any(
        (isinstance(node, Leave) and node.way == "exit")
        or (not isinstance(node, Loop) and any(leaves_loop(body) for body in bodies_of(node)))
        for node in nodes
    )


# What holds at a place of a program.


@dataclass(frozen=True, kw_only=True)
class FlowState:
    """State at a place of a program; languages add what they know."""

    last: int | None = None
    """Number of the motion that ends where the robot is, or `SOMEWHERE`; None where that is not known."""
    reached: bool = True
    """Whether control comes there."""

    variables: Mapping[Any, Any] = field(default_factory=dict[Any, Any])
    """What is known of data, by their keys."""

    def having(self, **changed: Any) -> Self:
        """The same with other fields, in a third of the time that `replace` takes: most lines change some."""
        made = object.__new__(type(self))
        vars(made).update(vars(self), **changed)
        return made

    def forgotten(self, keys: Iterable[Any]) -> Self:
        """State in which nothing is known of some data."""
        keys = keys if isinstance(keys, frozenset) else set(keys)
        if self.variables.keys().isdisjoint(keys):
            return self
        return self.having(variables={k: v for k, v in self.variables.items() if k not in keys})

    def holding(self, values: Mapping[Any, Any]) -> Self:
        """State in which some data hold something else."""
        return self.having(variables={**self.variables, **values}) if values else self

    def joined(self, others: Sequence[Any], why: str) -> Self:
        """Join the states after several ways.

        Args:
            others: what holds behind the others; all are reached.
            why: why anything that differs is not known, for the user.
        """
        states, variables = (self, *others), self.variables
        if any(other.variables is not variables for other in others):
            variables = self._of_all([state.variables for state in states], why)
        lasts = {state.last for state in states}
        last = self.last if len(lasts) == 1 else None if lasts & {None, ENTRY} else SOMEWHERE
        return self.having(last=last, variables=variables)

    def _of_all(self, held: Sequence[Mapping[Any, Any]], why: str) -> dict[Any, Any]:
        """What is known of data after several ways."""
        found, (first, *others) = dict[Any, Any](), held
        for key, value in first.items():
            for other in others:
                if other.get(key) is not value:
                    values = [one.get(key) for one in held]
                    known = None if any(one is None for one in values) else self.common(values, why)
                    break
            else:
                known = value
            if known is not None:
                found[key] = known
        return found

    def common(self, values: Sequence[Any], why: str) -> Any:
        """What is known of a datum after several ways; None for nothing.

        Args:
            values: what is known of it after each.
            why: as in `joined`.
        """
        first, *others = values
        return first if all(type(other) is type(first) and other == first for other in others) else None

    def lost_in(self, joined: Any) -> Any:
        """Facts of this state that a state joined from it has lost."""
        return None

    def without(self, lost: Any, why: str) -> Self:
        """State without the facts that `lost_in` gave; None for nothing."""
        return self


S = TypeVar("S", bound=FlowState)

ENTRY = -1
"""In place of the number of the last motion, in a routine that is summarised: that before it was entered."""

SOMEWHERE = -2
"""In place of the number of the last motion: one of the program's, which is not the same on all ways."""


@dataclass(frozen=True, kw_only=True)
class Counts:
    """Bounds and step of a counted loop."""

    first: float
    last: float
    step: float

    def beyond(self, count: float) -> bool:
        """Whether a count ends the loop."""
        return (self.last - count) / self.step < -COUNT_TOLERANCE

    @property
    def turns(self) -> float:
        """Number of turns; NaN or infinite where the bounds are."""
        ratio = (self.last - self.first) / self.step + COUNT_TOLERANCE
        return 0.0 if ratio < 0.0 else ratio // 1.0 + 1.0


# Going through a program.


@dataclass(eq=False, kw_only=True)
class Flow(ABC, Generic[S, R]):
    """The routines of a program, and how far they have been followed."""

    left: int
    """How many lines may still be gone through for calls and the turns of loops, in all."""
    scouting: int = 0
    """Lines are gone through only for what they leave behind: motions are not noted, loops not taken turn by turn."""
    all_ways: bool = False
    """Ways that are never taken are gone through, too."""
    anywhere: set[R] = field(default_factory=set[R])
    """Routines that are called where that is not followed, so that anything may hold there."""
    lost_at: dict[Label, Any] = field(default_factory=dict[Label, Any])
    """By label to which lines lead back: what they had changed when it was gone through last."""
    summaries: dict[Hashable, tuple[S, Any, set[int]]] = field(default_factory=dict[Hashable, Any])
    """What routines did when they were gone through, by all that it depends on: the state behind them, where they were entered
    in some, what they returned, and the motions that come right behind the one before them."""
    entered_behind: list[tuple[int | None, set[int]]] = field(default_factory=list[tuple[int | None, set[int]]])
    """Of routines that are being summarised, the innermost last: the motion before, and those that come right behind it."""
    unclear: int = 0
    """How often something depended on more than by what summaries are found."""
    begun: "dict[Loop, tuple[float, ...] | None]" = field(default_factory=dict[Any, Any])
    """By counted loop, the counts with which its turns begin, as many as any run of it has; None where these differ."""
    turns: "dict[Loop, tuple[float, ...] | None]" = field(default_factory=dict[Any, Any])
    """By loop that was gone through turn by turn: its counter in each turn, the same each time; None where that is not so."""

    @abstractmethod
    def body(self, routine: R) -> RoutineBody:
        """Nodes of a routine; the same each time."""

    @abstractmethod
    def name(self, routine: R) -> str:
        """Name of a routine, for messages."""

    @abstractmethod
    def walk(self, routine: R, inside: tuple[R, ...]) -> "FlowWalk[S, R]":
        """A pass through a routine.

        Args:
            routine: the routine.
            inside: routines that are being gone through, this one included.
        """

    @abstractmethod
    def anything(self, why: str) -> S:
        """State in which anything may hold."""

    @abstractmethod
    def start(self, routine: R) -> S:
        """State where a routine begins that nothing calls."""

    @abstractmethod
    def found_all(self, routine: R) -> bool:
        """Whether all motions of a routine were found."""

    def called_anywhere(self, routine: R, why: str) -> S:
        """State where a routine begins of which it is not followed how it is called."""
        return self.anything(why)

    def through(self, routine: R, entry: S, inside: tuple[R, ...] = ()) -> tuple[S, Any]:
        """State after a routine, and what it returns; None where that is not known.

        Args:
            routine: the routine.
            entry: what holds at its start, its parameters included.
            inside: routines that are being gone through.
        """
        key = self.depends_on(routine, entry) if inside and not self.all_ways else None
        if key is None:
            return self.walk(routine, (*inside, routine)).through(entry)
        summary = self.summaries.get(key)
        if summary is None:
            unclear, firsts = self.unclear, set[int]()
            self.entered_behind.append((entry.last, firsts))
            end, returned = self.walk(routine, (*inside, routine)).through(entry.having(last=ENTRY))
            self.entered_behind.pop()
            if self.unclear == unclear:
                self.summaries[key] = end, returned, firsts
        else:
            end, returned, firsts = summary
            for number in firsts:
                self.note_order(number, entry.last)
        end = self.after_summary(routine, entry, end)
        return (end.having(last=entry.last) if end.last == ENTRY else end), returned

    def depends_on(self, routine: R, entry: S) -> Hashable | None:
        """All on which depends what a routine does, but the motion before it; None where it is not summarised."""
        return None

    def after_summary(self, routine: R, entry: S, end: S) -> S:
        """State after a routine, from that after it where it was entered in a state that differs in what it does not concern."""
        return end

    def is_summarised(self, routine: R, entry: S) -> bool:
        """Whether it is known already what a routine does."""
        return not self.all_ways and bool(self.summaries) and self.depends_on(routine, entry) in self.summaries

    def before(self, last: int | None) -> int | None:
        """Number of the last motion where it is that before a routine."""
        for before, _ in reversed(self.entered_behind):
            if last != ENTRY:
                break
            last = before
        return last

    def note_order(self, number: int, last: int | None) -> None:
        """Note that a motion comes behind the last one of a state."""
        self.link(number, self.before(last))
        for before, firsts in reversed(self.entered_behind):
            if last != ENTRY:
                break
            firsts.add(number)
            last = before

    def link(self, number: int, before: int | None) -> None:
        """Note the number of the motion before one."""

    def began(self, loop: "Loop", counts: tuple[float, ...]) -> None:
        """Note the counts with which turns of a loop began, whether or not it was left in the last one."""
        before = self.begun.get(loop, counts)
        if before is not None:
            shorter, longer = sorted((before, counts), key=len)
            self.begun[loop] = longer if longer[: len(shorter)] == shorter else None

    def took(self, loop: "Loop", turns: tuple[float, ...] | None) -> None:
        """Note the turns that a loop took; None where they are not decided."""
        self.turns[loop] = turns if self.turns.get(loop, turns) == turns else None

    def may_follow(self, routine: R) -> bool:
        """Whether a routine may still be gone through once more; if so, its lines count."""
        return self.may(self.body(routine).size)

    def may(self, lines: int) -> bool:
        """Whether so many lines may still be gone through once more; if so, they count."""
        if lines > self.left:
            return False
        self.left -= lines
        return True

    def follow(self, routines: Sequence[R], roots: Collection[R]) -> None:
        """Go through a program from the routines that nothing calls, then through those that are called unseen.

        Args:
            routines: all, in the order of the text.
            roots: those that nothing calls.
        """
        for routine in (routine for routine in routines if routine in roots):
            self.through(routine, self.start(routine))
        done = set[R]()
        while self.anywhere - done:
            for routine in [routine for routine in routines if routine in self.anywhere - done]:
                done.add(routine)
                why = f"{self.name(routine)} is called where that is not followed"
                self.through(routine, self.called_anywhere(routine, why))

    def follow_rest(self, routines: Sequence[R], roots: Collection[R]) -> None:
        """Go through motions to which no way leads, such as those by which points are taught behind the end of a program."""
        self.all_ways, self.left = True, 0
        for routine in routines:
            if not self.found_all(routine):
                begins = (
                    self.start(routine) if routine in roots else self.called_anywhere(routine, "nothing leads to it")
                )
                self.through(routine, begins)


@dataclass(eq=False, kw_only=True)
class FlowWalk(ABC, Generic[S, R]):
    """One pass through a routine."""

    SCOUTS: ClassVar[int] = MAX_SCOUTS

    flow: Flow[S, R]
    routine: R
    inside: tuple[R, ...]
    """Routines that are being gone through, this one last."""
    returns: list[tuple[S, Any]] = field(default_factory=list[tuple[S, Any]])
    """What holds where the routine is left before its end, and what it returns there."""
    exits: list[list[S]] = field(default_factory=list[list[S]])
    """What holds where the loops that are being gone through are left, the innermost last."""
    jumps: dict[str, list[S]] = field(default_factory=dict[str, list[S]])
    """What holds where labels are jumped to."""

    # What a language says.

    @property
    def body(self) -> RoutineBody:
        """Nodes of the routine."""
        return self.flow.body(self.routine)

    @property
    @abstractmethod
    def unreached(self) -> S:
        """State of places that control does not reach."""

    @abstractmethod
    def step(self, line: Any, state: S) -> S:
        """State after a motion, an assignment, a call or another step."""

    @abstractmethod
    def asked(self, line: Any, state: S, node: Node) -> S:
        """State after the functions in the conditions of a line, with which a node begins or ends."""

    @abstractmethod
    def truth(self, condition: Any, state: S) -> bool | None:
        """Whether a condition holds; None where the text does not tell."""

    @abstractmethod
    def reads_data(self, condition: Any) -> bool:
        """Whether a condition reads any data, so that it may hold now and not later."""

    @abstractmethod
    def widened(self, state: S, nodes: Sequence[Node], why: str) -> S:
        """State after lines that may have changed all that they change."""

    def counts(self, loop: Loop, state: S) -> Counts | None:
        """Bounds and step of a loop; None where the text does not tell."""
        return None

    def counting(self, loop: Loop, state: S, count: float | None) -> S:
        """State in which the counter of a loop has a value; None for any."""
        return state

    def counted(self, loop: Loop, state: S, count: float) -> float | None:
        """Value of the counter at the end of a turn; None where the turn made it something that is not known."""
        return count

    def by_turns(self, loop: Loop, turns: int) -> bool:
        """Whether a counted loop is gone through turn by turn, if all else allows it."""
        return True

    def unknown(self, line: Any, state: S) -> S:
        """State after text that was not understood."""
        return self.flow.anything("the text before it is not understood")

    def within(self, group: LineGroup, state: S) -> S:
        """State after lines that belong together."""
        return self.block(group.body, state)

    def between(self, state: S) -> S:
        """State before a line, where something may have happened beside the lines."""
        return state

    def behind(self, state: S) -> S:
        """State after the last line of a block."""
        return state

    def at_error(self, entry: S) -> S:
        """State where an error handler begins, given what holds at the start of the routine."""
        return entry

    def returned(self, line: Any, state: S) -> Any:
        """Value returned by a line that leaves the routine."""
        return None

    # What all languages have in common.

    def through(self, entry: S) -> tuple[S, Any]:
        """State after the routine, and what it returns; None where that is not known."""
        end = self.block(self.body.nodes, entry)
        for handler in self.body.handlers:
            self.block(handler, self.at_error(entry))
        values = {repr(value): value for _, value in self.returns}
        states = [*(state for state, _ in self.returns), end]
        value = next(iter(values.values())) if len(values) == 1 else None
        return self.merged(states, f"it differs between the ends of {self.flow.name(self.routine)}"), value

    def merged(self, ways: Iterable[S], why: str) -> S:
        """Join the states after some ways."""
        states = [state for state in ways if state.reached]
        if not states:
            return self.unreached
        first, *others = states
        return first.joined(others, why) if others else first

    def block(self, nodes: Block, state: S) -> S:
        """State after some nodes."""
        return self.behind(self._nodes(nodes, state))

    def _nodes(self, nodes: Block, state: S) -> S:
        number = 0
        while number < len(nodes):
            node = nodes[number]
            number += 1
            match node:
                case Unknown():
                    state = self.unknown(node.line, state)
                    continue
                case Label():
                    state = self._at_label(node, state)
                    if node.name in self.body.backward:
                        behind = _behind_jumps(nodes, number - 1)
                        state = self._again_from(nodes[number:behind], node, state)
                        number = behind
                    continue
                case _:
                    pass
            state = self.between(state)
            if not state.reached:
                if not self.flow.all_ways:
                    continue
                state = self.between(self.flow.anything("nothing leads to it"))
            state = self._node(node, state)
        return state

    def _node(self, node: FlowStep | Leave | LineGroup | Branches | Loop, state: S) -> S:
        match node:
            case FlowStep():
                return self.step(node.line, state)
            case Branches():
                return self._branches(node, self.asked(node.line, state, node))
            case Loop():
                return self._loop(node, self.asked(node.line, state, node))
            case LineGroup():
                return self.within(node, state)
            case Leave():
                return self._leave(node, self.asked(node.line, state, node))

    def _leave(self, node: Leave, state: S) -> S:
        match node.way:
            case "return":
                self.returns.append((state, self.returned(node.line, state)))
            case "exit":
                self.exits[-1].append(state)
            case "jump":
                self.jumps.setdefault(node.label, []).append(state)
            case "stop":
                pass
        return self.unreached

    def _branches(self, node: Branches, state: S) -> S:
        why = f"it is set in one branch of the {node.name} before and not, or differently, in another"
        ends: list[S] = []
        for arm in node.arms:
            taken = True if arm.condition is None else self.truth(arm.condition, state)
            if taken is not False:
                ends.append(self.block(arm.body, state))
            if taken:
                return self.merged(ends, why)
        return self.merged([*ends, state], why)

    def _at_label(self, label: Label, state: S) -> S:
        """State at a label, where the lines before it and all jumps so far lead to it."""
        waiting = self.jumps.setdefault(label.name, [])
        state = self.merged([state, *waiting], JUMPED)
        waiting.clear()
        if label.name in self.body.entered or (self.flow.all_ways and not state.reached):
            return self.flow.anything(JUMPED)
        return state

    def _again_from(self, nodes: Block, label: Label, state: S) -> S:
        """State after the lines between a label and the last one that leads back to it."""
        flow = self.flow
        if not state.reached:  # a jump from before the label may lead into these lines, and they back to it
            end, back = self._once_from(nodes, label, state)
            return self.merged([end, self._again_from(nodes, label, back)], JUMPED) if back.reached else end
        if flow.scouting or flow.all_ways:
            return self._once_from(nodes, label, self.widened(state, nodes, JUMPED))[0]
        cost = 1 + sum(1 for _ in lines_in(nodes))
        for _ in range(MAX_TURNS if _may_end(nodes) else 0):
            if not self._is_decided(nodes, label, state) or not flow.may(2 * cost):
                break
            end, back = self._once_from(nodes, label, state)
            if not back.reached or back == state:
                return end
            state = back
        # most often a loop leads back with what it did in the turn before
        entry = state
        state = entry.without(flow.lost_at.get(label), JUMPED)
        for _ in range(MAX_SCOUTS):
            end, back = self._once_from(nodes, label, state)
            joined = self.merged([state, back], JUMPED)
            if joined == state:
                flow.lost_at[label] = entry.lost_in(state)
                return end
            state = joined
            if not flow.may(cost):
                break
        return self._once_from(nodes, label, self.widened(state, nodes, JUMPED))[0]

    def _once_from(self, nodes: Block, label: Label, state: S) -> tuple[S, S]:
        """State after the lines behind a label, and where they lead back to it."""
        end = self._nodes(nodes, state)
        waiting = self.jumps[label.name]
        back = self.merged(waiting, JUMPED)
        waiting.clear()
        return end, back

    def _is_decided(self, nodes: Block, label: Label, state: S) -> bool:
        """Whether the lines behind a label go on in one way alone: back to it, to what follows, or elsewhere."""
        with self.scouting():
            left = self._ways_out()
            end, back = self._once_from(nodes, label, state)
            return end.reached + back.reached + self._ways_out() - left <= 1

    def _ways_out(self) -> int:
        """How many ways were met so far on which blocks are left."""
        return len(self.returns) + sum(map(len, self.exits)) + sum(map(len, self.jumps.values()))

    # Loops: turn by turn where the text decides how many there are, else with what holds in all of them.

    def _loop(self, loop: Loop, state: S) -> S:
        self.exits.append([])
        if self.flow.scouting or self.flow.all_ways:
            end = self._some_turns(loop, state)
        else:
            match loop.kind:
                case "counted":
                    end = self._counted(loop, state)
                case "while":
                    end = self._while(loop, state)
                case "until" | "endless":
                    end = self._tried(loop, state)
        return self.merged([end, *self.exits.pop()], f"it differs between the ways out of the {loop.name} before")

    def turn(self, loop: Loop, state: S) -> S:
        """State after one turn of a loop, and behind the functions that its conditions ask then."""
        state = self.block(loop.body, state)
        for line in (loop.line, loop.end) if state.reached else ():
            state = self.asked(line, state, loop) if line is not None else state
        return state

    def _counted(self, loop: Loop, state: S) -> S:
        counts = self.counts(loop, state)
        if counts is None or not counts.turns <= MAX_TURNS:
            return self._some_turns(loop, state)
        turns, first, taken = int(counts.turns), counts.first, list[float]()
        if not self.by_turns(loop, turns) or not self.flow.may(turns * loop.size):
            return self._some_turns(loop, state)
        for k in range(turns + 1):
            count = first + k * counts.step
            state = self.counting(loop, state, count)
            if not state.reached or counts.beyond(count):
                self.flow.began(loop, tuple(taken))
                self.flow.took(loop, tuple(taken) if state.reached else None)
                return state
            taken.append(count)
            state = self.turn(loop, state)
            now = self.counted(loop, state, count) if state.reached else count
            if now is None:
                return self._some_turns(loop, state)
            first += now - count  # the loop may set its counter, too, which then counts
        return self._some_turns(loop, state)

    def _while(self, loop: Loop, state: S) -> S:
        for turn in range(MAX_TURNS if self.reads_data(loop.condition) else 0):
            holds = self.truth(loop.condition, state)
            if holds is False or not state.reached:
                self.flow.took(loop, tuple(map(float, range(turn))) if state.reached else None)
                return state
            if holds is None or not self.flow.may(loop.size):
                break
            before, state = state, self.turn(loop, state)
            if state == before:
                return self.unreached
        ends = self.truth(loop.condition, self.widened(state, (loop,), "")) is not True
        behind = self._some_turns(loop, state)
        return behind if ends else self.unreached

    def _tried(self, loop: Loop, state: S) -> S:
        """State after a loop each of whose turns is tried first: whether it is the last one shows behind it."""
        ends = loop.kind == "until"
        for _ in range(MAX_TURNS if ends or leaves_loop(loop.body) else 0):
            last: bool | None = False
            with self.scouting():
                left = len(self.exits[-1])
                end = self.turn(loop, state) if self.flow.may(loop.size) else None
                if end is not None and ends:
                    last = self.truth(loop.condition, end)
                elif len(self.exits[-1]) > left:
                    last = None
            if end is None or (last is None and end.reached) or not self.flow.may(loop.size):
                break
            before, state = state, self.turn(loop, state)
            if last or not state.reached:
                return state
            if state == before:  # so it is after each further turn
                return self.unreached
        return self._some_turns(loop, state)

    def _some_turns(self, loop: Loop, state: S) -> S:
        """State after a loop of which it is not known how often it is gone through, if nothing leaves it inside."""
        if not self.flow.scouting and not self.flow.all_ways:
            self.flow.took(loop, None)
        head = self._stable(self.counting(loop, state, None), loop, "it is set further down in the same loop")
        end = self.turn(loop, head)
        match loop.kind:
            case "endless":
                return self.unreached
            case "until":
                return end
            case "counted" | "while":
                return head

    def _stable(self, entry: S, loop: Loop, why: str) -> S:
        """State each time that a turn of a loop begins."""
        for _ in range(0 if self.flow.scouting else self.SCOUTS):
            if not self.flow.may(1 + loop.size):
                break
            with self.scouting():
                again = self.turn(loop, entry)
            joined = self.merged([entry, again], why)
            if joined == entry:
                return entry
            entry = joined
        return self.widened(entry, (loop,), why)

    @contextmanager
    def scouting(self) -> Generator[None]:
        """Go through lines without leaving anything noted."""
        returns, exits = len(self.returns), [len(left) for left in self.exits]
        jumps = {name: list(states) for name, states in self.jumps.items()}
        self.flow.scouting += 1
        try:
            yield
        finally:
            self.flow.scouting -= 1
            del self.returns[returns:]
            for left, size in zip(self.exits, exits, strict=True):
                del left[size:]
            for name, states in self.jumps.items():
                states[:] = jumps.get(name, [])

    def follow(self, routines: Sequence[R], entry: Callable[[R], S]) -> tuple[S, Any] | None:
        """State after a call, and what it returns; None where it is not followed.

        It is not where several routines have the name, where it leads into itself, and where too much was followed already.

        Args:
            routines: those that may be meant.
            entry: what holds where a routine begins.
        """
        (routine, *others) = routines
        state = entry(routine)
        too_deep = bool(others) or routine in self.inside or len(self.inside) > MAX_CALL_DEPTH
        if too_deep or not (self.flow.is_summarised(routine, state) or self.flow.may_follow(routine)):
            self.flow.anywhere.update(routines)
            self.flow.unclear += 1
            return None
        return self.flow.through(routine, state, self.inside)


# The motions that were found, each with all the ways that lead to it.

T = TypeVar("T", bound=Hashable)
"""A motion's place in the text."""
M = TypeVar("M")
"""A motion of a language."""


@dataclass(eq=False, kw_only=True, slots=True)
class Occurrence(Generic[T, M]):
    """A motion that was resolved."""

    text: T
    motion: M
    before: set[int | None]
    """Numbers of motions that may have been the last one, or `SOMEWHERE`; None for anything else."""


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class Ordered(Generic[M]):
    """A motion among the others, in the order of the text."""

    motion: M
    before: tuple[int, ...]
    """Numbers of the motions that may be the one before, as far as they are known."""
    follows: int | None
    """Number of the motion before, if there is one alone."""
    same_text: int
    """How many motions have its text, itself included."""
    begins_at_motion: bool = False
    """Whether it begins where one of the motions ends, and not always the same one."""


@dataclass(eq=False, kw_only=True)
class Findings(Generic[T, M]):
    """Motions found so far."""

    occurrences: list[Occurrence[T, M]] = field(default_factory=list[Any])
    by_meaning: dict[tuple[object, ...], int] = field(default_factory=dict[tuple[object, ...], int])
    """Numbers of motions by their text, where they go, and how."""
    reasons: dict[T, tuple[Any, str]] = field(default_factory=dict[Any, tuple[Any, str]])
    """Why motions are not understood on some way that leads to them, the first reason of each, with its file."""
    seen: frozenset[T] = frozenset()
    """Motions to which some way led before the ways that are never taken were gone through."""

    def fail(self, text: T, file: Any, reason: str) -> None:
        """Note why a motion is not understood."""
        self.reasons.setdefault(text, (file, reason))

    def number(self, text: T, motion: M, meaning: tuple[object, ...], before: int | None) -> int:
        """The number of a motion, which is noted if none is known that means the same.

        Args:
            text: its place.
            motion: the motion.
            meaning: equal for motions that have one text and do the same.
            before: number of the motion before.
        """
        number = self.by_meaning.setdefault(meaning, len(self.occurrences))
        if number == len(self.occurrences):
            self.occurrences.append(Occurrence(text=text, motion=motion, before=set()))
        self.link(number, before)
        return number

    def link(self, number: int, before: int | None) -> None:
        """Note the number of a motion that may be the one before another."""
        self.occurrences[number].before.add(before)

    def close(self) -> None:
        """Take all that was noted so far as seen."""
        self.seen = frozenset({*(found.text for found in self.occurrences), *self.reasons})

    def ordered(self, keeps: Callable[[Occurrence[T, M]], bool], order: Callable[[T], Any]) -> Iterator[Ordered[M]]:
        """Some of the motions in the order of the text.

        Args:
            keeps: whether a motion is one of them.
            order: by which places are ordered.
        """
        kept = [i for i, found in enumerate(self.occurrences) if keeps(found)]
        kept.sort(key=lambda i: (order(self.occurrences[i].text), i))
        number = {old: new for new, old in enumerate(kept)}
        count = Counter(self.occurrences[i].text for i in kept)
        for i in kept:
            found = self.occurrences[i]
            anywhere = SOMEWHERE in found.before
            before = {None if old is None else number.get(old) for old in found.before - {SOMEWHERE}}
            (first, *others) = before or {None}
            yield Ordered(
                motion=found.motion,
                before=tuple(sorted(old for old in before if old is not None)),
                follows=None if others or anywhere else first,
                same_text=count[found.text],
                # a motion that was not read may end elsewhere
                begins_at_motion=None not in before and (not self.reasons if anywhere else bool(others)),
            )
