"""Mobility of the mechanism, wherever its loop closes."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from taskcal.errors import RobotError
from taskcal.robot.catalogue import load_robot
from taskcal.robot.mechanism import LoopFreedom, analyse_mechanism, loop_screws, screw
from taskcal.robot.robot_file import robot_from
from tests.laws.robots import irb6660_description


def with_loop(crank, rod, rocker, arm=700.0):
    description = irb6660_description()
    lengths = {"crank_mm": crank, "rod_mm": rod, "rocker_mm": rocker, "arm_mm": arm}
    return robot_from({**description, "four_bar": {**description["four_bar"], **lengths}})


@pytest.mark.parametrize("lengths", [(500.0, 1300.0, 400.0), (200.0, 750.0, 600.0), (650.0, 900.0, 660.0, 100.0)])
def test_loop_open_at_home_has_the_same_mobility(lengths):
    """A loop that does not close at home has the mobility of any other."""
    found = analyse_mechanism(with_loop(*lengths))
    assert (found.mobility, found.overconstraint, found.loop_rank) == (6, 3, 3)


@given(st.tuples(*[st.floats(100.0, 1500.0)] * 4))
def test_any_loop_has_one_freedom_or_is_refused(lengths):
    """A loop of any lengths has one degree of freedom or is refused."""
    longest = max(lengths)
    # within a millimetre of a stretched loop there is hardly an angle at which it closes
    assume(abs(2.0 * longest - sum(lengths)) > 1.0)
    robot = with_loop(*lengths)
    if 2.0 * longest > sum(lengths):
        with pytest.raises(RobotError, match=r"closes at no angle.*check the four lengths"):
            analyse_mechanism(robot)
    else:
        assert analyse_mechanism(robot).mobility == 6


def test_an_open_chain_is_not_overconstrained():
    found = analyse_mechanism(load_robot("ur5"))
    assert (found.mobility, found.overconstraint, found.loops, found.bodies) == (6, 0, 0, 7)


def test_a_parallelogram_fixes_two_orientations_and_one_position():
    found = analyse_mechanism(load_robot("abb-irb6660-205-1.9"))
    assert (found.fixed_orientations, found.fixed_positions) == (2, 1)
    assert "2 relative rotations and 1 relative translation" in found.explanation


@pytest.mark.parametrize("lengths", [(500.0, 700.0, 500.0), (500.0, 1300.0, 400.0), (200.0, 750.0, 600.0)])
def test_the_screws_stand_where_the_loop_closes(lengths):
    robot = with_loop(*lengths)
    screws = loop_screws(robot, robot.four_bar)
    points = np.cross(screws[:3], screws[3:], axis=0).T
    ground, _, crank, rocker, elbow = points
    sides = [np.linalg.norm(side) for side in (crank - ground, rocker - crank, rocker - elbow, elbow - ground)]
    np.testing.assert_allclose(sides, np.array([*lengths, 700.0]) / 1e3, atol=1e-9)


@pytest.mark.parametrize(("twist", "overconstraint"), [(0.0, 3), (10.0, 2)])
def test_the_axes_are_those_of_the_robot_s_own_chain(twist, overconstraint):
    """An elbow that is not parallel to the shoulder takes the loop's mobility, which fixed parallel axes never showed."""
    description = irb6660_description()
    joints = [dict(joint) for joint in description["joint"]]
    joints[2]["steps"] = [*joints[2]["steps"], {"rx_deg": twist}]
    found = analyse_mechanism(robot_from({**description, "joint": joints}))
    assert found.overconstraint == overconstraint
    assert found.mobility == 3 + overconstraint


@given(st.integers(0, 2**32 - 1))
def test_closed_chains_of_known_overconstraint(seed):
    rng = np.random.default_rng(seed)
    z, points = np.array([0.0, 0.0, 1.0]), rng.normal(size=(7, 3))
    axes = rng.normal(size=(7, 3))
    axes /= np.linalg.norm(axes, axis=1)[:, None]
    planar = np.stack([screw(z, p - points[0]) for p in points[:4]], axis=1)
    spherical = np.stack([screw(a, np.zeros(3)) for a in axes[:4]], axis=1)
    general = np.stack([screw(a, p) for a, p in zip(axes, points, strict=True)], axis=1)
    chains = [LoopFreedom.of(screws) for screws in (planar, spherical, general)]
    assert [chain.overconstraint for chain in chains] == [3, 3, 0]
    assert [(c.fixed_orientations, c.fixed_positions) for c in chains] == [(2, 1), (0, 3), (0, 0)]
