"""When a row is taken: only while both stand, averaged over the standstill; times are simulated."""

from collections.abc import Iterator

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import taskcal as tc
from taskcal.live.devices import JointReading, Shot
from taskcal.live.stillness import MissedError, Rules, StoppedError, Taker, scatter_of, stands
from taskcal.live.virtual import VirtualController, VirtualTracker

RULES = Rules(wait_s=20.0)
POSE = np.array([0.3, -1.2, 1.1, -1.3, 0.4, 0.1])


def _readings(speed: float, noise: float, period: float, seed: int) -> list[JointReading]:
    """A joint that moves at a constant speed, as a controller with an encoder's noise states it."""
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, 2.0, period)
    return [JointReading(time_s=s, joints=np.array([speed * s + noise * rng.normal()])) for s in t]


@given(st.floats(-1.0, 1.0), st.sampled_from([0.01, 0.05, 0.2]), st.integers(0, 50))
@settings(max_examples=40, deadline=None)
def test_stands_below_its_speed_and_not_above(part: float, period: float, seed: int) -> None:
    """Half the speed stands, twice the speed does not, with an encoder's noise."""
    slow = _readings(0.5 * part * RULES.max_speed, 1e-6, period, seed)
    fast = _readings(np.copysign(2.0 + abs(part), part) * RULES.max_speed, 1e-6, period, seed)
    assert stands(slow, RULES)
    assert not stands(fast, RULES)
    assert not stands(slow[:1], RULES)  # too short to tell
    short = [one for one in slow if one.time_s < 0.8 * RULES.settle_s]
    assert not stands(short, RULES)


def test_a_joint_that_went_and_came_back_does_not_stand() -> None:
    """A bump in the window has no slope, and yet is a motion; so is what the controller calls one."""
    still = _readings(0.0, 0.0, 0.05, 0)
    bumped = [
        JointReading(time_s=one.time_s, joints=one.joints + 1e-3 * (abs(one.time_s - 1.5) < 0.1)) for one in still
    ]
    assert stands(still, RULES)
    assert not stands(bumped, RULES)
    assert not stands([*still[:-1], JointReading(time_s=1.95, joints=np.zeros(1), moving=True)], RULES)


@pytest.fixture
def taker() -> Iterator[Taker]:
    """A virtual robot and its tracker."""
    with (
        VirtualController.open("3", tc.load_robot("ur5"), 1.0) as controller,
        VirtualTracker.open(None, 1.0) as tracker,
    ):
        yield Taker(controller=controller, instrument=tracker, rules=RULES)


def test_a_row_is_the_truth_at_the_joints_that_were_read(taker: Taker) -> None:
    """Beams that are lost and shots on the way do not count: the mean is within the tracker's noise of the true point."""
    assert isinstance(taker.controller, VirtualController)
    cell = taker.controller.cell
    cell.lost = 0.1
    off, far = [], []
    for k in range(8):
        taker.controller.show(POSE + 0.1 * k)
        taken = taker.take(POSE + 0.1 * k)
        off.append(np.linalg.norm(taken.point - cell.points(taken.joints[None])[0]))
        far.append(np.abs(taken.joints - POSE - 0.1 * k).max())
        assert 0.0 < taken.scatter <= RULES.max_scatter_m
    assert max(off) < 8e-5  # four standard deviations of the mean of three shots
    assert 1e-4 < max(far) < RULES.arrived  # the person does not stop exactly at the pose: joints are read


def test_missed_rows_name_what_is_missing(taker: Taker) -> None:
    """A robot that does not arrive, and a beam that stays lost, are missed after a time; who asks to stop is heard."""
    assert isinstance(taker.controller, VirtualController)
    taker.controller.show(POSE)
    with pytest.raises(MissedError, match="does not stand"):
        taker.take(POSE + 0.2)
    taker.controller.cell.lost = 1.0
    with pytest.raises(MissedError, match="no valid shot"):
        taker.take(POSE)
    taker.stopped = lambda: True
    with pytest.raises(StoppedError):
        taker.take(POSE + 0.2)


def test_scatter_is_that_of_the_distribution() -> None:
    """Over many draws the mean square is the trace of the covariance, for any number of shots."""
    rng = np.random.default_rng(0)
    square = np.mean([scatter_of(rng.normal(size=(3, 3))) ** 2 for _ in range(4000)])
    assert square == pytest.approx(3.0, rel=0.05)
    assert scatter_of(np.ones((1, 3))) == 0.0
    assert not Shot(time_s=0.0, point=np.full(3, np.nan), reason="beam lost").valid


def test_shots_that_waited_while_the_robot_moved_take_no_time(taker: Taker) -> None:
    """A thousand of them are passed over before the joints are read again."""
    waiting = [Shot(time_s=-1.0, point=np.zeros(3))] * 1000
    fresh = taker.instrument.read
    taker.instrument.read = lambda timeout_s: waiting.pop() if waiting else fresh(timeout_s)
    assert taker.take(None).shots == RULES.shots
    assert not waiting
    assert taker.controller.cell.now < 10.0


def test_a_standstill_is_shown_while_an_instrument_takes_long(taker: Taker) -> None:
    """Each shot takes five seconds; the joints are read often enough in between."""
    cell, fresh, calls = taker.controller.cell, taker.instrument.read, [0.0]

    def read(timeout_s: float) -> Shot | None:
        calls[0] += timeout_s
        if calls[0] < 5.0:
            cell.now += timeout_s
            return None
        calls[0] = 0.0
        return fresh(timeout_s)

    taker.instrument.read = read
    assert taker.take(None).shots == RULES.shots


class Written(VirtualTracker):
    """A line that was measured on the way, and is there just after the robot has stopped; then others."""

    name = ""
    streams = False
    late = True

    def read(self, timeout_s: float) -> Shot | None:
        shot, self.late, late = super().read(timeout_s), False, self.late
        return Shot(time_s=self._cell.arrives + 0.1, point=np.zeros(3)) if late else shot


def test_a_line_that_is_late_is_no_shot_of_the_standstill(taker: Taker) -> None:
    assert isinstance(taker.controller, VirtualController)
    cell = taker.controller.cell
    taker.instrument = Written(cell)
    taker.controller.show(POSE)
    taken = taker.take(POSE)
    assert np.linalg.norm(taken.point - cell.points(taken.joints[None])[0]) < 1e-3
