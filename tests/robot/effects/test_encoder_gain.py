"""A scale error of an encoder is a joint that turns by a share more."""

import numpy as np
from hypothesis import given

from taskcal.robot.catalogue import load_robot
from taskcal.robot.effects import EncoderGain
from taskcal.robot.error_model import ErrorModel
from tests.laws.robots import generators

UR5 = load_robot("ur5")


@given(generators)
def test_a_joint_turns_a_share_more_than_the_controller_says(rng: np.random.Generator) -> None:
    nominal = ErrorModel(UR5)
    model = nominal + EncoderGain()
    q, gain = rng.uniform(-1.0, 1.0, (3, 6)), 1e-3 * rng.normal(size=6)
    x = np.concatenate([np.zeros(len(nominal)), gain])
    np.testing.assert_allclose(model.poses(q, x), nominal.poses(q * (1.0 + gain)), atol=1e-12)
