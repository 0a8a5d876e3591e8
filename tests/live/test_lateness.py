"""Points belong to the joints of their own stop, whatever the devices' clocks say and however late either of them is."""

import re
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from itertools import product

import numpy as np
import pytest

import taskcal as tc
from taskcal.live.devices import Controller, DeviceError, Instrument, JointReading, Shot
from taskcal.live.stillness import MissedError, Rules, Taken, Taker
from taskcal.live.virtual import VirtualCell
from taskcal_devices.network import DeviceClock

ROBOT = tc.load_robot("ur5")
NOISE_M, JOINT_NOISE = 1e-5, 2e-6
RIGHT_WITHIN_M = 1e-4
"""Ten times the noise; a point of another place is a centimetre off and more."""
JOINT_PERIOD_S, SHOT_PERIOD_S = 0.05, 0.1


@dataclass(kw_only=True)
class Side:
    """One device: how late what it measures arrives, and the clock of its stamps; without stamps arrival counts."""

    late_s: float = 0.0
    rate: float = 1.0
    offset_s: float = 0.0
    stamps: bool = True
    believed: bool = False
    """Whether the stamps are given as they are, as a connection of another package might."""
    called: str = ""
    jitter_s: float = 0.005
    clock: DeviceClock = field(init=False)

    def __post_init__(self) -> None:
        self.clock = DeviceClock(self.called)

    def time(self, measured_s: float, arrived_s: float) -> float:
        stamp_s = self.offset_s + self.rate * measured_s
        if self.believed:
            return stamp_s
        return self.clock.local(stamp_s, arrived_s) if self.stamps else arrived_s


@dataclass(kw_only=True)
class World:
    """A robot that goes from place to place, in simulated time, and what is sent of it; points wait until they are read."""

    rng: np.random.Generator
    joints: Side
    points: Side
    cell: VirtualCell = field(default_factory=lambda: VirtualCell.drawn(ROBOT, 3))
    now: float = 0.0

    def __post_init__(self) -> None:
        self.way_s, self.way = [-1e6], [self.cell.start]
        """When the robot is where, in between on a straight way."""
        self.arriving = self._arriving()
        self.next = next(self.arriving)

    def go(self, q: np.ndarray, motion_s: float, begin_s: float | None = None) -> None:
        begin = max(self.now, self.way_s[-1]) if begin_s is None else begin_s
        self.way_s += [begin, begin + motion_s]
        self.way += [self.way[-1], q]

    def at(self, when: float) -> np.ndarray:
        way = np.stack(self.way)
        return np.array([np.interp(when, self.way_s, way[:, k]) for k in range(way.shape[1])])

    def _arriving(self) -> Iterator[tuple[float, float]]:
        """When points were measured, and when they arrive, in order."""
        last, measured = 0.0, 0.0
        while True:
            measured += SHOT_PERIOD_S
            last = max(last, measured + self.points.late_s + self.rng.exponential(self.points.jitter_s))
            yield measured, last

    def reading(self) -> JointReading:
        self.now += JOINT_PERIOD_S + self.rng.exponential(self.joints.jitter_s)
        measured = self.now - self.joints.late_s - self.rng.exponential(self.joints.jitter_s)
        q = self.at(measured)
        time_s = self.joints.time(measured, self.now)
        return JointReading(time_s=time_s, joints=q + JOINT_NOISE * self.rng.normal(size=len(q)))

    def shot(self, timeout_s: float) -> Shot | None:
        measured, arrives = self.next
        if arrives > self.now + timeout_s:
            self.now += timeout_s
            return None
        self.now, self.next = max(self.now, arrives), next(self.arriving)
        point = self.cell.points(self.at(measured)[None])[0] + NOISE_M * self.rng.normal(size=3)
        return Shot(time_s=self.points.time(measured, arrives), point=point)

    def off(self, taken: Taken) -> float:
        """How far a row is from the truth, metres."""
        return float(np.linalg.norm(self.cell.points(taken.joints[None])[0] - taken.point))


class Joints(Controller):
    """Those of a world."""

    def __init__(self, world: World):
        self.world = world

    @classmethod
    def open(cls, address, robot, timeout_s):
        raise NotImplementedError

    def read(self, timeout_s: float) -> JointReading:
        return self.world.reading()

    def close(self) -> None:
        pass


class Points(Instrument):
    """Those of a world."""

    def __init__(self, world: World):
        self.world = world

    @classmethod
    def open(cls, address, timeout_s, columns=""):
        raise NotImplementedError

    def read(self, timeout_s: float) -> Shot | None:
        return self.world.shot(timeout_s)

    def close(self) -> None:
        pass


Joints.name, Points.name = "arm", "tracker"
BEGINNING = np.array([0.0, -1.5, 1.5, 0.0, 0.0, 0.0])


def world_of(seed: int, joints: Side, points: Side) -> World:
    return World(rng=np.random.default_rng(seed), joints=joints, points=points)


def jogged(world: World, rows: int) -> tuple[list[Taken], str]:
    """Rows of random poses to which a person goes, some by a stop on the way; and why there are no more."""
    taker = Taker(controller=Joints(world), instrument=Points(world), rules=Rules(wait_s=60.0))
    taken, rng = list[Taken](), world.rng
    for _ in range(rows):
        if rng.random() < 0.3:
            world.go(BEGINNING + rng.uniform(-1.0, 1.0, 6), rng.uniform(0.3, 2.0))
            world.go(world.way[-1], rng.uniform(0.0, 4.0))
        q = BEGINNING + rng.uniform(-1.0, 1.0, 6)
        world.go(q, rng.uniform(0.3, 6.0))
        try:
            taken.append(taker.take(q))
        except (MissedError, DeviceError) as error:
            return taken, str(error)
        world.now += rng.choice([0.0, 0.0, 6.0])  # a fit, in which nothing is read
    return taken, ""


def visited(world: World, dwell_s: float, poses: int, before_s: float = 3.0) -> list[Taken]:
    """Rows where a program stands, which does not wait for them."""
    rules = Rules(wait_s=2.0 * dwell_s, tries=1)
    taker, taken, rng = Taker(controller=Joints(world), instrument=Points(world), rules=rules), list[Taken](), world.rng
    world.go(world.way[-1], before_s)
    for _ in range(poses):
        world.go(BEGINNING + rng.uniform(-1.0, 1.0, 6), rng.uniform(0.5, 1.5))
        world.go(world.way[-1], dwell_s)
    while world.now < world.way_s[-1] - 0.5 * dwell_s:
        try:
            taken.append(taker.take(None, after=taken[-1].joints if taken else None))
        except MissedError:
            continue
    return taken


LATE_S = (0.0, 0.5, 3.0)


def both(joints: dict, points: dict) -> tuple[Side, Side]:
    """Sides with these properties; the points' clock is that of another day."""
    return Side(called="the arm", **joints), Side(**{"called": "the tracker", "offset_s": 1e5, **points})


@pytest.mark.parametrize(("joints_s", "points_s"), list(product(LATE_S, LATE_S)))
def test_late_devices_cost_time_and_no_wrong_row(joints_s: float, points_s: float) -> None:
    """Whichever is late, with stamps or without, every pose gets its row, and every row is of its pose."""
    for seed in range(2):
        stamps = seed % 2 == 0
        sides = both({"late_s": joints_s, "stamps": stamps}, {"late_s": points_s, "stamps": stamps})
        world = world_of(seed, *sides)
        taken, reason = jogged(world, 7)
        assert (len(taken), reason) == (7, "")
        assert max(map(world.off, taken)) < RIGHT_WITHIN_M


@pytest.mark.long
@pytest.mark.parametrize("points_s", LATE_S)
@pytest.mark.parametrize("joints_s", LATE_S)
def test_a_program_that_does_not_wait_leaves_poses_out_and_none_is_wrong(joints_s: float, points_s: float) -> None:
    """Whatever the time of a stop is beside the lateness, also where it is as long as both motion and stop."""
    for seed, dwell_s in enumerate((2.0, 3.0, 4.0, 7.0, 8.0)):
        world = world_of(seed, *both({"late_s": joints_s}, {"late_s": points_s}))
        assert max(map(world.off, visited(world, dwell_s, 6)), default=0.0) < RIGHT_WITHIN_M


@pytest.mark.parametrize("dwell_s", [2.0, 5.0, 8.0])
def test_a_program_loses_no_pose_once_both_have_stood(dwell_s: float) -> None:
    """Where the robot stood before the program, its short stops are enough; a row each, and one before."""
    world = world_of(1, *both({}, {}))
    assert len(visited(world, dwell_s, 6, before_s=7.0)) == 7


def test_a_program_whose_stops_are_too_short_from_the_first_on_says_so() -> None:
    world = world_of(1, *both({}, {}))
    world.go(BEGINNING, 1.0)
    world.go(BEGINNING, 3.0)
    world.go(BEGINNING + 0.5, 1.0)
    taker = Taker(controller=Joints(world), instrument=Points(world), rules=Rules(wait_s=60.0, tries=1))
    with pytest.raises(MissedError, match=r"have not stood together for 5\.0 s"):
        taker.take(None)


@pytest.mark.parametrize("rate", [0.6, 0.97, 1.03, 1.5])
@pytest.mark.parametrize("late_s", [0.0, 3.0])
@pytest.mark.parametrize("which", ["arm", "tracker"])
def test_a_clock_of_another_rate_is_refused_by_name(which: str, late_s: float, rate: float) -> None:
    """In the first rows, of which none is wrong."""
    for seed in range(2):
        own = {"rate": rate}
        joints, points = (own, {"late_s": late_s}) if which == "arm" else ({}, own | {"late_s": late_s})
        world = world_of(seed, *both(joints, points))
        taken, reason = jogged(world, 8)
        said = re.match(rf"the {which}: its time stamps advance by (\S+) s in each second", reason)
        assert said
        assert float(said[1]) == pytest.approx(rate, abs=0.01)
        assert len(taken) < 5
        assert max(map(world.off, taken), default=0.0) < RIGHT_WITHIN_M


@pytest.mark.parametrize(
    ("joints", "points"),
    [({"rate": rate}, {}) for rate in (0.6, 1.5)]
    + [({}, {"rate": rate}) for rate in (0.6, 1.5)]
    + [({}, {"offset_s": offset_s}) for offset_s in (-50.0, 50.0)],
)
def test_stamps_that_are_given_as_times_are_compared_with_the_other_devices(joints: dict, points: dict) -> None:
    """As a connection of another package might give them: no wrong row, and both devices are named."""
    for seed in range(2):
        sides = both(joints | {"believed": bool(joints)}, {"offset_s": 0.0, **points, "believed": bool(points)})
        world = world_of(seed, *sides)
        taken, reason = jogged(world, 8)
        assert "'arm'" in reason
        assert "'tracker'" in reason
        assert max(map(world.off, taken), default=0.0) < RIGHT_WITHIN_M


def test_points_that_stay_behind_are_asked_about() -> None:
    """As where the target is not on the tool, or one and the same point is sent again and again."""
    world = world_of(1, *both({}, {}))
    taker = Taker(controller=Joints(world), instrument=Points(world), rules=Rules())
    last = taker.take(None).point
    world.go(world.way[-1] + 0.5, 2.0)
    move, world.shot = world.shot, lambda timeout_s: (shot := move(timeout_s)) and replace(shot, point=last)
    with pytest.raises(MissedError, match=r"'tracker' do not follow the joints of the controller 'arm'.* the last row"):
        taker.take(world.way[-1])


class Written(Points):
    """Lines in a file, to which software adds one after another, or a person one at a time."""

    name, streams = "", False


Written.name = "file"


@pytest.mark.parametrize("late_s", LATE_S)
def test_lines_that_are_written_one_after_another_are_as_a_stream(late_s: float) -> None:
    world, off = world_of(2, *both({}, {"late_s": late_s, "stamps": False})), list[float]()
    taker = Taker(controller=Joints(world), instrument=Written(world), rules=Rules(shots=1))
    world.now = 10.0
    for _ in range(5):
        q = BEGINNING + world.rng.uniform(-1.0, 1.0, 6)
        world.go(q, world.rng.uniform(1.0, 3.0))
        off.append(world.off(taker.take(q)))
    assert max(off) < RIGHT_WITHIN_M


def test_a_line_of_the_last_pose_is_not_taken_for_this_one() -> None:
    """A person measured twice there, and the second line came when the robot had arrived here."""
    world = world_of(2, *both({}, {}))
    taker = Taker(controller=Joints(world), instrument=Written(world), rules=Rules(shots=1))
    first = taker.take(None)
    world.go(world.way[-1] + 0.5, 1.0)
    lines = [Shot(time_s=world.now + 3.0, point=first.point)]
    world.shot = lambda timeout_s: lines.pop() if lines and world.now > lines[0].time_s else None
    with pytest.raises(MissedError, match="where the last row was measured"):
        taker.take(world.way[-1])


@pytest.mark.parametrize("hz", [1.0, 5.0, 50.0, 250.0])
def test_delays_are_not_taken_for_a_rate(hz: float) -> None:
    """One message in ten is held back, all of some seconds are, and clocks differ by hundreds of ppm: no false alarm."""
    for seed in range(12):
        rng, clock, last, held = np.random.default_rng(seed), DeviceClock("the arm"), 0.0, 0.0
        rate = 1.0 + 3e-4 * (seed % 3 - 1)
        for k in range(int(100.0 * hz)):
            sent = k / hz
            delay = 0.002 + rng.exponential(0.05) + (0.5 * rng.random() if rng.random() < 0.1 else 0.0)
            held = sent + rng.uniform(0.0, 2.0) if rng.random() < 0.05 / hz else held
            last = max(last, sent + delay, held)
            clock.local(1e5 + rate * sent, last)
