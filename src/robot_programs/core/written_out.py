"""One text for several motions that need different numbers: one value that is good enough, or the text written out.

Written out are loops turn by turn, and a copy of a routine for each of its calls. The program does the same as before, and each
motion has numbers of its own. Of loops that would get too long, targets stand in an array, an element for each turn.
"""

import math
import re
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from robot_programs.core.flow import Block, FlowStep, Loop, bodies_of, leaves_loop, lines_in
from robot_programs.core.program import Motion, Paths, TargetVisit, Waypoint
from robot_programs.core.source import FreshNames, Source
from taskcal_groundwork import se3

# One value for several motions: of the least largest error.

MAX_SHARED_TURN_RAD = math.radians(0.01)
"""How far a target may be turned from where it should be whose numbers are others' as well, radians."""

CENTRE_STEPS = 1000
"""Of the search for the middle of points, whose largest distance is then at most 3 % above the least one (Badoiu and Clarkson
(2003), Smaller core-sets for balls: 1 + ε after 1/ε² steps)."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Shared:
    """A motion whose numbers are others' as well."""

    number: int
    base: Callable[[Float[np.ndarray, "4 4"]], Float[np.ndarray, "4 4"]] = lambda T: T
    """Pose that the numbers have to state for a pose of its target."""
    target: Callable[[Float[np.ndarray, "4 4"]], Float[np.ndarray, "4 4"]] = lambda T: T
    """The inverse."""


def least_worst(group: Sequence[Shared], waypoints: Paths, tolerance: float) -> dict[int, tuple[Waypoint, ...]]:
    """Waypoints of motions that share their numbers, all from the one value whose largest error is least.

    Args:
        group: the motions.
        waypoints: of them and of others, where they should be.
        tolerance: the largest error that is good enough, metres.

    Returns:
        New waypoints of all of the group; none where one of them stays, is divided, or would be too far off.
    """
    paths = [waypoints.get(one.number, ()) for one in group]
    wanted = [path[0].T for path in paths if len(path) == 1 and path[0].via is None and path[0].T is not None]
    if len(group) < 2 or len(wanted) < len(group):
        return {}
    bases = np.stack([one.base(T) for one, T in zip(group, wanted, strict=True)])
    R = bases[0, :3, :3]
    turn = _centre(se3.log(R.T @ bases[:, :3, :3]))
    value = se3.pose(R @ se3.exp(turn), _centre(bases[:, :3, 3]))
    reached = [one.target(value) for one in group]
    for T, own in zip(wanted, reached, strict=True):
        if np.linalg.norm(own[:3, 3] - T[:3, 3]) > tolerance:
            return {}
        if np.linalg.norm(se3.log(T[:3, :3].T @ own[:3, :3])) > MAX_SHARED_TURN_RAD:
            return {}
    return {one.number: (replace(path[0], T=own),) for one, path, own in zip(group, paths, reached, strict=True)}


def _centre(points: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, " 3"]:
    """The point whose largest distance from others is least."""
    centre = points.mean(axis=0)
    for k in range(CENTRE_STEPS):
        farthest = points[np.argmax(((points - centre) ** 2).sum(axis=1))]
        centre = centre + (farthest - centre) / (k + 2.0)
    return centre


# The text written out.

MAX_NEW_LINES = 5000
"""A pallet of a thousand places with five lines each; more text than that is a burden on the controller."""

Named = Mapping[tuple[int, int], str]
"""Text in place of characters, by the first and the one behind the last."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Turns:
    """A loop to be written turn by turn."""

    start: int
    end: int
    body: tuple[int, int]
    """The text of a turn."""
    before: tuple[str, ...]
    """Text in front of each turn."""
    after: str
    """Text behind the last one."""
    named: tuple[Named, ...] = ()
    """For each turn, what stands in place of its counter; empty where that is still set."""
    labels: Mapping[str, tuple[tuple[int, int], ...]] = field(default_factory=dict[str, tuple[tuple[int, int], ...]])
    """Labels of the body, each with all places that name it there: they get names of their own in each turn."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Repeated:
    """A routine of which some calls get a copy of their own."""

    source: Source
    at: int
    """Place of the copies."""
    before: str
    """Text in front of each."""
    span: tuple[int, int]
    """Its text."""
    name: tuple[int, int]
    """Place of its name there."""
    calls: tuple[tuple[Source, tuple[int, int]], ...] = ()
    """Places at which these calls name it."""


@dataclass(frozen=True, eq=False, kw_only=True)
class _Plan:
    """What is written out in one file."""

    fresh: FreshNames
    turns: list[Turns] = field(default_factory=list[Turns])
    copies: list[tuple[Repeated, str]] = field(default_factory=list[tuple[Repeated, str]])
    """Each under another name."""
    named: dict[tuple[int, int], str] = field(default_factory=dict[tuple[int, int], str])


def written_out(
    sources: Sequence[Source],
    turns: Iterable[tuple[Source, Turns]],
    repeated: Iterable[Repeated],
    fresh: FreshNames,
) -> tuple[Source, ...] | None:
    """Files with loops written turn by turn, or where there are none with copies of routines; None where nothing can be.

    A file that would get too long stays as it is; routines get copies in all files or in none.
    """
    plans = {source.path: _Plan(fresh=fresh) for source in sources}
    for source, loop in turns:
        plans[source.path].turns.append(loop)
    together = not any(plan.turns for plan in plans.values())
    for one in repeated if together else ():
        for source, place in one.calls:
            new = fresh.like(one.source.text[slice(*one.name)])
            plans[source.path].named[place] = new
            plans[one.source.path].copies.append((one, new))
    new = [_written_out(source, plans[source.path]) for source in sources]
    if None in new and together:
        return None
    kept = tuple(old if made is None else made for old, made in zip(sources, new, strict=True))
    return None if all(a is b for a, b in zip(kept, sources, strict=True)) else kept


def _written_out(source: Source, plan: _Plan) -> Source | None:
    """The file with loops and copies written out, each line counted as the one that it comes from; None where it gets too long."""
    if not (plan.turns or plan.copies or plan.named):
        return source
    writer = _TextWriter(source=source, plan=plan)
    writer.write(0, len(source.text), plan.named)
    if writer.fresh:  # what is behind the last line end
        writer.lines.append(source.line(len(source.text)))
    if len(writer.lines) > source.text.count("\n") + 1 + MAX_NEW_LINES:
        return None
    return replace(source, text="".join(writer.parts), lines=tuple(writer.lines))


@dataclass(eq=False, kw_only=True)
class _TextWriter:
    source: Source
    plan: _Plan
    parts: list[str] = field(default_factory=list[str])
    lines: list[int] = field(default_factory=list[int])
    fresh: bool = True
    """The next character begins a line."""

    def write(self, start: int, end: int, named: Named) -> None:
        inside: list[tuple[int, int, str | Turns | tuple[Repeated, str]]] = [
            (*span, text) for span, text in named.items()
        ]
        inside += [(one.start, one.end, one) for one in self.plan.turns]
        if (start, end) == (0, len(self.source.text)):  # copies are not copied again
            inside += [(one.at, one.at, (one, name)) for one, name in self.plan.copies]
        inside = [one for one in inside if start <= one[0] and one[1] <= end]
        at = start
        for first, behind, what in sorted(inside, key=lambda one: (one[0], -one[1])):
            if first < at or len(self.lines) > len(self.source.text) + MAX_NEW_LINES:
                continue  # inside a loop that is written already
            self._put(self.source.text[at:first], at)
            at = behind
            match what:
                case str():
                    self._put(what, first, inserted=True)
                case (copied, name):
                    self._put(copied.before, first, inserted=True)
                    self.write(*copied.span, {**named, copied.name: name})
                case Turns():
                    for k, text in enumerate(what.before):
                        self._put(text, first, inserted=True)
                        self.write(*what.body, {**named, **(what.named[k] if what.named else {}), **self._labels(what)})
                    self._put(what.after, first, inserted=True)
        self._put(self.source.text[at:end], at)

    def _labels(self, turns: Turns) -> Named:
        names = {label: self.plan.fresh.like(label) for label in turns.labels}
        return {place: names[label] for label, places in turns.labels.items() for place in places}

    def _put(self, text: str, at: int, *, inserted: bool = False) -> None:
        if not text:
            return
        if self.fresh:
            self.lines.append(self.source.line(at))
        ends = [match.end() for match in re.finditer("\n", text)]
        self.fresh = bool(ends) and ends[-1] == len(text)
        self.lines += [self.source.line(at if inserted else at + end) for end in ends if end < len(text)]
        self.parts.append(text)


def loops_to_write(
    nodes: Block, turns: Mapping[Loop, tuple[float, ...] | None], is_shared: Callable[[Any], bool],
    counts: Callable[[Loop], bool],
) -> Iterator[tuple[Loop, tuple[float, ...]]]:  # fmt: skip
    """Loops of known turns around some lines: the innermost, and those around it whose turns differ.

    Args:
        nodes: of a routine.
        turns: see `Flow.turns`.
        is_shared: whether a line is one of those.
        counts: whether the turns of a loop differ by its own counter.
    """
    for node in nodes:
        for body in bodies_of(node):
            inner = list(loops_to_write(body, turns, is_shared, counts))
            yield from inner
            if not isinstance(node, Loop) or not any(map(is_shared, lines_in(body))):
                continue
            taken = turns.get(node)
            if taken and len(taken) > 1 and not leaves_loop(body) and (not inner or counts(node)):
                yield node, taken


# Targets of loops in arrays.

MAX_DIMENSIONS = 3
"""Of an array, in RAPID and in KRL."""

SAME_POSE = 2e-6
"""Poses that differ by no more, metres and parts of a rotation matrix, are the same as written with the digits of programs."""


@dataclass(frozen=True, eq=False, kw_only=True)
class TargetArray:
    """Motions of one text in counted loops, of which each has the target of another turn."""

    numbers: tuple[int, ...]
    """Of the motions, in the order of the turns."""
    counters: tuple[str, ...]
    """Of the loops, from the outermost on."""
    turns: tuple[tuple[float, ...], ...]
    """Values of each counter, evenly spaced."""

    @property
    def size(self) -> tuple[int, ...]:
        """Of the array."""
        return tuple(map(len, self.turns))

    def index(self, divided: str) -> str:
        """The element of a turn by the counters, each from 1 on.

        Args:
            divided: the operator of whole quotients.
        """
        return ",".join(_counted(*one, divided) for one in zip(self.counters, self.turns, strict=True))


def _counted(counter: str, taken: Sequence[float], divided: str) -> str:
    first, step = int(taken[0]), int(taken[1] - taken[0]) if len(taken) > 1 else 1
    if step == 1:
        return counter if first == 1 else f"{counter}{1 - first:+d}"
    if step == -1:
        return f"{first + 1}-{counter}"
    if step < 0:
        return f"({first}-{counter}){divided}{-step}+1"
    return f"({counter}{-first:+d}){divided}{step}+1" if first else f"{counter}{divided}{step}+1"


def tables(
    nodes: Block,
    own: Callable[[Any], Sequence[int]],
    turns: Mapping[Loop, tuple[float, ...] | None],
    counter: Callable[[Loop], str],
) -> Iterator[TargetArray]:
    """Texts of motions in counted loops that have as many targets as these have turns.

    Args:
        nodes: of a routine.
        own: numbers of the motions of a line whose targets an array may hold; none of other lines.
        turns: see `Flow.begun`.
        counter: name of a loop's counter; empty without one.
    """
    for line, around in _loops_around(nodes):
        numbers = tuple(own(line))
        for first in range(len(around)) if len(numbers) > 1 else ():  # a motion may depend on the inner ones alone
            loops = around[first:]
            taken, counters = tuple(turns.get(loop) or () for loop in loops), tuple(map(counter, loops))
            if (
                len(numbers) == math.prod(map(len, taken))
                and all(counters)
                and len({one.lower() for one in counters}) == len(counters) <= MAX_DIMENSIONS
                and all(map(_evenly_spaced, taken))
            ):
                yield TargetArray(numbers=numbers, counters=counters, turns=taken)
                break


def _loops_around(nodes: Block, around: tuple[Loop, ...] = ()) -> Iterator[tuple[Any, tuple[Loop, ...]]]:
    """Lines of a routine that are steps, each with the loops around it from the outermost on."""
    for node in nodes:
        if isinstance(node, FlowStep):
            yield node.line, around
        for body in bodies_of(node):
            yield from _loops_around(body, (*around, node) if isinstance(node, Loop) else around)


def _evenly_spaced(taken: Sequence[float]) -> bool:
    steps = {after - before for before, after in pairwise(taken)}
    return all(count == int(count) for count in taken) and len(steps) <= 1 and 0.0 not in steps


def of_whole_paths(
    found: Sequence[TargetArray], stuck: Collection[int], visits: Iterable[TargetVisit]
) -> list[TargetArray]:
    """Tables whose motions can be corrected with all others that go to their targets.

    Args:
        found: for all texts that can have one.
        stuck: numbers of motions that stay without one.
        visits: of the program.
    """
    visits = tuple(visits)
    while True:
        freed = {number for one in found for number in one.numbers}
        stays = {v.target for v in visits if v.number is None or (v.number in stuck and v.number not in freed)}
        lost = {v.number for v in visits if v.target in stays}
        kept = [one for one in found if lost.isdisjoint(one.numbers)]
        if len(kept) == len(found):
            return kept
        found = kept


def with_texts(sources: Sequence[Source], named: Mapping[Path, Named], fresh: FreshNames) -> tuple[Source, ...] | None:
    """Files with other text in place of characters, lines counted as those that they come from; None where one gets too long."""
    made = [_written_out(one, _Plan(fresh=fresh, named=dict(named.get(one.path, {})))) for one in sources]
    return None if None in made else tuple(source for source in made if source is not None)


def same_motions(some: Sequence[Motion], others: Sequence[Motion]) -> bool:
    """Whether the motions of two texts of a program go to the same poses, in the same order."""
    return len(some) == len(others) and all(
        (a.place, a.kind, a.end.posture) == (b.place, b.kind, b.end.posture)
        and np.array_equal(a.external, b.external, equal_nan=True)
        and (a.end.T is None) == (b.end.T is None)
        and (a.end.T is None or b.end.T is None or bool(np.abs(a.end.T - b.end.T).max() < SAME_POSE))
        for a, b in zip(some, others, strict=True)
    )
