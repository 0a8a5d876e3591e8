"""How an arm is bent: against the poses of the robot."""

import numpy as np
import pytest
from hypothesis import given

from robot_programs.core.robot import arm_bends
from taskcal.geometry import se3
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from tests.laws.robots import generators

FANUC, IRB120 = load_robot("fanuc-r2000ic-165f"), load_robot("abb-irb120")


@pytest.mark.parametrize(("robot", "wrist_to_flange_mm"), [(FANUC, 215.0), (IRB120, 72.0)])
@given(rng=generators)
def test_the_wrist_is_in_front_of_axis_1_where_its_pose_says_so(robot, wrist_to_flange_mm, rng):
    q = rng.uniform(-np.pi, np.pi, (20, 6))
    flange = ErrorModel(robot).poses(q) @ se3.inverse(robot.T_flange_tool)
    wrist = flange[:, :3, 3] - wrist_to_flange_mm * 1e-3 * flange[:, :3, 2]
    forward = np.column_stack([np.cos(q[:, 0]), np.sin(q[:, 0])])
    bends = arm_bends(robot, q)
    assert bends is not None
    ahead = (wrist[:, :2] * forward).sum(axis=1)
    np.testing.assert_array_equal(bends[:, 0] > 0.0, ahead > 0.0)


def test_the_forearm_in_line_with_the_lower_arm_is_the_border():
    # both arms upright: the forearm's offset of 225 mm leans back by atan(225 / 1280)
    q = np.zeros((3, 6))
    q[:, 2] = np.pi / 2 - np.arctan2(225.0, 1280.0) + np.array([-0.1, 0.0, 0.1])
    bends = arm_bends(FANUC, q)
    assert bends is not None
    np.testing.assert_allclose(bends[:, 1], [0.1, 0.0, -0.1], atol=1e-9)


def test_arm_bends_need_six_joints_and_no_parallel_rod():
    """An arm with a parallel rod or another number of joints has none."""
    assert arm_bends(load_robot("abb-irb6660-205-1.9"), np.zeros((1, 6))) is None
    assert arm_bends(load_robot("franka-panda"), np.zeros((1, 7))) is None
    assert arm_bends(load_robot("ur5"), np.zeros((1, 6))) is None
