"""Mobility of the mechanism, wherever its loop closes."""

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from taskcal.errors import RobotError
from taskcal.robot.catalogue import load_robot
from taskcal.robot.file import robot_from
from taskcal.robot.mechanism import analyse_mechanism
from tests.laws.robots import irb6660_description


def with_loop(crank, rod, rocker, arm=700.0):
    description = irb6660_description()
    lengths = {"crank_mm": crank, "rod_mm": rod, "rocker_mm": rocker, "arm_mm": arm}
    return robot_from({**description, "four_bar": {**description["four_bar"], **lengths}})


@pytest.mark.parametrize("lengths", [(500.0, 1300.0, 400.0), (200.0, 750.0, 600.0), (650.0, 900.0, 660.0, 100.0)])
def test_a_loop_that_does_not_close_at_home_has_the_mobility_of_any_other(lengths):
    found = analyse_mechanism(with_loop(*lengths))
    assert (found.mobility, found.overconstraint, found.loop_rank) == (6, 3, 3)


@given(st.tuples(*[st.floats(100.0, 1500.0)] * 4))
def test_a_loop_of_any_lengths_has_one_degree_of_freedom_or_is_refused(lengths):
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
