"""Torques of the drives against energy and virtual work."""

import numpy as np
import pytest
from hypothesis import given
from scipy.spatial.transform import Rotation

from taskcal.robot.catalogue import load_robot
from taskcal.robot.effects import Compliance
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot_file import robot_from
from taskcal.robot.statics import Load
from tests.laws import robots, statics
from tests.robot.effects.loads import CUT, LOAD, PAYLOAD


@given(robots.cases(max_joints=6))
def test_torque_is_the_loss_of_energy_per_turn(case):
    """The torque is what the energy loses in a turn of the motor."""
    rng = np.random.default_rng(1)
    description = {**statics.weighed(case.description, rng), "gravity": rng.normal(size=3).tolist()}
    robot = robot_from(description)
    term = Compliance(load=LOAD).term(robot)
    for row, factor in zip(case.q, term.basis(case.q), strict=True):
        expected = statics.torques(description, row, CUT, PAYLOAD)
        np.testing.assert_allclose(factor, expected, atol=1e-9 * (1 + np.abs(expected).max()))
    assert term.names == tuple(f"{name}.compliance" for name in robot.joint_names)
    assert term.nominal.tolist() == pytest.approx([1 / k for k in robot.statics.stiffness])


@pytest.mark.parametrize("axes", ["base", "tool"])
@pytest.mark.parametrize("name", ["abb-irb6660-205-1.9", "ur5"])
def test_a_moment_works_by_the_rotation_of_the_tool(name, axes):
    rng = np.random.default_rng(2)
    robot = robot_from(statics.weighed(load_robot(name).description, rng))
    force, moment = np.array([100.0, 30.0, -60.0]), np.array([20.0, -35.0, 50.0])
    q = rng.uniform([-1, -0.4, 0.1, -1, -1, -1], [1, 0.4, 0.6, 1, 1, 1], (5, 6))
    stiff = ErrorModel(robot)
    pushed = Compliance(load=Load(force=tuple(force), moment=tuple(moment), axes=axes)).term(robot)
    added = pushed.basis(q) - Compliance().term(robot).basis(q)
    h = 1e-6
    motor = [list(map(tuple, pushed.pairs)).index((j, j)) for j in range(6)]
    for j in range(6):
        step = h * np.eye(6)[j]
        before, after = stiff.poses(q - step), stiff.poses(q + step)
        turn = Rotation.from_matrix(after[:, :3, :3] @ before[:, :3, :3].swapaxes(1, 2)).as_rotvec()
        R = stiff.poses(q)[:, :3, :3] if axes == "tool" else np.eye(3)[None]
        work = np.sum((R @ force) * (after - before)[:, :3, 3] + (R @ moment) * turn, axis=1) / (2 * h)
        np.testing.assert_allclose(added[:, motor[j]], work, atol=1e-6)
