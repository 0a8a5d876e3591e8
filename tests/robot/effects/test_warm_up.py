"""Lengths that grow while a robot warms up."""

import numpy as np
import pytest

from taskcal.robot.catalogue import load_robot
from taskcal.robot.conditions import Conditions
from taskcal.robot.effects import WarmUp
from taskcal.robot.error_model import ErrorModel
from tests.robot.effects.warm_robots import positions, with_value


@pytest.mark.parametrize(("reference", "cold"), [(None, -1.0), (1800.0, np.exp(-1.0) - 1.0), (0.0, 0.0)])
def test_a_robot_warms_up_by_an_exponential_of_its_time_at_work(reference, cold):
    """Parameters are what a robot grows from cold to warm; at the reference, and without a time, they are zero."""
    plain = ErrorModel(load_robot("ur5"))
    model, q = plain + WarmUp(time_constant=1800.0, reference=reference), positions(plain)
    x = with_value(model, thermal__expansion=3e-4)
    time = np.array([0.0, 600.0, 1800.0, 7200.0, 1e6, np.nan])
    rise = np.append(cold + 1.0 - np.exp(-time[:5] / 1800.0), 0.0)
    expected = plain.poses(q)
    expected[:, :3, 3] *= (1.0 + 3e-4 * rise)[:, None]
    np.testing.assert_allclose(model.poses(q, x, Conditions(time=time)), expected, atol=1e-12)
    for conditions in (None, Conditions(temperature=np.full(6, 80.0))):
        np.testing.assert_array_equal(model.poses(q, x, conditions), model.poses(q))
