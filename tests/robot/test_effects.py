"""Effects on the joint side: derivatives, load paths, and models that carry them."""

import numpy as np
import pytest

from taskcal.errors import TaskcalError, UnknownName
from taskcal.robot.catalogue import catalogue_names, load_robot
from taskcal.robot.effects import Compliance, EncoderGain, Harmonics, effect_from
from taskcal.robot.error_model import ErrorModel

EFFECTS = [
    EncoderGain(),
    Harmonics(),
    Harmonics(orders=(3, 7), joints=("J1", "J2")),
    Compliance(),
    Compliance(joints=("J2", "J3")),
]


def positions(model, count=12):
    limits = np.clip(model.robot.limits, -0.6, 0.6)
    return np.random.default_rng(0).uniform(limits[:, 0], limits[:, 1], (count, len(limits)))


@pytest.mark.parametrize("name", catalogue_names())
@pytest.mark.parametrize("effect", EFFECTS, ids=repr)
def test_columns_of_an_effect_are_the_derivatives_of_the_poses(name, effect):
    model = ErrorModel(load_robot(name)) + effect
    q, x = positions(model), np.random.default_rng(1).normal(size=len(model)) * model.tolerances
    J = model.jacobian(q, x)
    h = 1e-6
    for k in range(len(ErrorModel(model.robot)), len(model)):
        step = np.zeros(len(model))
        step[k] = h
        slope = (model.poses(q, x + step) - model.poses(q, x - step))[:, :3, 3] / (2 * h)
        np.testing.assert_allclose(J[:, :3, k], slope, atol=1e-8)


def test_the_joint_jacobian_knows_the_effects():
    model = ErrorModel(load_robot("ur5")) + Harmonics() + EncoderGain(tolerance=1e-3)
    q, x = positions(model), np.random.default_rng(1).normal(size=len(model)) * model.tolerances
    J = model.joint_jacobian(q, x)
    for j in range(6):
        step = np.zeros(6)
        step[j] = 1e-6
        slope = (model.poses(q + step, x) - model.poses(q - step, x))[:, :3, 3] / 2e-6
        np.testing.assert_allclose(J[:, :3, j], slope, atol=1e-6)


@pytest.mark.parametrize("name", catalogue_names())
def test_a_weight_puts_on_a_motor_the_torque_of_virtual_work(name):
    """The weight at the tool point lowers it by lever · turn; the lever is minus the motor's column of its height."""
    model = ErrorModel(load_robot(name))
    term = Compliance().term(model.robot)
    q = positions(model)
    factor = term.basis(q)
    height = model.joint_jacobian(q)[:, 2] if model.robot.four_bar else _by_coordinate(model, q)[:, 2]
    for k, (coordinate, parameter) in enumerate(term.pairs):
        if term.names[parameter].endswith("sag_tool"):
            joint = term.names[parameter].split(".")[0]
            j = model.robot.joint_names.index(joint)
            gear = model.robot.joint_map.matrix[coordinate, j] if model.robot.four_bar else 1.0
            np.testing.assert_allclose(factor[:, k], -gear * height[:, j], atol=1e-9)


def _by_coordinate(model, q):
    return model.joint_jacobian(q) @ np.linalg.inv(model.robot.joint_map.matrix)


def test_through_a_parallelogram_the_forearms_moment_goes_to_the_cranks_motor():
    """The lower arm's motor does not feel how far the forearm reaches out; the crank's motor does."""
    robot = load_robot("abb-irb6660-205-1.9")
    term = Compliance().term(robot)
    folded, stretched = np.zeros((1, 6)), np.zeros((1, 6))
    folded[0, 2], stretched[0, 2] = np.radians(60.0), np.radians(10.0)
    moved = term.basis(stretched) - term.basis(folded)
    motor = np.array([term.names[p].split(".")[0] for _, p in term.pairs])
    # whatever hangs on the forearm pulls at the lower arm's end: one lever, and one parameter, for all of it
    assert [name for name in term.names if name.startswith("J2.")] == ["J2.sag_J3"]
    np.testing.assert_allclose(moved[:, motor == "J2"], 0.0, atol=1e-12)
    assert np.abs(moved[:, motor == "J3"]).max() > 0.1


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
    assert [more.parameters[-1].tolerance, more.parameters[-1].unit] == [EncoderGain().tolerance, "rad"]
