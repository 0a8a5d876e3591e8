"""Joints that overshoot the end of a move by their speed."""

import numpy as np

from taskcal.robot.catalogue import load_robot
from taskcal.robot.conditions import Conditions
from taskcal.robot.effects import Overshoot
from taskcal.robot.error_model import ErrorModel


def test_overshoot_is_a_share_of_the_farthest_move():
    """A joint overshoots by its share of the farthest move however far that is."""
    model = ErrorModel(load_robot("abb-irb6660-205-1.9")) + Overshoot()
    rng = np.random.default_rng(2)
    q = rng.uniform(-0.3, 0.3, (3, 6))
    move = np.array([[0.5, -1.0, 0.0, 0.25, 0.0, 0.0], [0.0, 0.0, 0.2, 0.0, -0.1, 0.2], [0.0] * 6])
    pace = np.array([[0.5, -1.0, 0.0, 0.25, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0, -0.5, 1.0], [0.0] * 6])
    x = np.zeros(len(model))
    x[-6:] = rng.normal(scale=1e-4, size=6)
    there = model.poses(q, x, Conditions(move=move))
    np.testing.assert_allclose(there, model.poses(q + pace * x[-6:]), atol=1e-6)
    np.testing.assert_allclose(model.poses(q, x, Conditions(move=2.0 * move)), there, atol=1e-14)
    np.testing.assert_array_equal(model.poses(q, x, Conditions(approach=np.sign(move))), model.poses(q))
