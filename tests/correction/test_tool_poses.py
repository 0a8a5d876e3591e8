import numpy as np
import pytest

from taskcal.correction.tool_poses import find_joints, locate_tool
from taskcal.export.forms import spread_poses
from taskcal.geometry import se3
from taskcal.identification.calibration import Calibration
from taskcal.kinematics.inverse import find_postures, solve_near
from taskcal.robot.error_model import ErrorModel
from tests.laws.calibrations import calibrated


@pytest.fixture(scope="module")
def calibration() -> Calibration:
    return calibrated("ur5")


def test_what_differs_is_what_the_two_robots_say(calibration):
    q = 0.3 * spread_poses(calibration, 10)
    at = locate_tool(calibration, q)
    np.testing.assert_array_equal(at.calibrated, calibration.tool_in_base(q))
    np.testing.assert_allclose(at.nominal[:, :3, 3] + at.moved, at.calibrated[:, :3, 3], atol=1e-15)
    assert (at.turned > 1e-5).all()
    alone = np.sqrt(np.trace(calibration.tool_covariance(q)[:, :3, :3], axis1=1, axis2=2))
    assert (at.uncertainty >= alone - 1e-12).all()


def test_joints_bring_the_robot_to_the_poses(calibration):
    q = np.array([[0.3, -1.2, 1.4, -1.0, -1.3, 0.2], [0.5, -1.1, 1.3, -1.1, -1.2, 0.3]])
    T = ErrorModel(calibration.model.robot).poses(q)
    for seed in (None, q + 0.05):
        found = find_joints(calibration, T, seed)
        assert found.reached.all()
        np.testing.assert_allclose(ErrorModel(calibration.model.robot).poses(found.nominal), T, atol=1e-8)
        np.testing.assert_allclose(calibration.tool_in_base(found.calibrated), T, atol=1e-8)
    np.testing.assert_allclose(found.nominal, q, atol=1e-8)
    assert find_joints(calibration.model, T, q).calibrated is None


def test_branch_of_the_pose_before_is_kept_or_the_nearest_taken(calibration):
    """Also past a pose that cannot be reached, which changes nothing of the others."""
    model = ErrorModel(calibration.model.robot)
    T = model.poses(0.9 * spread_poses(calibration, 12))
    found = find_joints(calibration, T).nominal
    far = np.insert(T, 6, se3.translation(5.0, 0.0, 0.0), axis=0)
    np.testing.assert_array_equal(np.delete(find_joints(calibration, far).nominal, 6, axis=0), found)
    anew = 0
    for before, q, pose in zip(found, found[1:], T[1:], strict=False):
        if not solve_near(model, pose[None], before[None]).reached[0]:
            anew += 1
            assert np.abs(q - before).max() <= np.abs(find_postures(model, pose) - before).max(axis=1).min() + 1e-6
    assert anew > 2


def test_a_pose_out_of_reach_has_no_joints(calibration):
    T = np.stack([se3.translation(5.0, 0.0, 0.0), ErrorModel(calibration.model.robot).poses(np.full((1, 6), 0.7))[0]])
    found = find_joints(calibration, T)
    assert found.reached.tolist() == [False, True]
    assert np.isnan(found.nominal[0]).all()
