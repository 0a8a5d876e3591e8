"""What is written for motions that are to end elsewhere: the one order of ways, from a number in its place to text of its own."""

import gc
from collections.abc import Callable, Container, Hashable, Mapping, Sequence, Set
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Generic, Protocol, TypeVar

import numpy as np

from robot_programs.core.program import Motion, Paths, Program, TargetVisit, Waypoint, Wrapping, keep_together
from robot_programs.core.robot import Robot
from robot_programs.core.source import Place, Source
from taskcal_groundwork.errors import InputError

MANY_MOTIONS = 10_000
"""Of so many, what was read again for its motions is given back at once: its syntax refers to itself, and takes as much memory as
all else."""

MAX_WRITING_OUT = 4
"""Loops, routines that are called in their turns, loops in those, and routines again: who writes a program nests no deeper."""

WRITTEN_OUT = "loops are written turn by turn, or routines once for each call"
TABLED = "targets of loops stand in arrays, an element for each turn"
"""How text for several motions got numbers for each of them."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Wanted:
    """What the motions of a program are to become."""

    program: Program
    robot: Robot
    """Whose joint positions decide the posture data that are written."""
    waypoints: Paths
    """By number of the motion."""
    refused: Mapping[int, str]
    """Motions that stay whatever the text allows, and why."""
    tolerance: float
    """How far a target may be off that goes with another one, metres."""

    def staying(self, of_text: Set[int], changing: Container[int]) -> Mapping[int, str]:
        """Motions that have to stay as well, and why.

        Args:
            of_text: numbers of those that stay because others have their text.
            changing: numbers of those that are to be written.
        """
        return {}


@dataclass(frozen=True, kw_only=True, slots=True)
class Conflict:
    """Why a motion stays as it is."""

    why: str
    of_text: bool = False
    """Others have its text, and need different numbers."""

    def __str__(self) -> str:
        return self.why


class Wrapper(Protocol):
    """Puts a function around the targets of motions; see `Program.wrap`."""

    def __call__(self, program: Program, rejected: Container[int], *, declared: bool) -> Wrapping:
        """The program with the function around targets that it does not tell, and those of some motions.

        Args:
            program: to be corrected.
            rejected: numbers of these motions.
            declared: whether it has the function already.
        """
        ...


W = TypeVar("W", bound=Wanted)


@dataclass(frozen=True, eq=False, kw_only=True)
class Plan(Generic[W]):
    """What is written, and what is left."""

    given: Program
    wanted: W
    """Of the text that is edited: the given one, or one that is written out of it."""
    written: Paths
    """By number of the motion."""
    left: Mapping[int, Conflict]
    """Motions that stay as they are."""
    eased: Mapping[int, float]
    """Motions whose numbers are others' as well, with the distance of the value for all of them from their own, metres."""
    ways: tuple[str, ...] = ()
    """How text for several motions got numbers for each of them, in the order in which it did."""
    wrappings: tuple[Wrapping, ...] = ()
    """Of motions that get a function, as their targets or text want it."""

    @property
    def of_text(self) -> frozenset[int]:
        """Motions that stay because others have their text."""
        return frozenset(i for i, conflict in self.left.items() if conflict.of_text)

    @cached_property
    def text(self) -> tuple[Source, ...]:
        """The files with the motions that are written, each line where it was in the text that is edited."""
        return self.wanted.program.rewrite(self.wanted.robot, self.written)

    @cached_property
    def motions(self) -> tuple[Motion, ...]:
        """Those of the text as it is read again, which were looked at.

        Raises:
            InputError: one is not where it should be.
        """
        program = self.wanted.program
        motions = program.reread(self.text).motions
        if len(motions) > MANY_MOTIONS:
            gc.collect()
        expect_written(program.motions, motions, self.written, self.wanted.tolerance)
        return motions

    @cached_property
    def files(self) -> tuple[Source, ...]:
        """The files with all that is written."""
        files = self.text
        for wrapping in self.wrappings:
            files = wrapping.completed(files)
        return files

    @property
    def added_lines(self) -> Mapping[Source, int]:
        """By how many lines the given files get longer."""
        after = {source.path: source.text.count("\n") for source in self.files}
        return {one: after[one.path] - one.text.count("\n") for one in self.given.sources if one.path in after}


def plan(
    program: Program,
    wanted: Callable[[Program], W],
    *,
    helper: Wrapper | None = None,
    told: Callable[[], None] = lambda: None,
) -> Plan[W]:
    """Choose how the motions of a program are written.

    Targets that the text does not tell get a function at run time, where there is one. Numbers of others are written in their
    place, in clones for those that need different ones, or into the motions; where one text of several motions needs different
    ones, all get the value of the least largest error, if that is within the tolerance; then such text is written out, as long as
    fewer motions are left by it; then targets of loops get arrays; then what is left gets the function.

    Args:
        program: the program.
        wanted: what its motions are to become; asked again for each text that is written out of it.
        helper: puts a function around the targets of motions.
        told: called when text was written out, before what becomes of it is planned again.
    """
    around = [] if helper is None else [helper(program, (), declared=False)]
    text = chosen = program if not around else around[0].program
    best, visits = _in_text(program, wanted(text)), None
    of_text, ways = best.of_text, list[str]()
    for _ in range(MAX_WRITING_OUT if of_text else 0):
        sources, way, given = text.written_out(of_text), WRITTEN_OUT, None
        if sources is None:  # an array does not tell which motions go to a place above which others
            way, given = TABLED, tuple(text.visits())
        again = text.tabled(of_text) if sources is None else text.reread(sources)
        if again is None:
            break
        ways.append(way)
        told()
        text = again
        found = _in_text(program, wanted(text), given)
        of_text = found.of_text
        if len(of_text) * len(best.wanted.program.motions) < len(best.of_text) * len(found.wanted.program.motions):
            best, chosen, visits = replace(found, ways=tuple(dict.fromkeys(ways))), text, given
        if not of_text or way == TABLED:
            break
    if helper is not None and best.of_text:
        around.append(helper(chosen, best.of_text, declared=bool(around[0].wrapped)))
        if around[-1].wrapped:
            asked = wanted(around[-1].program)
            visits = None if visits is None else _at_places(visits, asked.program)
            best = replace(_in_text(program, asked, visits), ways=best.ways)
    return replace(best, wrappings=tuple(around))


def _in_text(given: Program, wanted: W, visits: Sequence[TargetVisit] | None = None) -> Plan[W]:
    """What is written in a text as it is.

    Args:
        given: the program, of which the text is.
        wanted: what the motions of the text are to become.
        visits: of the text, where others count than it says.
    """
    program, robot, tolerance = wanted.program, wanted.robot, wanted.tolerance
    visits = tuple(program.visits()) if visits is None else visits
    left = {i: Conflict(why=why) for i, why in wanted.refused.items()}
    waypoints, of_text, eased = dict(wanted.waypoints), set[int](), dict[int, tuple[Waypoint, ...]]()
    while True:
        more = program.unwritable(robot, waypoints, tolerance)
        if more and not of_text and not eased:
            eased = program.least_worst(robot, waypoints, more, tolerance)
            waypoints |= eased
            more = program.unwritable(robot, waypoints, tolerance) if eased else more
        of_text.update(more)
        more = more or keep_together(visits, left, waypoints) or wanted.staying(of_text & left.keys(), waypoints)
        if not more:
            break
        left |= {i: Conflict(why=why, of_text=i in of_text) for i, why in more.items()}
        waypoints = {i: path for i, path in waypoints.items() if i not in more}
    off = {i: _distance(wanted.waypoints[i][0], eased[i][0]) for i in eased if i in waypoints}
    return Plan(given=given, wanted=wanted, written=waypoints, left=left, eased=off)


ROUNDING_M = 1e-5
"""Numbers are written to this at least, metres."""


def expect_written(before: Sequence[Motion], after: Sequence[Motion], written: Paths, tolerance: float) -> None:
    """See that motions lead where they should, as they are read again: what they share may have been changed for others.

    Args:
        before: of the text that was edited.
        after: of what was written.
        written: what was to be written, by number of the motion; all others stay.
        tolerance: how far a target may be off that goes with another one, metres.

    Raises:
        InputError: one does not.
    """
    wanted = [
        (waypoint.T, tolerance if i in written else 0.0)
        for i, motion in enumerate(before)
        for waypoint in written.get(i, (motion.own_waypoint(),))
    ]
    if len(after) != len(wanted):
        raise InputError(
            f"the program as written reads as {len(after)} motions instead of {len(wanted)}; nothing was written"
        )
    for motion, (T, within) in zip(after, wanted, strict=True):
        off = 0.0 if T is None or motion.end.T is None else float(np.linalg.norm(motion.end.T[:3, 3] - T[:3, 3]))
        if off > within + ROUNDING_M:
            raise InputError(
                f"{motion.place}: the program as written reads {off * 1e3:.3f} mm beside what it should say; nothing was written"
            )


def _distance(one: Waypoint, other: Waypoint) -> float:
    assert one.T is not None
    assert other.T is not None
    return float(np.linalg.norm(one.T[:3, 3] - other.T[:3, 3]))


def _at_places(visits: Sequence[TargetVisit], program: Program) -> list[TargetVisit]:
    """Visits by the motions of a program some of whose lines are none any longer, at the same places."""
    by_place: dict[Place, dict[Hashable, TargetVisit]] = {}
    for visit in visits:
        by_place.setdefault(visit.place, {})[visit.target] = visit
    return [
        replace(visit, number=i)
        for i, one in enumerate(program.motions)
        for visit in by_place.get(one.place, {}).values()
    ]
