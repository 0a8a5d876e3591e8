"""Lengths that grow with the temperature."""

import numpy as np
from hypothesis import given

from taskcal.robot.conditions import Conditions
from tests.laws.robots import Case, cases
from tests.robot.effects.warm_robots import thermal


@given(cases())
def test_thermal_is_nothing_at_the_reference(case: Case):
    """At the reference temperature and without one the robot is as it was."""
    model = thermal(case.model)
    x = np.concatenate([case.x, np.full(7, 1e-4)])
    plain = case.model.poses(case.q, case.x)
    unknown = np.full(len(case.q), np.nan)
    for conditions in (None, Conditions(), *(Conditions(temperature=t) for t in (unknown, np.full(len(case.q), 21.0)))):
        np.testing.assert_allclose(model.poses(case.q, x, conditions), plain, atol=1e-12)
    by_joint = case.model.joint_jacobian(case.q, case.x)
    np.testing.assert_allclose(model.joint_jacobian(case.q, x), by_joint, atol=1e-9)
