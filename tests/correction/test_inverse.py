"""Inverse kinematics of the robot as calibrated."""

import numpy as np

from taskcal.correction.tool_poses import solve_calibrated
from taskcal.geometry import se3
from taskcal.robot.conditions import Conditions
from taskcal.robot.error_model import ErrorModel


def test_the_calibrated_tool_meets_the_poses(calibration, robot, measured):
    """Seeds are the nominal robot's joints; the answer is checked by the calibration's own prediction."""
    T = ErrorModel(robot).poses(measured)
    found = solve_calibrated(calibration, T, measured)
    assert found.reached.all()
    at = calibration.tool_in_base(found.q)
    np.testing.assert_allclose(at[:, :3, 3], T[:, :3, 3], atol=2e-9)
    np.testing.assert_allclose(se3.log(at[:, :3, :3] @ np.swapaxes(T[:, :3, :3], 1, 2)), 0.0, atol=2e-9)
    assert 1e-5 < np.abs(found.q - measured).max() < 1e-2


def test_the_calibrated_tool_meets_the_poses_under_conditions(lost_motion, robot, measured):
    conditions = Conditions(approach=np.random.default_rng(3).uniform(-1.0, 1.0, size=measured.shape))
    T = ErrorModel(robot).poses(measured)
    solution = solve_calibrated(lost_motion, T, measured, conditions)
    assert solution.reached.all()
    at = lost_motion.tool_in_base(solution.q, conditions)
    np.testing.assert_allclose(at[:, :3, 3], T[:, :3, 3], atol=2e-9)
    np.testing.assert_allclose(se3.log(at[:, :3, :3] @ np.swapaxes(T[:, :3, :3], 1, 2)), 0.0, atol=2e-9)
    middle = lost_motion.tool_in_base(solution.q)
    assert np.linalg.norm(middle[:, :3, 3] - T[:, :3, 3], axis=1).max() > 1e-5


def test_poses_out_of_reach_are_said_to_be(calibration, measured):
    T = calibration.tool_in_base(measured[:3])
    T[1, :3, 3] += 5.0
    assert solve_calibrated(calibration, T, measured[:3]).reached.tolist() == [True, False, True]
