"""Errors that recur with the turns of the motor."""

import numpy as np
import pytest

from taskcal.errors import TaskcalError
from taskcal.robot.catalogue import load_robot
from taskcal.robot.effects import MotorHarmonics, effect_from
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot_file import robot_from


def geared(name: str, ratios: dict[str, float]):
    description = load_robot(name).description
    joints = [
        {**joint, "gear_ratio": ratios[joint["name"]]} if joint["name"] in ratios else joint
        for joint in description["joint"]
    ]
    return robot_from({**description, "joint": joints})


def test_a_joint_errs_with_its_motors_angle():
    model = ErrorModel(geared("ur5", {"J2": 101.0, "J3": 80.5})) + MotorHarmonics()
    names = [f"J{j}.motor_{part}{order}" for j in (2, 3) for order in (1, 2) for part in ("cos", "sin")]
    assert list(model.effect_names) == names
    q, size = np.random.default_rng(0).uniform(-1, 1, (20, 6)), 1e-4
    for name, turn in (
        ("J2.motor_cos1", lambda q: np.cos(101.0 * q[:, 1])),
        ("J3.motor_sin2", lambda q: np.sin(161.0 * q[:, 2])),
    ):
        x, moved = np.zeros(len(model)), q.copy()
        x[model.names.index(name)] = size
        moved[:, int(name[1]) - 1] += size * turn(q)
        np.testing.assert_allclose(model.poses(q, x), ErrorModel(model.robot).poses(moved), atol=1e-12)


def test_behind_a_parallelogram_the_motor_turns_with_its_crank():
    """The forearm's motor counts from the base: turning the lower arm alone does not turn it, and its error is its own."""
    model = ErrorModel(geared("abb-irb6660-205-1.9", {"J3": 120.0})) + MotorHarmonics(orders=(1,))
    q = np.random.default_rng(0).uniform([-1, -0.3, 0.2, -1, -1, -1], [1, 0.3, 0.6, 1, 1, 1], (20, 6))
    x, moved = np.zeros(len(model)), q.copy()
    x[-1] = 1e-4
    moved[:, 2] += 1e-4 * np.sin(120.0 * q[:, 2])
    np.testing.assert_allclose(model.poses(q, x), ErrorModel(model.robot).poses(moved), atol=1e-8)


def test_without_a_ratio_there_is_nothing_to_say():
    with pytest.raises(
        TaskcalError, match="ur5: the robot file states no gear_ratio of any joint; add it, or use Harmonics"
    ):
        MotorHarmonics().term(load_robot("ur5"))
    with pytest.raises(TaskcalError, match="no gear_ratio of joint J4"):
        MotorHarmonics(joints=("J2", "J4")).term(geared("ur5", {"J2": 100.0}))


def test_motor_harmonics_survive_their_description():
    effect = MotorHarmonics(orders=(1, 2, 4), joints=("J1",))
    assert effect_from(effect.to_json()) == effect
