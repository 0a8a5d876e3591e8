"""Effects on the joint side: derivatives, load paths, and models that carry them."""

from dataclasses import replace

import numpy as np
import pytest

from taskcal.errors import TaskcalError, UnknownName
from taskcal.robot.catalogue import load_robot
from taskcal.robot.effects import Compliance, EncoderGain, Harmonics, effect_from
from taskcal.robot.error_model import ErrorModel
from tests.laws.robots import NAMED
from tests.robot.effects.dressed import BESIDE, dressed, positions

EFFECTS = [
    EncoderGain(),
    Harmonics(),
    Harmonics(orders=(3, 7), joints=("J1", "J2")),
    Compliance(),
    Compliance(joints=("J2", "J3")),
]


@pytest.mark.parametrize("name", NAMED)
@pytest.mark.parametrize("effect", EFFECTS, ids=repr)
def test_columns_of_an_effect_are_the_derivatives_of_the_poses(name, effect):
    robot = load_robot(name)
    chosen = None if effect.joints is None else tuple(robot.joint_names[int(joint[1:]) - 1] for joint in effect.joints)
    model = ErrorModel(robot) + replace(effect, joints=chosen)
    q, x = positions(model), np.random.default_rng(1).normal(size=len(model)) * model.tolerances
    J = model.jacobian(q, x)
    h = 1e-6
    for k in range(len(ErrorModel(model.robot)), len(model)):
        step = np.zeros(len(model))
        step[k] = h
        slope = (model.poses(q, x + step) - model.poses(q, x - step))[:, :3, 3] / (2 * h)
        np.testing.assert_allclose(J[:, :3, k], slope, atol=1e-8)


@pytest.mark.parametrize("name", ["ur5", "fanuc-r2000ic-165f", "abb-irb6660-205-1.9"])
@pytest.mark.parametrize("effect", [Harmonics(), EncoderGain(tolerance=1e-3), *BESIDE], ids=repr)
def test_both_jacobians_know_the_effects(name, effect):
    """Against differences of the poses: what a joint moves, and what a parameter moves."""
    model = ErrorModel(dressed(name)) + effect
    q, x = positions(model), np.random.default_rng(1).normal(size=len(model)) * model.tolerances
    by_joint, by_parameter = model.joint_jacobian(q, x), model.jacobian(q, x)
    h = 1e-6
    for j in range(6):
        step = h * np.eye(6)[j]
        slope = (model.poses(q + step, x) - model.poses(q - step, x))[:, :3, 3] / (2 * h)
        np.testing.assert_allclose(by_joint[:, :3, j], slope, atol=1e-6)
    for k in range(len(model) - len(model.effect_names), len(model)):
        step = np.zeros(len(model))
        step[k] = 0.1 * model.tolerances[k]
        slope = (model.poses(q, x + step) - model.poses(q, x - step))[:, :3, 3] / (2 * step[k])
        np.testing.assert_allclose(by_parameter[:, :3, k], slope, atol=1e-8 / model.tolerances[k] + 1e-8)


def test_an_effect_survives_its_description():
    for effect in EFFECTS:
        assert effect_from(effect.to_json()) == effect


def test_names_that_do_not_exist_and_effects_given_twice():
    robot = load_robot("ur5")
    with pytest.raises(UnknownName, match="no joint 'J9'"):
        Harmonics(joints=("J9",)).term(robot)
    with pytest.raises(UnknownName, match="no effect 'Friction'"):
        effect_from({"kind": "Friction"})
    with pytest.raises(TaskcalError, match="add each effect once"):
        ErrorModel(robot) + Harmonics() + Harmonics(orders=(1,))


def test_effects_stand_in_the_model_behind_its_geometry():
    model = ErrorModel(load_robot("ur5"))
    more = model + Harmonics(orders=(1,)) + EncoderGain()
    assert more.names[: len(model)] == model.names
    assert more.names[len(model) :][:3] == ("J1.cos1", "J1.sin1", "J2.cos1")
    assert more.names[-1] == "J6.gain"
    assert [more.parameters[-1].tolerance, more.parameters[-1].unit] == [EncoderGain().tolerance, "rad/rad"]
