import numpy as np
import pytest

from taskcal.robot.catalogue import load_robot
from taskcal.robot.conditions import Conditions
from taskcal.robot.effects import Backlash, Overshoot, Settling, effect_from
from taskcal.robot.error_model import ErrorModel
from tests.laws.robots import NAMED

B = 4e-4


def with_backlash(name: str, joint: int) -> tuple[ErrorModel, np.ndarray, np.ndarray]:
    """A model, positions, and parameters zero but for the backlash of one joint."""
    model = ErrorModel(load_robot(name)) + Backlash()
    limits = np.clip(model.robot.limits, -0.5, 0.5)
    q = np.random.default_rng(0).uniform(limits[:, 0], limits[:, 1], (10, len(limits)))
    x = np.zeros(len(model))
    x[model.names.index(f"{model.robot.joint_names[joint]}.backlash")] = B
    return model, q, x


def test_backlash_stops_on_either_side_of_the_middle():
    """From above and below a joint stops on either side of the middle."""
    model, q, x = with_backlash("ur5", 1)
    turned = np.eye(6)[1] * B
    for side in (1.0, -1.0):
        reached = model.poses(q, x, Conditions(approach=np.full(q.shape, side)))
        np.testing.assert_allclose(reached, model.poses(q + side * turned), atol=1e-14)
    np.testing.assert_array_equal(model.poses(q, x), model.poses(q))
    np.testing.assert_array_equal(model.poses(q, x, Conditions()), model.poses(q))


COUPLED = "fanuc-r2000ic-165f"


@pytest.mark.parametrize("name", NAMED)
def test_lost_motion_is_that_of_the_motor(name):
    """Behind a parallelogram too."""
    model, q, x = with_backlash(name, 2)
    approach = np.random.default_rng(1).choice([-1.0, 0.0, 1.0], q.shape)
    reached = model.poses(q, x, Conditions(approach=approach))
    turned = np.zeros_like(q)
    turned[:, 2] = B * approach[:, 2]
    np.testing.assert_allclose(reached, model.poses(q + turned), atol=1e-7)


def test_controller_coupling_moves_the_own_axis_alone():
    """The FANUC's third angle is −(J2 + J3): its second drive's lost motion is one of J2 that J3 takes back."""
    model, q, x = with_backlash(COUPLED, 1)
    turned = np.zeros_like(q)
    turned[:, 1], turned[:, 2] = B, -B
    reached = model.poses(q, x, Conditions(approach=np.ones_like(q)))
    np.testing.assert_allclose(reached, model.poses(q + turned), atol=1e-14)


def test_backlash_survives_its_description():
    assert effect_from(Overshoot(joints=("J2",)).to_json()) == Overshoot(joints=("J2",))
    assert effect_from(Settling(joints=("J1",)).to_json()) == Settling(joints=("J1",))
    assert effect_from(Backlash(joints=("J1", "J4")).to_json()) == Backlash(joints=("J1", "J4"))
