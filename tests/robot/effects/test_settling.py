"""Joints that keep a rest of the last move."""

import numpy as np

from taskcal.robot.catalogue import load_robot
from taskcal.robot.conditions import Conditions
from taskcal.robot.effects import Settling
from taskcal.robot.error_model import ErrorModel


def test_a_rest_of_the_move_is_in_proportion_to_it():
    model = ErrorModel(load_robot("abb-irb6660-205-1.9")) + Settling()
    rng = np.random.default_rng(2)
    q, move = rng.uniform(-0.3, 0.3, (10, 6)), rng.normal(size=(10, 6))
    x = np.zeros(len(model))
    x[-6:] = rng.normal(scale=1e-4, size=6)
    np.testing.assert_allclose(model.poses(q, x, Conditions(move=move)), model.poses(q + move * x[-6:]), atol=1e-6)
    np.testing.assert_array_equal(model.poses(q, x, Conditions(approach=np.sign(move))), model.poses(q))
