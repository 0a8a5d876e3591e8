"""Joints that move a little with others."""

import numpy as np
import pytest
from hypothesis import given

from taskcal.errors import TaskcalError, UnknownName
from taskcal.robot.catalogue import load_robot
from taskcal.robot.effects import Coupling, effect_from
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.importers.urdf import steps_of
from taskcal.robot.robot import Robot
from taskcal.robot.robot_file import robot_from
from tests.laws.robots import generators

WRIST = ("J5.by_J4", "J6.by_J4", "J6.by_J5")


@pytest.mark.parametrize("name", ["ur5", "abb-irb6660-205-1.9", "abb-irb120"])
def test_a_coupled_joint_moves_by_a_share_of_the_other(name):
    model = ErrorModel(load_robot(name)) + Coupling()
    assert model.effect_names == WRIST
    q = np.random.default_rng(0).uniform(-0.5, 0.5, (6, 6)) + 0.3 * np.eye(6)[2]
    x = np.zeros(len(model))
    x[-3:] = 3e-4, -2e-4, 5e-4
    moved = q.copy()
    moved[:, 4] += 3e-4 * q[:, 3]
    moved[:, 5] += -2e-4 * q[:, 3] + 5e-4 * q[:, 4]
    np.testing.assert_allclose(model.poses(q, x), ErrorModel(model.robot).poses(moved), atol=1e-14)


def test_angles_are_the_joints_own_after_their_signs():
    """The FANUC counts J4 and J5 against their axes."""
    model = ErrorModel(load_robot("fanuc-r2000ic-165f")) + Coupling(pairs=(("J4", "J5"), ("J2", "J3")))
    q = np.random.default_rng(0).uniform(-0.5, 0.5, (6, 6))
    x = np.zeros(len(model))
    x[-2:] = 1e-3, 2e-3
    moved = q.copy()
    moved[:, 4] += 1e-3 * q[:, 3]  # both signs turn round
    moved[:, 2] -= 2e-3 * q[:, 1]  # J3's axis turns by -(J2 + J3)
    np.testing.assert_allclose(model.poses(q, x), ErrorModel(model.robot).poses(moved), atol=1e-14)


def test_only_the_joints_asked_for_are_moved():
    assert Coupling(joints=("J6",)).term(load_robot("ur5")).names == WRIST[1:]


def test_a_coupling_survives_its_description():
    for effect in (Coupling(), Coupling(pairs=(("J4", "J5"), ("J1", "J2")), joints=("J5",))):
        assert effect_from(effect.to_json()) == effect


def test_couplings_that_cannot_be():
    with pytest.raises(UnknownName, match="no joint 'J9'"):
        Coupling(pairs=(("J4", "J9"),)).term(load_robot("ur5"))
    with pytest.raises(TaskcalError, match="J4 cannot be coupled to itself"):
        Coupling(pairs=(("J4", "J4"),)).term(load_robot("ur5"))
    with pytest.raises(TaskcalError, match="no wrist of three joints"):
        Coupling().term(robot_from({"name": "two", "joint": [{"name": "J1"}, {"name": "J2"}]}))


def test_the_shaft_of_a_scara_slides_as_it_turns():
    model = ErrorModel(load_robot("denso-hsr065a1")) + Coupling()
    assert model.effect_names == ("J3.by_J4",)
    assert model.parameters[-1].unit == "m/rad"
    assert Coupling().suits(model.robot)
    q = np.random.default_rng(0).uniform(-0.1, 0.2, (6, 4))
    x = np.zeros(len(model))
    x[-1] = 2e-4
    lowered = ErrorModel(model.robot).poses(q)
    lowered[:, 2, 3] += 2e-4 * q[:, 3]
    np.testing.assert_allclose(model.poses(q, x), lowered, atol=1e-14)


def test_joints_that_slide_can_drive_and_be_driven():
    joints = [{"name": "z", "type": "prismatic"}, {"name": "x", "type": "prismatic"}, {"name": "J3"}]
    robot = robot_from({"name": "arm", "joint": joints})
    model = ErrorModel(robot) + Coupling(pairs=(("z", "x"), ("x", "J3"), ("J3", "z")))
    assert [p.unit for p in model.parameters[-3:]] == ["m/m", "rad/m", "m/rad"]
    q = np.random.default_rng(0).uniform(-0.5, 0.5, (6, 3))
    x = np.zeros(len(model))
    x[-3:] = 1e-3, 2e-3, -3e-3
    moved = q + np.stack([-3e-3 * q[:, 2], 1e-3 * q[:, 0], 2e-3 * q[:, 1]], axis=1)
    np.testing.assert_allclose(model.poses(q, x), ErrorModel(robot).poses(moved), atol=1e-14)


@given(generators)
def test_the_wrist_that_suits_is_one_whose_axes_meet(rng):
    """Three axes through one point, in any directions; a millimetre beside it they do not meet."""
    directions = rng.normal(size=(3, 3))
    point = rng.uniform(-1.0, 1.0, 3)

    def arm(beside: float) -> Robot:
        parts, before = [], np.eye(4)
        for k, z in enumerate(directions / np.linalg.norm(directions, axis=1)[:, None]):
            x = np.cross(z, rng.normal(size=3))
            R = np.stack([x, np.cross(z, x), z], axis=1) / np.array([np.linalg.norm(x)] * 2 + [1.0])
            place = point + rng.uniform(-0.5, 0.5) * z + (beside * R[:, 0] if k == 2 else 0.0)
            T = np.block([[R, place[:, None]], [np.eye(4)[3:]]])
            parts.append({"name": f"J{k + 1}", "steps": steps_of(np.linalg.inv(before) @ T)})
            before = T
        return robot_from({"name": "wrist", "joint": parts})

    assert Coupling().suits(arm(0.0))
    assert not Coupling().suits(arm(1e-3))
