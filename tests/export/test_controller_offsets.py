from dataclasses import replace

import numpy as np
import pytest

from taskcal.export.controller import fit_offsets
from taskcal.export.forms import spread_poses
from taskcal.identification.calibration import Calibration
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot_file import robot_from
from tests.laws.calibrations import calibrated
from tests.laws.robots import industrial


@pytest.fixture(scope="module")
def calibration() -> Calibration:
    return calibrated("fanuc-r2000ic-165f")


def test_zeros_of_joints_are_found_and_leave_nothing(calibration):
    """A robot whose only defects are zeros is what a controller can hold: coupled joints too."""
    robot = calibration.model.robot
    wrong = np.array([0.0, 0.004, -0.003, 0.002, -0.005, 0.0])
    names = [*(f"{name}.rz" for name in robot.joint_names)]
    z = np.zeros_like(calibration.z)
    z[[calibration.all_names.index(name) for name in names]] = robot.joint_map.matrix @ wrong
    found = fit_offsets(replace(calibration, z=z))
    np.testing.assert_allclose(found.joints[1:5], wrong[1:5], atol=1e-9)
    assert found.with_zeros.maximum < 1e-9
    assert found.without_zeros.rms > 1e-3


def test_each_thing_more_that_it_may_hold_leaves_less(calibration):
    found = fit_offsets(calibration)
    nominal = ErrorModel(calibration.model.robot)
    q = spread_poses(calibration)
    off = np.linalg.norm((nominal.poses(q) - calibration.tool_in_base(q))[:, :3, 3], axis=1)
    assert np.sqrt(np.mean(off**2)) > found.without_zeros.rms > found.with_zeros.rms > 10.0 * found.uncertainty
    assert found.with_zeros.maximum >= found.with_zeros.rms


def test_what_is_stated_is_what_was_fitted():
    """A nominal arm that carries the stated tool on its flange, of a robot whose tool is turned."""
    tool = [{"tx_mm": 80.0}, {"ry_deg": 35.0}, {"tz_mm": 120.0}, {"rz_deg": 50.0}]
    robot = robot_from({**industrial(np.random.default_rng(3)), "tool": tool})
    calibration = calibrated(robot)
    found = fit_offsets(calibration)
    q = spread_poses(calibration)
    flange = ErrorModel(robot).poses(q + found.joints) @ np.linalg.inv(robot.T_flange_tool)
    T = found.base @ flange @ found.tool_in_flange
    off = np.linalg.norm((T - calibration.tool_in_base(q))[:, :3, 3], axis=1)
    assert np.sqrt(np.mean(off**2)) == pytest.approx(found.with_zeros.rms, rel=1e-9)


def test_no_other_offsets_are_better(calibration):
    found = fit_offsets(calibration)
    q = spread_poses(calibration)
    nominal, goal = ErrorModel(calibration.model.robot), calibration.tool_in_base(q)

    def cost(joints):
        T = found.base @ nominal.poses(q + joints) @ found.tool
        turn = 0.1**2 * np.sum((T[:, :3, :3] - goal[:, :3, :3]) ** 2, axis=(1, 2)) / 2.0
        return float(np.mean(np.sum((T - goal)[:, :3, 3] ** 2, axis=1) + turn))

    least = cost(found.joints)
    for j in range(6):
        for step in (-1e-4, 1e-4):
            assert cost(found.joints + step * np.eye(6)[j]) > least


def test_over_fewer_poses_less_is_left(calibration):
    q = spread_poses(calibration)
    near = q[:1] + np.random.default_rng(0).uniform(-0.1, 0.1, (50, 6))
    assert fit_offsets(calibration, near).with_zeros.rms < 0.3 * fit_offsets(calibration, q).with_zeros.rms
    assert fit_offsets(calibration, near).poses == 50


def test_a_weight_is_a_pose_that_is_repeated(calibration):
    q = spread_poses(calibration, 40)
    times = np.random.default_rng(2).integers(1, 5, len(q))
    weighted, repeated = fit_offsets(calibration, q, 0.3 * times), fit_offsets(calibration, np.repeat(q, times, axis=0))
    for one in ("joints", "base", "tool", "tool_in_flange"):
        np.testing.assert_allclose(getattr(weighted, one), getattr(repeated, one), atol=1e-9)
    for one in ("without_zeros", "with_zeros"):
        assert getattr(weighted, one).rms == pytest.approx(getattr(repeated, one).rms, rel=1e-9)
        assert getattr(weighted, one).maximum == pytest.approx(getattr(repeated, one).maximum, rel=1e-9)
    assert weighted.uncertainty == pytest.approx(repeated.uncertainty, rel=1e-9)
    each = [np.trace(calibration.predict_covariance(q[i : i + 1])[0, 0, :3, :3]) for i in range(len(q))]
    assert weighted.uncertainty**2 == pytest.approx(np.average(each, weights=times), rel=1e-9)


def test_what_is_said_has_the_units_that_it_names(calibration):
    """Angles in degrees, lengths in millimetres; what is expected of a pose is what is left and what is not known of it."""
    made = replace(fit_offsets(calibration), prismatic=(True, *(False,) * 5), joints=np.arange(1.0, 7.0) * 1e-3)
    said = made.summary()
    names = calibration.model.robot.joint_names
    assert said["joint_offsets"][f"{names[0]}_mm"] == pytest.approx(1.0)
    assert said["joint_offsets"][f"{names[5]}_deg"] == pytest.approx(np.degrees(6e-3))
    np.testing.assert_allclose(said["base"]["position_mm"], 1e3 * made.base[:3, 3])
    np.testing.assert_allclose(said["tool"]["position_mm"], 1e3 * made.tool_in_flange[:3, 3])
    left = {"tool_and_base": made.without_zeros, "zeros_tool_and_base": made.with_zeros}
    for key, remaining in left.items():
        assert said[key]["left_rms_mm"] == pytest.approx(1e3 * remaining.rms)
        assert said[key]["left_max_mm"] == pytest.approx(1e3 * remaining.maximum)
        assert said[key]["expected_rms_mm"] ** 2 == pytest.approx(1e6 * (remaining.rms**2 + made.uncertainty**2))
    assert said["program_correction"]["expected_rms_mm"] == pytest.approx(1e3 * made.uncertainty)
