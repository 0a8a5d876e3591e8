"""What loads put on drives: derivatives, and torques by virtual work."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings

from taskcal.robot.catalogue import load_robot
from taskcal.robot.effects import Compliance, MotorHarmonics, Spring
from taskcal.robot.error_model import ErrorModel
from tests.laws.robots import NAMED, Case, cases
from tests.robot.effects.dressed import BESIDE, dressed, positions

DRESSED = "dressed abb-irb6660-205-1.9", "dressed fanuc-r2000ic-165f"
EFFECTS = (*BESIDE, Spring(joints=("J2",)))
"""The second needs masses and motor harmonics gear ratios, which files of the catalogue do not state."""


@pytest.mark.parametrize(
    ("name", "effect"),
    [
        *((name, effect) for name in DRESSED for effect in EFFECTS),
        *(
            (name, effect)
            for name in NAMED
            for effect in EFFECTS
            if effect != BESIDE[1] and not isinstance(effect, MotorHarmonics)
        ),
    ],
    ids=str,
)
def test_load_path_slope_is_that_of_differences(name, effect):
    """Differences of two steps, extrapolated (Richardson), as the referee; dressed robots have masses, springs and gears."""
    robot = dressed(name.removeprefix("dressed ")) if name in DRESSED else load_robot(name)
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


@settings(max_examples=15)
@given(cases(prismatic=False, min_joints=3))
def test_a_weight_puts_on_a_motor_the_torque_of_virtual_work(case: Case):
    """The weight at the TCP lowers it by lever · turn; the lever is minus the motor's column of its height."""
    assert_torques_are_of_virtual_work(case.model, case.q)


@pytest.mark.parametrize("name", NAMED)
def test_a_weight_puts_on_a_named_robot_the_same_torque(name):
    model = ErrorModel(load_robot(name))
    assert_torques_are_of_virtual_work(model, positions(model))


def assert_torques_are_of_virtual_work(model, q):
    term = Compliance().term(model.robot)
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


def test_parallelogram_moment_goes_to_the_crank():
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
