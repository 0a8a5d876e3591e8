"""Lost motion that is taken up little by little."""

import numpy as np

from taskcal_demo.true_robot import WIDTHS, lost_motion


def test_lost_motion_far_from_a_reversal_is_the_direction(robot):
    way = np.radians(np.array([0.0, 20.0, 40.0, 10.0]))[:, None] * np.ones(6)
    np.testing.assert_allclose(np.sign(lost_motion(robot, way))[1:, 0], [1.0, 1.0, -1.0])
    np.testing.assert_allclose(np.abs(lost_motion(robot, way)[1:, 0]), 1.0)


def test_lost_motion_is_gradual_and_independent_of_stops(robot):
    """Lost motion is taken up gradually and does not depend on intermediate stops."""
    turned = np.array([0.0, 0.5, 0.5 - 0.5 * WIDTHS[0], 0.5 - 3.0 * max(WIDTHS)])
    way = np.zeros((4, 6))
    way[:, 0] = turned
    state = lost_motion(robot, way)[:, 0]
    assert state[1] == 1.0
    assert 0.0 < state[2] < 1.0
    assert state[3] == -1.0
    finer = np.zeros((301, 6))
    finer[:, 0] = np.interp(np.linspace(0.0, 3.0, 301), np.arange(4.0), turned)
    np.testing.assert_allclose(lost_motion(robot, finer)[::100, 0], state, atol=1e-12)
