"""Pose performance after ISO 9283:1998, 7.2, against numbers worked out by hand and laws of rigid motion and of noise."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from scipy.stats import maxwell

from taskcal.campaigns.performance import NORMAL_REPEATABILITY, assess_pose, compare_directions
from taskcal.errors import CampaignError
from taskcal.geometry import se3

COMMAND = np.array([1.0, 2.0, 3.0])
CROSS = COMMAND + 1e-3 * np.array([[4.0, 0, 0], [2, 0, 0], [3, 1, 0], [3, -1, 0]])
"""Four positions 1 mm about a point 3 mm off the command."""


def test_a_table_worked_out_by_hand():
    # l = 1, 1, 1, 1 mm about (3, 0, 0): mean 1, S = 0
    found = assess_pose(CROSS, COMMAND)
    assert found.accuracy == pytest.approx(3e-3)
    np.testing.assert_allclose(found.offset, [3e-3, 0.0, 0.0], atol=1e-15)
    assert found.repeatability == pytest.approx(1e-3)
    # on a line at 0, 0, 6: barycentre 2; l = 2, 2, 4: mean 8/3, S² = (4/9 + 4/9 + 16/9) / 2 = 4/3
    line = np.array([[0.0, 0, 0], [0, 0, 0], [0, 6, 0]])
    assert assess_pose(line).repeatability == pytest.approx(8 / 3 + 3 * np.sqrt(4 / 3))


def test_the_summary_is_in_millimetres_and_degrees():
    turned = se3.exp(np.radians([[0.0, 0, 1], [0, 0, 3]]))
    found = assess_pose(CROSS[:2], COMMAND, rotations=turned, commanded_rotation=np.eye(3))
    expected = {"cycles": 2, "AP_p_mm": 3, "AP_x_mm": 3, "AP_y_mm": 0, "AP_z_mm": 0, "AP_rx_deg": 0, "AP_ry_deg": 0}
    # ±1° about 2°: S = √2, RP = 3√2
    expected |= {"AP_rz_deg": 2, "RP_l_mm": 1, "RP_rx_deg": 0, "RP_ry_deg": 0, "RP_rz_deg": 3 * np.sqrt(2)}
    assert list(found.summary()) == list(expected)
    assert found.summary() == pytest.approx(expected, abs=1e-9)


def test_what_is_not_known_is_left_out():
    assert list(assess_pose(CROSS).summary()) == ["cycles", "RP_l_mm"]
    once = assess_pose(CROSS[:1], COMMAND)
    assert list(once.summary()) == ["cycles", "AP_p_mm", "AP_x_mm", "AP_y_mm", "AP_z_mm"]
    assert once.repeatability is None
    assert assess_pose(CROSS[:1], rotations=np.eye(3)[None]).orientation_repeatability is None


@given(seed=st.integers(0, 10_000))
def test_a_rigid_motion_of_both_changes_no_length(seed):
    rng = np.random.default_rng(seed)
    attained, command = rng.normal(size=(7, 3)), rng.normal(size=3)
    rotations = se3.exp(0.01 * rng.normal(size=(7, 3)))
    R, p = se3.exp(rng.normal(size=3)), rng.normal(size=3)
    here = assess_pose(attained, command, rotations=rotations, commanded_rotation=np.eye(3))
    there = assess_pose(attained @ R.T + p, R @ command + p, rotations=R @ rotations, commanded_rotation=R)
    assert there.accuracy == pytest.approx(here.accuracy)
    assert there.repeatability == pytest.approx(here.repeatability)
    np.testing.assert_allclose(there.offset, R @ here.offset, atol=1e-12)
    np.testing.assert_allclose(there.turn, R @ here.turn, atol=1e-12)
    np.testing.assert_allclose(there.angles, here.angles @ R.T, atol=1e-12)


def test_small_angles_are_those_of_the_standard():
    """Rotations about x, y and z, whatever the sequence: AP is the mean less the command, RP three deviations."""
    rng = np.random.default_rng(0)
    angles = np.array([1e-3, -2e-3, 3e-3]) + 2e-4 * rng.normal(size=(30, 3))
    rotations = Rotation.from_euler("xyz", angles).as_matrix()
    found = assess_pose(np.zeros((30, 3)), rotations=rotations, commanded_rotation=np.eye(3))
    np.testing.assert_allclose(found.turn, angles.mean(axis=0), atol=1e-5)
    np.testing.assert_allclose(found.orientation_repeatability, 3 * angles.std(axis=0, ddof=1), rtol=0.01)
    np.testing.assert_allclose(found.orientation, Rotation.from_matrix(rotations).mean().as_matrix(), atol=1e-12)


def test_pose_repeatability_of_normal_noise_is_maxwell():
    noise = 1e-4 * np.random.default_rng(1).normal(size=(200_000, 3))
    expected = maxwell.mean(scale=1e-4) + 3 * maxwell.std(scale=1e-4)
    assert assess_pose(noise).repeatability == pytest.approx(expected, rel=0.005)
    assert pytest.approx(expected, rel=1e-12) == NORMAL_REPEATABILITY * 1e-4


def test_directions_are_compared_by_their_means():
    here = assess_pose(CROSS, rotations=np.repeat(np.eye(3)[None], 4, axis=0))
    turn = se3.exp(np.array([0.0, 0.02, 0.0]))
    there = assess_pose(CROSS + np.array([0.0, 3.0, 4.0]), rotations=np.repeat(turn[None], 4, axis=0))
    near = assess_pose(CROSS + np.array([0.0, 0.1, 0.0]), rotations=np.repeat(np.eye(3)[None], 4, axis=0))
    found = compare_directions([here, near, there])
    assert found.position == pytest.approx(5.0)
    np.testing.assert_allclose(found.rotation, [0.0, 0.02, 0.0], atol=1e-12)
    assert found.summary()["vAP_ry_deg"] == pytest.approx(np.degrees(0.02))
    assert compare_directions([assess_pose(CROSS), here]).rotation is None
    with pytest.raises(CampaignError, match="1 is too few"):
        compare_directions([here])


def test_no_cycle_or_no_number_is_refused():
    with pytest.raises(CampaignError, match="at least one cycle"):
        assess_pose(np.zeros((0, 3)))
    with pytest.raises(CampaignError, match="cycle 2 is not a number"):
        assess_pose(np.where(np.arange(4)[:, None] == 2, np.nan, CROSS))


def test_rotations_have_no_names_of_euler_angles():
    """The difference of two Euler angles is another number: tens of degrees for a rotation of half a degree."""
    commanded = Rotation.from_euler("ZYX", [0.0, 89.5, 0.0], degrees=True).as_matrix()
    tilted = Rotation.from_rotvec(np.radians([0.5, 0.0, 0.0])).as_matrix() @ commanded
    found = assess_pose(np.zeros((1, 3)), np.zeros(3), rotations=tilted[None], commanded_rotation=commanded).summary()
    assert found["AP_rx_deg"] == pytest.approx(0.5)
    euler = Rotation.from_matrix(tilted).as_euler("ZYX", degrees=True)
    assert np.abs(euler - [0.0, 89.5, 0.0]).max() > 10.0
    assert not any(key.endswith(("_a_deg", "_b_deg", "_c_deg")) for key in found)
