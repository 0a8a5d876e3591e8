"""The rule of sharing, on random programs: points stated, shifted and given by calls, some of whose numbers others read, too."""

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest

from robot_programs import Frame, Motion, Source, Target
from robot_programs.core.program import Waypoint
from robot_programs.core.robot import NO_ROBOT
from robot_programs.core.sharing import SharingProgram, Spelling, Use
from robot_programs.core.source import Place
from robot_programs.core.values import Origin

TOLERANCE_M = 1e-3
FRAME = Frame(name="", T=np.eye(4))


def at(x: float) -> np.ndarray:
    T = np.eye(4)
    T[0, 3] = x
    return T


@dataclass(frozen=True, kw_only=True)
class Point:
    """Where a motion goes: to what its line, or a call, names or shifts."""

    slot: int
    line: int
    call: int | None = None
    shift: float = 0.0
    alone: bool = True
    """Its line is for it alone."""


@dataclass(eq=False, kw_only=True)
class Spelled(Spelling[float]):
    """What becomes of places, calls and lines; numbers are the positions in x."""

    program: "Made"
    slots: dict[int, float] = field(default_factory=dict[int, float])
    texts: dict[Any, float] = field(default_factory=dict[Any, float])

    def alike(self, one, other):
        return abs(one - other) < 1e-9

    def reader(self, slot, texts):
        calls = {self.program.call(point) for point in self.program.points if point.slot == slot.owner}
        locked = any(text in texts for text in self.program.locked_calls)
        return "another line" if slot.owner in self.program.locked or locked or calls - {None} - texts else ""

    def obstacle(self, use):
        return "what the call gives it is read" if use.text in self.program.locked_calls else ""

    def in_place(self, use):
        self.slots[use.slot.owner] = use.poses[0](use.T[1])[0, 3] if use.follows else use.wanted

    def own(self, use):
        self.texts[use.text] = use.wanted
        return ""

    def insert(self, number, path):
        raise AssertionError

    def result(self):
        return (self,)


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class Made(SharingProgram):
    LANGUAGE: ClassVar = "Made"
    points: tuple[Point, ...]
    values: tuple[float, ...]
    locked: frozenset[int]
    """Places that others read."""
    locked_calls: frozenset[tuple[int, int, int]]

    def call(self, point):
        return None if point.call is None else (0, 1000 + 10 * point.call, 1005 + 10 * point.call)

    def line(self, point):
        return (0, 10 * point.line, 10 * point.line + 5)

    def spelling(self, robot, waypoints):
        uses = []
        for number, (point, move) in enumerate(zip(self.points, self.motions, strict=True)):
            T = move.end.T, waypoints[number][-1].T if number in waypoints else move.end.T
            use = Use(
                motion=number, text=self.call(point) or self.line(point), slot=Origin(at=(0, 0, 1), owner=point.slot),
                numbers=T[0][0, 3], wanted=T[1][0, 3], T=T, follows=point.shift != 0.0, given=point.call is not None,
                poses=(lambda T, by=point.shift: T @ at(-by), lambda T, by=point.shift: T @ at(by)),
            )  # fmt: skip
            if point.call is not None and point.alone:
                use = replace(use, instead=replace(use, text=self.line(point), slot=None, given=False))
            uses.append(use)
        return Spelled(sources=self.sources, program=self, uses=uses)

    def reached(self, slots, texts):
        """Where each motion goes with what was written."""
        for point in self.points:
            own = texts.get(self.line(point))
            given = texts.get(self.call(point), slots.get(point.slot, self.values[point.slot]))
            yield given + point.shift if own is None else own


def made(rng: np.random.Generator) -> Made:
    """Places that lines name, that a line shifts in turns, or that routines of one or two lines are given, one of them shifted."""
    values, points = tuple(rng.uniform(-1, 1, 3)), list[Point]()
    for line in range(0, int(rng.integers(2, 9)), 2):
        slot = int(rng.integers(3))
        match rng.integers(4):
            case 0:
                points.append(Point(slot=slot, line=line))
            case 1:
                points += [Point(slot=slot, line=line, shift=0.1 * k, alone=False) for k in (1, 2)]
            case _:
                calls = int(rng.integers(1, 3))
                for call in range(calls):
                    slot = int(rng.integers(3))
                    shift = float(rng.choice([0.0, 0.1]) if calls > 1 else 0.0)
                    points.append(Point(slot=slot, line=line, call=line + call, alone=calls == 1))
                    points.append(Point(slot=slot, line=line + 1, call=line + call, alone=calls == 1, shift=shift))
    place = Place(path=Path("a"), line=1)
    ends = [at(values[point.slot] + point.shift) for point in points]
    lines = [point.line for point in points]
    motions = [
        Motion(
            kind="linear", end=Target(name="", T=T, q=None, posture=None, place=place), tool=FRAME, part=FRAME, stops=True,
            place=place, texts_motions=lines.count(line),
        )
        for T, line in zip(ends, lines, strict=True)
    ]  # fmt: skip
    program = Made(
        sources=(Source(path=Path("a"), text="\n" * 3000, encoding="utf-8"),), motions=tuple(motions), diagnostics=(),
        points=tuple(points), values=values, locked=frozenset(np.flatnonzero(rng.random(3) < 0.2).tolist()),
        locked_calls=frozenset(),
    )  # fmt: skip
    calls = dict.fromkeys(program.call(point) for point in points if point.call is not None)
    return replace(program, locked_calls=frozenset(call for call in calls if rng.random() < 0.2))


@pytest.mark.parametrize("seed", range(200))
def test_each_motion_ends_where_it_should_or_stays(seed):
    """And all that others read stays; what a line is alone with is written always."""
    rng = np.random.default_rng(seed)
    program, paths = made(rng), {}
    by, near = rng.choice([2e-2, 3e-2], 3), rng.choice([0.0, 5e-4, 5e-3])
    for number, (move, point) in enumerate(zip(program.motions, program.points, strict=True)):
        if rng.random() < 0.8:
            T = move.end.T @ at(rng.choice([by[point.slot], 1e-2], p=[0.8, 0.2]) + near * (point.shift != 0.0))
            paths[number] = (Waypoint(kind="linear", q=np.zeros(6), T=T),)
    left = program.unwritable(NO_ROBOT, paths, TOLERANCE_M)
    written = {number: path for number, path in paths.items() if number not in left}
    (found,) = program.rewrite(NO_ROBOT, written)
    for number, x in enumerate(program.reached(found.slots, found.texts)):
        move, point = program.motions[number], program.points[number]
        wanted = (written[number][0].T if number in written else move.end.T)[0, 3]
        follows = number in written and point.shift != 0.0
        assert x == pytest.approx(wanted, abs=TOLERANCE_M if follows else 1e-7), point
        assert not (point.alone and number in left), point
    assert found.slots.keys().isdisjoint(program.locked)
    for point in program.points:
        if program.call(point) in program.locked_calls:
            assert program.call(point) not in found.texts
            assert point.slot not in found.slots
