"""Effects on robots of every structure: both Jacobians against differences of the poses, of the fourth order."""

import numpy as np
from hypothesis import given, settings

from taskcal.robot.effects import EncoderGain, Harmonics
from taskcal.robot.effects.gears import JointField
from tests.laws import plain
from tests.laws.robots import Case, cases, generators

STEP = 1e-3
"""Leaves some 10⁻¹² of the fifth derivative, and of rounding 10⁻¹³."""


def slopes(poses, count):
    """∂T/∂ of each of so many numbers, from the poses at steps from where one is: (n, 4, 4, count)."""
    out = []
    for k in range(count):
        far, near = ([poses(sign * size * STEP * np.eye(count)[k]) for sign in (1, -1)] for size in (2, 1))
        out.append((8.0 * (near[0] - near[1]) - (far[0] - far[1])) / (12.0 * STEP))
    return np.stack(out, axis=-1)


@settings(max_examples=4)
@given(cases(poses=2), generators)
def test_jacobians_with_effects_are_the_derivatives(case: Case, rng: np.random.Generator):
    """Both jacobians are the derivatives with effects beside large defects."""
    model = case.model + EncoderGain() + Harmonics(orders=(1, 3)) + JointField(features=2)
    x = np.concatenate([case.x, 0.05 * rng.normal(size=len(model) - len(case.x))])
    T = model.poses(case.q, x)
    by_parameter = slopes(lambda step: model.poses(case.q, x + step), len(model))
    by_joint = slopes(lambda step: model.poses(case.q + step, x), case.q.shape[1])
    for found, expected in ((model.jacobian(case.q, x), by_parameter), (model.joint_jacobian(case.q, x), by_joint)):
        for row in range(len(T)):
            twists = plain.twists(T[row], expected[row])
            np.testing.assert_allclose(found[row], twists, rtol=0.0, atol=1e-8 * (1.0 + np.abs(twists).max()))
