"""Effects on the joint side: derivatives, load paths, and models that carry them."""

from dataclasses import replace

import numpy as np
import pytest

from taskcal.errors import TaskcalError, UnknownName
from taskcal.robot.catalogue import catalogue_names, load_robot
from taskcal.robot.effects import Compliance, Coupling, EncoderGain, Harmonics, MotorHarmonics, Spring, effect_from
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.file import robot_from
from taskcal.robot.load import Load
from tests.laws import statics

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


BESIDE = [
    Compliance(),
    Compliance(load=Load(mass=30.0, centre=(0.0, 0.1, 0.2), force=(300.0, 0.0, -400.0), axes="tool")),
    Spring(),
    MotorHarmonics(),
    Coupling(),
]
SPRING = {
    "joint": "J2",
    "rate_n_mm": 60.0,
    "free_length_mm": 300.0,
    "crank_mm": 200.0,
    "anchor_mm": 500.0,
    "aligned_deg": 20.0,
}


def dressed(name):
    """A robot of the catalogue with masses, gear ratios and a spring."""
    description = statics.weighed(load_robot(name).description, np.random.default_rng(0))
    joints = [{**joint, "gear_ratio": 100.5} for joint in description["joint"]]
    return robot_from({**description, "joint": joints, "spring": SPRING})


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


@pytest.mark.parametrize("name", [*catalogue_names(), "dressed abb-irb6660-205-1.9", "dressed fanuc-r2000ic-165f"])
@pytest.mark.parametrize("effect", [*BESIDE, Spring(joints=("J2",))], ids=repr)
def test_the_slope_of_what_goes_through_the_load_path_is_that_of_differences(name, effect):
    """Differences of two steps, extrapolated (Richardson), as the referee; dressed robots have masses, springs and gears."""
    known = name.startswith("dressed ")
    robot = dressed(name.removeprefix("dressed ")) if known else load_robot(name)
    if (effect == BESIDE[1] and not known) or (isinstance(effect, MotorHarmonics) and not known):
        pytest.skip("the robot file states neither masses nor gear ratios")
    if "J2" not in robot.joint_names and effect.joints:
        effect = replace(effect, joints=(robot.joint_names[1],))
    term, q = effect.term(robot), positions(ErrorModel(robot))

    def difference(h: float) -> np.ndarray:
        steps = h * np.eye(q.shape[1])
        return np.stack([(term.basis(q + step) - term.basis(q - step)) / (2 * h) for step in steps], axis=2)

    h = 1e-5 if isinstance(effect, MotorHarmonics) else 1e-3
    expected = (4.0 * difference(h / 2) - difference(h)) / 3.0
    found = term.by_joint(q)
    np.testing.assert_allclose(found, expected, atol=1e-6 * max(1.0, float(np.abs(expected).max())))


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
    assert [more.parameters[-1].tolerance, more.parameters[-1].unit] == [EncoderGain().tolerance, "rad/rad"]
