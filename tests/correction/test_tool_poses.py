"""Poses of the calibrated tool, and joints for them."""

import numpy as np
import pytest

from taskcal.correction.tool_poses import find_joints, locate_tool, solve_calibrated
from taskcal.export.forms import spread_poses
from taskcal.geometry import se3
from taskcal.identification.calibration import Calibration
from taskcal.kinematics.inverse import find_postures, solve_near
from taskcal.robot.conditions import Conditions
from taskcal.robot.error_model import ErrorModel
from tests.laws.calibrations import calibrated


@pytest.fixture(scope="module")
def ur5() -> Calibration:
    return calibrated("ur5")


def test_what_differs_is_what_the_two_robots_say(ur5):
    q = 0.3 * spread_poses(ur5, 10)
    at = locate_tool(ur5, q)
    np.testing.assert_array_equal(at.calibrated, ur5.tool_in_base(q))
    np.testing.assert_allclose(at.nominal[:, :3, 3] + at.moved, at.calibrated[:, :3, 3], atol=1e-15)
    assert (at.turned > 1e-5).all()
    alone = np.sqrt(np.trace(ur5.tool_covariance(q)[:, :3, :3], axis1=1, axis2=2))
    assert (at.uncertainty >= alone - 1e-12).all()


def test_joints_bring_the_robot_to_the_poses(ur5):
    q = np.array([[0.3, -1.2, 1.4, -1.0, -1.3, 0.2], [0.5, -1.1, 1.3, -1.1, -1.2, 0.3]])
    T = ErrorModel(ur5.model.robot).poses(q)
    for seed in (None, q + 0.05):
        found = find_joints(ur5, T, seed)
        assert found.reached.all()
        np.testing.assert_allclose(ErrorModel(ur5.model.robot).poses(found.nominal), T, atol=1e-8)
        np.testing.assert_allclose(ur5.tool_in_base(found.calibrated), T, atol=1e-8)
    np.testing.assert_allclose(found.nominal, q, atol=1e-8)
    assert find_joints(ur5.model, T, q).calibrated is None


def test_branch_of_the_pose_before_is_kept_or_the_nearest_taken(ur5):
    """Also past a pose that cannot be reached, which changes nothing of the others."""
    model = ErrorModel(ur5.model.robot)
    T = model.poses(0.9 * spread_poses(ur5, 12))
    found = find_joints(ur5, T).nominal
    far = np.insert(T, 6, se3.translation(5.0, 0.0, 0.0), axis=0)
    np.testing.assert_array_equal(np.delete(find_joints(ur5, far).nominal, 6, axis=0), found)
    anew = 0
    for before, q, pose in zip(found, found[1:], T[1:], strict=False):
        if not solve_near(model, pose[None], before[None]).reached[0]:
            anew += 1
            assert np.abs(q - before).max() <= np.abs(find_postures(model, pose) - before).max(axis=1).min() + 1e-6
    assert anew > 2


def test_a_pose_out_of_reach_has_no_joints(ur5):
    T = np.stack([se3.translation(5.0, 0.0, 0.0), ErrorModel(ur5.model.robot).poses(np.full((1, 6), 0.7))[0]])
    found = find_joints(ur5, T)
    assert found.reached.tolist() == [False, True]
    assert np.isnan(found.nominal[0]).all()


# Inverse kinematics of the robot as calibrated.


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
