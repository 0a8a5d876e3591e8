"""Which text gets which numbers where motions share them: one rule for all languages, and the little that each of them spells.

A point of a motion is stated in the motion's text, or named there and stated elsewhere. New numbers are written where the old ones
stand if nothing else needs those; where motions need different ones, most of them get theirs there. Any other text gets numbers of
its own: the name of a clone where the old ones are declared, the numbers themselves where an instruction states them, which a
second instruction would have to repeat. A text that stands for several motions can get none of its own unless all of them need the
same; where it shifts a point, it goes along with the numbers of that one.
"""

import re
from abc import ABC, abstractmethod
from collections import defaultdict
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence, Set
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from math import degrees, inf
from pathlib import Path
from typing import Any, ClassVar, Generic, Protocol, TypeVar

import numpy as np
from jaxtyping import Float

from robot_programs.core.flow import Loop, reached, unread_in
from robot_programs.core.form import Ask, Do, Line, MoveLine, Routine, Span, Text, calls_in
from robot_programs.core.program import Paths, Program, Waypoint, reject_in_turn
from robot_programs.core.robot import NO_ROBOT, Robot
from robot_programs.core.source import FreshNames, Source, TextEdit
from robot_programs.core.values import Origin
from robot_programs.core.written_out import (
    MAX_SHARED_TURN_RAD,
    Repeated,
    Shared,
    TargetArray,
    Turns,
    least_worst,
    loops_to_write,
    of_whole_paths,
    same_motions,
    tables,
    with_texts,
    written_out,
)
from taskcal_groundwork import se3
from taskcal_groundwork.errors import InputError

N = TypeVar("N")
"""Numbers of a point, as a language compares and writes them."""

Pose = Float[np.ndarray, "4 4"]

HELD = 1e-7
"""Poses that differ by less are one, metres and parts of a rotation matrix: less than programs state."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Use(Generic[N]):
    """A point of a motion, and the text that leads to it."""

    motion: int
    """Number of the motion."""
    text: Span
    """What states or names the point: in the motion, or in the call that gives it to the motion's routine."""
    slot: Origin | None
    """Where its numbers stand; None where no text of the program states them."""
    numbers: N
    """That it has."""
    wanted: N
    """That it is to have."""
    shifted: N | None = None
    """What a text of its own is to state where that is not `wanted`: the text shifts the point away from its numbers."""
    counts_from: Collection[int] = ()
    """Numbers of motions from whose ends the motion counts, which cannot change unless its text can."""
    point: Any = None
    """What else the language has to know of it."""
    poses: tuple[Callable[[Pose], Pose], Callable[[Pose], Pose]] | None = None
    """From a pose of the point to the one that its place states, and back; None of numbers that state none."""
    T: tuple[Pose, Pose] | None = None
    """Pose that it has, and that it is to have; only of points that others may shift, and of these."""
    follows: bool = False
    """Its text, which several motions have, shifts the point of the place, and can only go along with it; the numbers are those
    of the shifted point."""
    given: bool = False
    """Its text stands in a call."""
    instead: "Use[N] | None" = None
    """The same point of a call as the motion itself would state it, whose text is for it alone; None where that is not so."""

    @property
    def staying(self) -> "Use[N]":
        """The same without other numbers."""
        return replace(self, wanted=self.numbers, T=None if self.T is None else (self.T[0],) * 2, instead=None)

    def holds(self, T: Pose) -> bool:
        """Whether it is where it was if the point that it shifts gets a pose."""
        assert self.poses is not None
        assert self.T is not None
        return bool(np.abs(self.poses[1](T) - self.T[0]).max() <= HELD)

    def misses(self, T: Pose | None, tolerance: float) -> str:
        """Why it cannot go along with the point that it shifts; empty where that brings it to where it should be.

        Args:
            T: pose of that one; None where it stays.
            tolerance: how far it may be off, metres.
        """
        assert self.poses is not None
        assert self.T is not None
        reached, wanted = self.T[0] if T is None else self.poses[1](T), self.T[1]
        off = float(np.linalg.norm(reached[:3, 3] - wanted[:3, 3]))
        turned = float(np.linalg.norm(se3.log(reached[:3, :3].T @ wanted[:3, :3])))
        if off <= tolerance and turned <= MAX_SHARED_TURN_RAD:
            return ""
        return f"goes with the target that it shifts, and would be {off * 1e3:.3f} mm and {degrees(turned):.3f}° off"

    @property
    def own(self) -> N:
        """What a text of its own is to state."""
        return self.wanted if self.shifted is None else self.shifted


def points_of(count: int, waypoint: Waypoint | None) -> tuple[Waypoint | None, ...]:
    """Waypoints of one or two points of a motion; None of those that stay."""
    return (waypoint,) if count == 1 else (None if waypoint is None else waypoint.via, waypoint)


@dataclass(eq=False, kw_only=True)
class Spelling(ABC, Generic[N]):
    """What is written into the files of a program, as its language spells it."""

    sources: Sequence[Source]
    uses: Sequence[Use[N]]
    """All points of all motions, in their order."""
    edits: dict[int, list[TextEdit]] = field(default_factory=lambda: defaultdict[int, list[TextEdit]](list))
    """By number of the file."""

    @abstractmethod
    def alike(self, one: N, other: N) -> bool:
        """Whether numbers are written alike."""

    @abstractmethod
    def reader(self, slot: Origin, texts: Collection[Span]) -> str:
        """Place of what reads the numbers of a place beside some texts, or another name for it; empty where nothing does."""

    @abstractmethod
    def in_place(self, use: Use[N]) -> None:
        """Write the numbers wanted of a point where it has its own."""

    @abstractmethod
    def own(self, use: Use[N]) -> str:
        """Text that states what a point's own is to state."""

    def clone(self, use: Use[N]) -> str | None:
        """Declare that beside the point's own numbers, and say by which name; None where these are not declared."""
        return None

    def obstacle(self, use: Use[N]) -> str:
        """Why the text of a point cannot state numbers of its own; empty where it can."""
        return ""

    @abstractmethod
    def insert(self, number: int, path: Sequence[Waypoint]) -> None:
        """Write motions in front of a motion, to all of its waypoints but the last, of whose kind it becomes itself."""

    def place(self, at: Span) -> str:
        """File and line of some text."""
        return str(self.sources[at[0]].place(at[1]))

    def result(self) -> tuple[Source, ...]:
        """The files with all that was written."""
        return tuple(source.edited(self.edits[i]) for i, source in enumerate(self.sources))


@dataclass(frozen=True, eq=False, kw_only=True)
class _Settled(Generic[N]):
    """What becomes of the points of a program that share text."""

    spelling: Spelling[N]
    in_place: Sequence[Use[N]]
    """Points whose numbers are written where they have them, one for each place."""
    own: Sequence[Use[N]]
    """Points whose text gets numbers of its own, one for each text."""
    conflicts: Mapping[int, str]
    """Motions that cannot be written, and why."""


def _settled(spelling: Spelling[N], tolerance: float) -> _Settled[N]:
    """Choose for each place of numbers whether it keeps them, and for each text whether it leads elsewhere.

    A point that a call cannot give as its motion needs it is stated by the motion itself, where its text is for it alone.
    """
    while True:
        found = _Choice(spelling=spelling, tolerance=tolerance)
        settled = found.settled()
        if not found.instead:
            return settled
        spelling = replace(spelling, uses=[found.instead.get(use, use) for use in spelling.uses])


@dataclass(eq=False, kw_only=True)
class _Choice(Generic[N]):
    """Of what is written for the points of a program."""

    spelling: Spelling[N]
    tolerance: float
    """How far a point may be off that goes along with another one, metres."""
    by_text: Mapping[Span, list[Use[N]]] = field(default_factory=lambda: defaultdict[Span, list[Use[N]]](list))
    """Points that their texts themselves state or name."""
    following: Mapping[Span, list[Use[N]]] = field(default_factory=lambda: defaultdict[Span, list[Use[N]]](list))
    """Others."""
    own: dict[Span, Use[N]] = field(default_factory=dict[Span, Use[N]])
    in_place: list[Use[N]] = field(default_factory=list[Use[N]])
    conflicts: dict[int, str] = field(default_factory=dict[int, str])
    instead: dict[Use[N], Use[N]] = field(default_factory=dict[Use[N], Use[N]])
    """Points that their motions have to state, each as it is then."""

    def settled(self) -> _Settled[N]:
        by_slot = defaultdict[Any, list[Use[N]]](list)
        for use in self.spelling.uses:
            (self.following if use.follows else self.by_text)[use.text].append(use)
            by_slot[use.text if use.slot is None else use.slot].append(use)
        alike = self.spelling.alike
        self.moving = {u for u in self.spelling.uses if u.wanted is not u.numbers and not alike(u.wanted, u.numbers)}
        self.moved = {use.text for use in self.moving if not use.follows}
        # of the others none gets numbers of its own
        self.obstacles = {text: self.spelling.obstacle(self.by_text[text][0]) for text in self.moved}
        self.free = {text for text in self.moved if not self.obstacles[text] and self._agree(text)}
        for group in by_slot.values():
            if not self.moving.isdisjoint(group):
                self._settle([use for use in group if not use.follows], [use for use in group if use.follows])
        return _Settled(
            spelling=self.spelling, in_place=self.in_place, own=tuple(self.own.values()), conflicts=self.conflicts
        )

    def _agree(self, text: Span) -> bool:
        """Whether the points of a text need the same; those that are shifted from it and stay keep it from changing."""
        first, *others = self.by_text[text]
        return all(self.spelling.alike(use.own, first.own) for use in others) and self._holds(
            self.following.get(text, ()), first
        )

    def _holds(self, following: Sequence[Use[N]], kept: Use[N]) -> bool:
        """Whether points that stay are where they were if the one that they shift becomes what another one needs."""
        return all(use in self.moving or use.holds(_place(kept)) for use in following)

    def _settle(self, group: Sequence[Use[N]], following: Sequence[Use[N]]) -> None:
        """The same for the points of one place."""
        alike, free = self.spelling.alike, self.free
        bound = [use for use in group if use.text not in free]
        rigid = [use for use in bound if use.instead is None]
        kept: Use[N] | None = _most_wanted(self.spelling, rigid or bound or group) if group else following[0]
        others = self._needing(group, following)
        if others or not self._holds([use for use in following if not (use.given and use.text in free)], kept):
            kept = None
        away = [use for use in group if not alike(use.wanted, use.numbers if kept is None else kept.wanted)]
        for use in away:
            if use.text in free:
                self.own.setdefault(use.text, use)
            elif use.instead is not None:
                self.instead[use] = use.instead
        refused = defaultdict[Span, list[Use[N]]](list)
        for use in bound if any(use.text not in free for use in away) else ():
            refused[use.text].append(use)
        for text, uses in refused.items():
            same = kept is None and all(alike(use.wanted, uses[0].wanted) for use in uses)
            why = (same and self._staying(uses[0], others)) or "which need different numbers"
            where = f" in {self.spelling.place(text)}" if uses[0].given else ""
            several = f"its text{where} stands for {len(self.by_text[text])} motions, {why}"
            self.conflicts |= {use.motion: self.obstacles.get(text) or several for use in uses if use in self.moving}
        for use in following:
            leader = next(iter(self.by_text.get(use.text, ())), kept) if use.text in free else kept
            why = use.misses(None if leader is None else _place(leader), self.tolerance) if use in self.moving else ""
            if why:
                stays = "" if leader else self._staying(use, others)
                self.conflicts[use.motion] = f"goes with the target that it shifts, {stays}" if stays else why
        self.in_place += [] if kept is None else [kept]

    def _staying(self, use: Use[N], others: str) -> str:
        """That the numbers of a point's place have to stay; empty where it has none."""
        if use.slot is None:
            return ""
        return f"and the numbers in {self.spelling.place(use.slot.at)} have to stay for {others or 'others'}"

    def _needing(self, group: Sequence[Use[N]], following: Sequence[Use[N]]) -> str:
        """What needs the numbers of a place as they are, or none stand there, or they are computed; empty where nothing does."""
        both, spelling = (*group, *following), self.spelling
        slot = both[0].slot
        if slot is None or any(not spelling.alike(use.numbers, group[0].numbers) for use in group):
            return "others"
        staying = next((use.text for use in group if use not in self.moving), None)
        return spelling.reader(slot, {use.text for use in both}) if staying is None else spelling.place(staying)


def _place(use: Use[N]) -> Pose:
    """Pose that the place of a point is to state."""
    assert use.poses is not None
    assert use.T is not None
    return use.poses[0](use.T[1])


def _most_wanted(spelling: Spelling[N], group: Sequence[Use[N]]) -> Use[N]:
    """The point whose numbers most texts are to have, the first of several."""
    texts, counts = dict[Span, Use[N]](), dict[Use[N], int]()
    for use in group:
        texts.setdefault(use.text, use)
    for use in texts.values():
        same = next((one for one in counts if spelling.alike(one.wanted, use.wanted)), use)
        counts[same] = counts.get(same, 0) + 1
    return max(counts, key=counts.__getitem__)


def _write(settled: _Settled[N]) -> None:
    spelling = settled.spelling
    for use in settled.in_place:
        spelling.in_place(use)
    clones = defaultdict[Origin | None, list[tuple[N, str]]](list)
    for use in settled.own:
        known = clones[use.slot]
        name = next((name for numbers, name in known if spelling.alike(numbers, use.own)), None)
        if name is None:
            name = None if use.slot is None else spelling.clone(use)
            known += [] if name is None else [(use.own, name)]
        file, start, end = use.text
        spelling.edits[file].append(TextEdit(start=start, end=end, text=spelling.own(use) if name is None else name))


class Sited(Protocol):
    """A motion's place in the text."""

    @property
    def text(self) -> Text:
        """Of the motion."""
        ...


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class SharingProgram(Program):
    """A program whose points are written by `Spelling`.

    A language that says of its loops and routines how they are written again has their text written out; see `Program.written_out`.
    """

    LANGUAGE: ClassVar[str]
    REWORDS: ClassVar[bool] = False
    """Whether a motion may become one of another kind."""
    SHARES_ROUTINES: ClassVar[bool] = False
    """Whether a copy of a routine is known in other files."""
    TABLE: ClassVar[str] = ""
    """Name of an array of targets, an element for each turn of a loop; empty where none is declared."""
    DIVIDED: ClassVar[str] = "/"
    """The operator of whole quotients."""

    sites: Sequence[Sited] = ()
    """The motions' places in the text, in their order."""
    routines: Sequence[Routine] = ()
    """In the order of the text; none where it is not written out."""
    turns: Mapping[Loop, tuple[float, ...] | None] = field(default_factory=dict[Loop, tuple[float, ...] | None])
    """See `Flow.turns`."""
    begun: Mapping[Loop, tuple[float, ...] | None] = field(default_factory=dict[Loop, tuple[float, ...] | None])
    """See `Flow.begun`."""

    @abstractmethod
    def spelling(self, robot: Robot, waypoints: Paths) -> Spelling[Any]:
        """How motions are written; for the arguments see `rewrite`."""

    def rewrite(self, robot: Robot, waypoints: Paths) -> tuple[Source, ...]:
        """The program's files with some motions rewritten; see `Program.rewrite`.

        Raises:
            InputError: a motion is to become one of another kind, or cannot be what it should.
        """
        other = {n for n, path in waypoints.items() if any(one.kind != self.motions[n].kind for one in path)}
        for number in () if self.REWORDS else other:
            place = self.motions[number].place
            raise InputError(f"{place}: the motion cannot become one of another kind in {self.LANGUAGE}")
        settled = _settled(self.spelling(robot, waypoints), inf)
        spelling = settled.spelling
        for number, why in self._conflicts(settled, waypoints).items():
            raise InputError(f"{self.motions[number].place}: {why}")
        for number, path in sorted(waypoints.items()):
            if len(path) > 1 or number in other:
                spelling.insert(number, path)
        _write(settled)
        return spelling.result()

    def unwritable(self, robot: Robot, waypoints: Paths, tolerance: float) -> dict[int, str]:
        """Motions whose text stands for several, which need different numbers; see `Program.unwritable`."""
        sharing = {number: path for number, path in waypoints.items() if number in self._sharing}
        if not sharing:
            return {}
        spelling = self.spelling(robot, sharing)

        def conflicts(paths: Paths) -> Iterator[tuple[int, str]]:
            staying = sharing.keys() - paths.keys()
            uses = [use.staying if use.motion in staying else use for use in spelling.uses]
            rest = replace(spelling, uses=uses) if staying else spelling
            yield from self._conflicts(_settled(rest, tolerance), paths).items()

        return reject_in_turn(sharing, conflicts)

    @cached_property
    def _sharing(self) -> Set[int]:
        """Motions whose text stands for several, or cannot state numbers of its own, and others on which it depends what it is."""
        spelling = self.spelling(NO_ROBOT, {})
        uses, several = spelling.uses, {n for n, move in enumerate(self.motions) if move.texts_motions > 1}
        own = [use for use in uses if use.given or use.motion in several or spelling.obstacle(use)]
        slots = {None, *(use.slot for use in own)} if own else ()
        before = {number for use in own for number in use.counts_from}
        return before.union((use.motion for use in own), (use.motion for use in uses if use.slot in slots))

    def _conflicts(self, settled: _Settled[Any], waypoints: Paths) -> dict[int, str]:
        found, spelling = dict(settled.conflicts), settled.spelling
        others = {n for n, (*more, last) in waypoints.items() if more or last.kind != self.motions[n].kind}
        for use in spelling.uses if others else ():
            count = self.motions[use.motion].texts_motions
            why = f"its text stands for {count} motions, of which none gets points of its own" if count > 1 else ""
            if use.motion in others and (why := why or spelling.obstacle(use.instead or use)):
                found[use.motion] = why
        for use in spelling.uses if found else ():
            why = f"{spelling.place(use.text)} counts from where it ends, and {found.get(use.motion)}"
            for number in use.counts_from if use.motion in found else ():
                found.setdefault(number, why)
        return found

    def least_worst(
        self, robot: Robot, waypoints: Paths, numbers: Collection[int], tolerance: float
    ) -> dict[int, tuple[Waypoint, ...]]:
        """One value where motions share their numbers; see `Program.least_worst`."""
        spelling = self.spelling(robot, waypoints)
        groups = defaultdict[Any, list[Use[Any]]](list)
        for use in spelling.uses:
            if use.poses is not None and self.motions[use.motion].via is None:
                groups[use.given and use.text, use.text if use.slot is None else use.slot].append(use)
        out: dict[int, tuple[Waypoint, ...]] = {}
        for group in groups.values():
            own = [use for use in group if not use.follows]
            if not all(spelling.alike(use.numbers, own[0].numbers) for use in own):
                continue  # they are computed
            if any(use.motion in numbers for use in group):
                shared = [
                    Shared(number=use.motion, base=use.poses[0], target=use.poses[1]) for use in group if use.poses
                ]
                out |= least_worst(shared, waypoints, tolerance)
        return out

    # Text that stands for several motions, written out.

    @property
    def texts(self) -> Sequence[Source]:
        """The files, by the numbers by which places name them."""
        return self.sources

    def fresh_names(self) -> FreshNames:
        """Names that are free in all files."""
        raise NotImplementedError

    def differs(self, routine: Any, loop: Loop) -> bool:
        """Whether the turns of a loop differ by its own counter."""
        return True

    def turned(self, routine: Any, loop: Loop, taken: Sequence[float]) -> Turns | None:
        """A loop turn by turn, given the values of its counter; None where it cannot be written so."""
        raise NotImplementedError

    def copied(self, routine: Any) -> Repeated | None:
        """A routine without the calls that get copies of it; None where none can."""
        raise NotImplementedError

    def counter(self, loop: Loop) -> str:
        """Name of the counter of a loop; empty without one."""
        raise NotImplementedError

    def is_listable(self, number: int, routine: Any) -> bool:
        """Whether an array of a routine may hold the target of a motion."""
        raise NotImplementedError

    def listed(self, routine: Any, name: str, table: TargetArray) -> Iterable[tuple[Source, Span, str]]:
        """What declares an array of targets, and stands for the target of its motions.

        Args:
            routine: in which these stand.
            name: of the array.
            table: they.

        Returns:
            Files, places in them, of which the numbers of files do not count, and the text there.
        """
        raise NotImplementedError

    def written_out(self, numbers: Collection[int]) -> tuple[Source, ...] | None:
        """The program's files with shared text written out; see `Program.written_out`."""
        if not self.routines:
            return None
        texts, shared = {self.sites[i].text for i in numbers}, list[tuple[Line, Routine]]()
        calls = defaultdict[Routine, list[tuple[Line, Routine, Do | Ask]]](list)
        for routine in self.routines:
            for line in routine.lines:
                if isinstance(line, MoveLine) and line.at[:2] in texts:
                    shared.append((line, routine))
                for call in calls_in(line):
                    for one in call.routines:
                        calls[one].append((line, routine, call))
        around = {line for line, _ in reached(shared, lambda one: [(line, by) for line, by, _ in calls[one[1]]])}
        turns = (
            (self.texts[loop.line.at[0]], made)
            for routine in self.routines
            for loop, taken in loops_to_write(
                routine.all_nodes, self.turns, around.__contains__, partial(self.differs, routine)
            )
            if (made := self.turned(routine, loop, taken)) is not None
        )
        within = {routine for _, routine in shared}
        repeated = (self._repeated(routine, calls[routine]) for routine in self.routines if routine in within)
        return written_out(self.sources, turns, [one for one in repeated if one is not None], self.fresh_names())

    def _repeated(self, routine: Routine, calls: Sequence[tuple[Line, Routine, Do | Ask]]) -> Repeated | None:
        """A routine of which each call gets a copy that can name it, but for the first if it is named by calls alone."""
        copied = None if any(by is routine for _, by, _ in calls) else self.copied(routine)
        if copied is None:
            return None
        named = re.compile(rf"{re.escape(routine.name)}\b", re.IGNORECASE)
        unread = {line for by in {by for _, by, _ in calls} for line in unread_in(by.all_nodes)}
        everywhere = {call.at: (line, self.texts[call.at[0]]) for line, _, call in calls}
        own = [
            (source, found.span())
            for (_, start, _), (line, source) in everywhere.items()
            if line not in unread and (source is copied.source or self.SHARES_ROUTINES)
            and (found := named.match(source.text, start))
        ]  # fmt: skip
        return replace(copied, calls=tuple(own[len(own) == len(everywhere) :]))

    def tabled(self, numbers: Collection[int]) -> Program | None:
        """The program with targets of loops in arrays; see `Program.tabled`."""
        if not self.TABLE:
            return None
        own, fresh = defaultdict[Text, list[int]](list), self.fresh_names()
        for i, site in enumerate(self.sites):
            own[site.text].append(i)
        shared, of_table = {self.sites[i].text for i in numbers}, dict[TargetArray, Routine]()
        for routine in self.routines:

            def listable(line: Line, routine: Routine = routine) -> Sequence[int]:
                same = own[line.at[:2]] if line.at[:2] in shared else ()
                return same if all(self.is_listable(i, routine) for i in same) else ()

            of_table |= dict.fromkeys(tables(routine.all_nodes, listable, self.begun, self.counter), routine)
        named = defaultdict[Path, dict[tuple[int, int], str]](lambda: defaultdict[tuple[int, int], str](str))
        for table in of_whole_paths(tuple(of_table), numbers, self.visits()):
            for source, (_, *place), text in self.listed(of_table[table], fresh.nearest(self.TABLE), table):
                named[source.path][place[0], place[1]] += text
        sources = with_texts(self.sources, named, fresh) if named else None
        again = self.reread(sources) if sources else None
        return again if again is not None and same_motions(self.motions, again.motions) else None
