"""Targets that several motions share: which can be rewritten as each of them needs, and which cannot.

A motion in a routine that is given its target, or in a loop, stands for several motions with one text. What it is given can be
changed where the call is, if nothing else reads it there; its own text only if all of its motions need the same.
"""

import math
from bisect import bisect_left
from collections import defaultdict
from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from taskcal.geometry import se3
from taskcal.programs.program import Visit, Waypoint
from taskcal.programs.rapid.frames import pose_of
from taskcal.programs.rapid.moving import nested
from taskcal.programs.rapid.names import Context, File, Symbol
from taskcal.programs.rapid.numbers import Texts, agree, new_texts
from taskcal.programs.rapid.resolve import Motion
from taskcal.programs.rapid.syntax import Argument, Assignment, Instruction, Node, Routine
from taskcal.programs.rapid.target_argument import TargetArgument
from taskcal.programs.rapid.uses import Use
from taskcal.programs.source import Place
from taskcal.programs.unwritable import reject_in_turn
from taskcal.robot.robot import Robot

TURNED = math.radians(0.01)
"""How far a target may be turned from where it should be that goes with another one, radians."""

Home = tuple[object, ...]
"""Where the numbers of a target stand."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Want:
    """New numbers for a target argument."""

    target: TargetArgument
    motion: Motion
    texts: Texts

    @property
    def changes(self) -> bool:
        """Whether some number gets another text."""
        return any(text is not None for text in self.texts)

    @property
    def replaceable(self) -> bool:
        """Whether the name of another target may stand where this one's does, as far as the motion goes."""
        if self.target.handed is not None:
            return self.target.whole
        return self.motion.move.texts_motions == 1

    @property
    def is_carried(self) -> bool:
        """Whether its text stays, because several motions have it, and only what it shifts can change."""
        base = self.target.base
        return base is not None and not base.shifted and self.motion.move.texts_motions > 1

    @property
    def carrier(self) -> TargetArgument:
        """What it shifts."""
        if self.target.base is None:
            raise ValueError("only a target under Offs or RelTool goes with another one")
        return self.target.base

    @property
    def T(self) -> Float[np.ndarray, "4 4"]:
        """The pose that is wanted."""
        own = self.target.meant
        numbers = [old if text is None else float(text) for text, old in zip(self.texts, own, strict=True)]
        quaternion = np.array(numbers[3:7])
        return pose_of(tuple(numbers[:3]), tuple(quaternion / np.linalg.norm(quaternion)))

    @property
    def home(self) -> Home:
        """Where its numbers stand."""
        return home_of(self.target)

    def agrees(self, other: "Want") -> bool:
        """Whether two want the same numbers."""
        return agree(self.target, self.texts, other.texts)


@dataclass(frozen=True, eq=False, kw_only=True)
class Sharing:
    """The motions of a program, and what reads its data."""

    motions: Sequence[Motion]
    uses: Mapping[Symbol, tuple[Use, ...]]
    robot: Robot
    tolerance: float
    """How far a target may be from where it should be that goes with another one, metres."""

    def unwritable(self, waypoints: Mapping[int, tuple[Waypoint, ...]]) -> dict[int, str]:
        """Motions that cannot be rewritten as they should, by number, and why."""
        return reject_in_turn(waypoints, self._conflicts)

    def _conflicts(self, waypoints: Mapping[int, tuple[Waypoint, ...]]) -> Iterator[tuple[int, str]]:
        for i, path in waypoints.items():
            motion = self.motions[i]
            count = motion.move.texts_motions
            (*before, last) = path
            if count > 1 and (before or last.kind != motion.move.kind):
                yield i, f"its text stands for {count} motions, and cannot become other ones for one of them"
        by_argument: dict[object, list[tuple[int, Want]]] = defaultdict(list)
        by_home: dict[Home, list[tuple[int, Want]]] = defaultdict(list)
        carried: list[tuple[int, Want]] = []
        for i in range(len(self.motions)):
            for want in self._wants(i, waypoints.get(i)):
                if want.is_carried:
                    carried.append((i, want))
                else:
                    by_argument[want.target.argument].append((i, want))
                    by_home[want.home].append((i, want))
        followed, lost = self._carried(carried, by_home)
        yield from lost
        replaced = [
            (want.target.argument_file, want.target.argument)
            for group in by_argument.values()
            for _, want in group
            if want.changes
            and want.target.origin is None
            and want.target.shifted
            and want.target.root.handed is not None
        ]
        for group in by_argument.values():
            yield from self._in_argument(group, followed, replaced)
        for group in by_home.values():
            yield from self._of_home(group, followed)

    def _carried(
        self, carried: Sequence[tuple[int, Want]], by_home: Mapping[Home, Sequence[tuple[int, Want]]]
    ) -> tuple[list[Want], list[tuple[int, str]]]:
        """Targets that go with those that they shift: those that come to where they should be, and why others cannot."""
        followed: list[Want] = []
        lost: list[tuple[int, str]] = []
        stuck: set[tuple[object, Home]] = set()
        for i, want in carried:
            base = want.carrier
            direct = [w for _, w in by_home.get(home_of(base), ()) if w.changes and not w.target.shifted]
            if base.handed is not None:
                direct = [w for w in direct if w.target.argument is base.argument]
            T = want.target.carried(direct[0].T if direct else base.T)
            off = float(np.linalg.norm(T[:3, 3] - want.T[:3, 3]))
            turned = float(np.linalg.norm(se3.log(T[:3, :3].T @ want.T[:3, :3])))
            if off <= self.tolerance and turned <= TURNED:
                followed.append(want)
            else:
                why = f"goes with the target that it shifts, and would be {off * 1e3:.3f} mm and {math.degrees(turned):.3f}° off"
                lost.append((i, why))
                stuck.add((base.argument if base.handed else None, home_of(base)))
        followed = [
            w for w in followed if (w.carrier.argument if w.carrier.handed else None, home_of(w.carrier)) not in stuck
        ]
        return followed, lost

    def _wants(self, i: int, path: tuple[Waypoint, ...] | None) -> Iterator[Want]:
        motion = self.motions[i]
        if path is not None and path[-1].kind != motion.move.kind:
            path = None
        last = None if path is None else path[-1]
        ends = (motion.end, last), (motion.via, last.via if last else None)
        for target, waypoint in ends:
            if target is not None:
                none: Texts = (None,) * len(target.meant)
                texts = none if waypoint is None else new_texts(target, waypoint, self.robot)
                yield Want(target=target, motion=motion, texts=texts)

    def _in_argument(
        self, group: Sequence[tuple[int, Want]], followed: Sequence[Want], replaced: Sequence[tuple[File, Argument]]
    ) -> Iterator[tuple[int, str]]:
        """Motions that get their targets from one argument, each target from one place.

        What reads a parameter in text that numbers take the place of reads it no longer.
        """
        if not any(want.changes for _, want in group):
            return
        of_home: dict[Home, list[tuple[int, Want]]] = defaultdict(list)
        for i, want in group:
            of_home[want.home].append((i, want))
        for same in of_home.values():
            if not all(want.agrees(same[0][1]) for _, want in same):
                yield from _all_of(same, f"has its target in common with {_places(same)}, which need other numbers")
        first = group[0][1]
        if first.target.handed is None:
            computed = first.target.literal is None or first.target.shifted
            if computed and len({i for i, _ in group}) > 1 and len(of_home) > 1:
                yield from _all_of(
                    group, f"its text stands for {first.motion.move.texts_motions} motions to different places"
                )
            return
        other = self._other_reading(group, followed, replaced)
        if other is not None:
            place = other.file.source.place(other.start)
            yield from _all_of(group, f"what the call gives it is read for something else in {place}, too")

    def _other_reading(
        self, group: Sequence[tuple[int, Want]], followed: Sequence[Want], replaced: Sequence[tuple[File, Argument]]
    ) -> Use | None:
        """What reads a parameter beside the motions that go to it."""
        argument = group[0][1].target.argument
        known = {(w.motion.file, w.target.read_at) for w in followed if w.carrier.argument is argument}
        parameters: set[Symbol] = set()
        for _, want in group:
            handed = want.target.handed
            if handed is not None:
                known |= {*handed.reads, (want.motion.file, want.target.read_at)}
                parameters |= set(handed.parameters)
        uses = (use for symbol in parameters for use in self.uses.get(symbol, ()))
        return next((u for u in uses if (u.file, u.start) not in known and not _is_in(u, replaced)), None)

    def _of_home(self, group: Sequence[tuple[int, Want]], followed: Sequence[Want]) -> Iterator[tuple[int, str]]:
        """Motions whose targets stand in one declaration, which is what has to change where no copy can be named."""
        fixed = [(i, want) for i, want in group if not want.replaceable and want.changes]
        if not fixed or fixed[0][1].target.origin is None:
            return
        (_, first) = fixed[0]
        if not all(want.agrees(first) for _, want in fixed):
            yield from _all_of(fixed, f"has its target in common with {_places(fixed)}, which need other numbers")
        elif first.target.literal is None or any(want.target.shifted for _, want in fixed):
            yield from _all_of(
                fixed, f"its text stands for {first.motion.move.texts_motions} motions, which need different ones"
            )
        elif first.target.origin is not None:
            symbol, path = first.target.origin.symbol, first.target.origin.path
            changed = [want for _, want in group if want.changes and (want.replaceable or want.agrees(first))]
            going = [want for want in followed if home_of(want.carrier) == first.home]
            other = other_use(self.uses.get(symbol, ()), path, changed, going)
            if other is not None:
                place = other.file.source.place(other.start)
                yield from _all_of(
                    fixed, f"its target {first.target.origin.name} is read for something else in {place}, too"
                )


def home_of(target: TargetArgument) -> Home:
    """Where the numbers of a target stand."""
    if target.origin is not None:
        return (target.origin.symbol, target.origin.path)
    return (target.argument, target.literal, target.meant if target.literal is None else ())


def other_use(
    uses: Iterable[Use], path: tuple[int, ...], wants: Iterable[Want], followed: Iterable[Want] = ()
) -> Use | None:
    """What reads a target beside the arguments that change, and those that go with it."""
    own = [(want.target.argument_file, want.target.argument) for want in wants if want.changes]
    own += [(want.target.argument_file, want.target.argument) for want in followed]

    return next((use for use in uses if use.overlaps(path) and not _is_in(use, own)), None)


def _is_in(use: Use, arguments: Iterable[tuple[File, Argument]]) -> bool:
    return any(use.file is file and argument.start <= use.start < argument.end for file, argument in arguments)


def _all_of(group: Iterable[tuple[int, Want]], why: str) -> Iterator[tuple[int, str]]:
    return ((i, why) for i, _ in group)


def _places(group: Iterable[tuple[int, Want]]) -> str:
    """Where the motions of a group stand, and where what they are given does."""
    places: dict[str, None] = {}
    for _, want in group:
        places[str(want.motion.move.place)] = None
        if want.target.handed is not None:
            places[str(want.target.argument_file.source.place(want.target.argument.start))] = None
    shown = list(places)[:4]
    return ", ".join(shown) + (" …" if len(places) > len(shown) else "")


@dataclass(frozen=True, eq=False, kw_only=True)
class _Stop:
    """A motion of a routine, with data of which its targets are made."""

    number: int | None
    """None of one that was not resolved."""
    names: frozenset[tuple[Symbol, tuple[int, ...] | None]]
    frames: frozenset[str]
    """Its tool and work object as they are written; of one that is not read all that it is given."""
    given: Argument | None
    """What a parameter that it goes to was given; None where it goes to none, or that is not known."""
    place: Place


def visits_of(
    everywhere: Iterable[Context],
    motions: Sequence[Motion],
    unresolved: Container[Instruction],
    uses: Iterable[tuple[Symbol, Use]],
) -> Iterator[Visit]:
    """Motions of one routine to one target in one tool and work object.

    A motion goes to the target that it names or shifts, and to those from which a variable was set last that it names.

    Args:
        everywhere: modules and routines.
        motions: those that were resolved.
        unresolved: motions that were not, on no way that leads to them.
        uses: all references to data.
    """
    numbers: dict[Instruction, list[int]] = defaultdict(list)
    for i, motion in enumerate(motions):
        numbers[motion.instruction].append(i)
    read: dict[int, list[tuple[int, Symbol, Use]]] = defaultdict(list)
    for symbol, use in uses:
        if use.type in ("robtarget", "jointtarget"):
            read[id(use.file)].append((use.start, symbol, use))
    for own in read.values():
        own.sort(key=lambda one: one[0])
    for context in everywhere:
        if context.routine is not None:
            text = _RoutineText(file=context.file, read=read[id(context.file)], motions=motions, numbers=numbers)
            yield from _visits(context.routine, text.stops(context.routine, unresolved))


def _visits(routine: Routine, stops: Iterable[_Stop]) -> Iterator[Visit]:
    by_name: dict[object, list[_Stop]] = defaultdict(list)
    for stop in stops:
        for name in stop.names:
            by_name[name].append(stop)
    for name, group in by_name.items():
        kinds = dict.fromkeys((stop.frames, stop.given) for stop in group if stop.number is not None)
        for stop in group:
            for frames, given in kinds:
                same = stop.frames == frames if stop.number is not None else stop.frames >= frames
                if same and (stop.given is given or stop.given is None):
                    yield Visit(number=stop.number, target=(routine, name, frames, given), place=stop.place)


@dataclass(frozen=True, eq=False, kw_only=True)
class _RoutineText:
    """What the motions of a file's routines read."""

    file: File
    read: Sequence[tuple[int, Symbol, Use]]
    """References to targets, in the order of the text."""
    motions: Sequence[Motion]
    numbers: Mapping[Instruction, Sequence[int]]

    def stops(self, routine: Routine, unresolved: Container[Instruction]) -> Iterator[_Stop]:
        """Its motions, in the order of the text."""
        made_of: dict[Symbol, frozenset[tuple[Symbol, tuple[int, ...] | None]]] = {}
        for statement in nested(routine.statements):
            if isinstance(statement, Assignment) and not statement.target.selectors:
                own = {symbol for symbol, _ in self._names(statement.target)}
                named = self._names(statement.value)
                for symbol in own:
                    made_of[symbol] = named.union(*(made_of.get(one, ()) for one, _ in named))
            if not isinstance(statement, Instruction):
                continue
            if statement in unresolved:
                named = frozenset(name for argument in statement.arguments for name in self._names(argument))
                yield self._stop(statement, None, named, made_of)
            for i in self.numbers.get(statement, ()):
                where = self.motions[i].layout
                named = self._names(where.to) | (frozenset() if where.via is None else self._names(where.via))
                yield self._stop(statement, i, named, made_of)

    def _stop(
        self,
        statement: Instruction,
        i: int | None,
        named: frozenset[tuple[Symbol, tuple[int, ...] | None]],
        made_of: Mapping[Symbol, frozenset[tuple[Symbol, tuple[int, ...] | None]]],
    ) -> _Stop:
        text, place = self.file.source.text, self.file.source.place(statement.start)
        names = named.union(*(made_of.get(symbol, ()) for symbol, _ in named))
        arguments = statement.arguments if i is None else (self.motions[i].layout.tool,)
        frames = [text[a.start : a.end].lower() for a in arguments if not a.option]
        frames += [text[a.start : a.end].lower() for a in statement.arguments if a.option == "wobj"]
        given = None
        if i is not None:
            root = self.motions[i].end.root
            given = None if root.handed is None else root.handed.argument
            if root.origin is not None:  # the index of an element is known, which the text may not state
                own = root.origin
                names = frozenset((s, own.path if path is None and s is own.symbol else path) for s, path in names)
        return _Stop(number=i, names=names, frames=frozenset(frames), given=given, place=place)

    def _names(self, node: Node) -> frozenset[tuple[Symbol, tuple[int, ...] | None]]:
        """Targets that are read in a part of the text."""
        first = bisect_left(self.read, node.start, key=lambda one: one[0])
        last = bisect_left(self.read, node.end, key=lambda one: one[0])
        return frozenset((symbol, use.path) for _, symbol, use in self.read[first:last])
