"""Repeatability from campaigns whose poses recur."""

import numpy as np
import pytest

from taskcal.campaigns.campaign import Campaign
from taskcal.campaigns.performance import pose_repeatability
from taskcal.errors import CampaignError
from taskcal.reading.reader import read_campaign
from taskcal.robot.catalogue import load_robot


def campaign(q: np.ndarray, points: np.ndarray) -> Campaign:
    names = tuple(f"smr{k + 1}" for k in range(points.shape[1]))
    return Campaign(ids=tuple(str(i) for i in range(len(q))), q=q, targets=names, points=points)


def test_poses_are_found_by_their_joints_and_judged_by_target():
    q = np.radians([[0.0, 10], [5, 10], [0.004, 10.004], [7, 10], [5.02, 10], [0.008, 10]])
    points = np.zeros((6, 2, 3))
    points[[0, 2, 5], 0, 0] = [0.0, 0.0, 6e-3]  # as in the pose's table: RP_l = 8/3 + 3 √(4/3)
    points[[0, 2], 1, 2] = [0.0, 1e-3]  # half of the distance
    points[5, 1] = np.nan
    found = pose_repeatability(campaign(q, points))
    assert found.rows == ((0, 2, 5),)
    first, second = 1e-3 * (8 / 3 + 3 * np.sqrt(4 / 3)), 0.5e-3
    np.testing.assert_allclose(found.repeatability, [(first + second) / 2])
    # squares 4 + 4 + 16 and 0.25 + 0.25 mm² over 3 coordinates × (2 + 1) freedoms
    assert found.deviation == pytest.approx(1e-3 * np.sqrt(24.5 / 9))
    assert found.joint_spread[0] == pytest.approx(np.radians(0.008))
    assert found.summary()["rows"] == 3


def test_deviation_is_the_noise_however_few_the_cycles():
    rng = np.random.default_rng(0)
    q = np.repeat(rng.uniform(-1, 1, (800, 6)), 2, axis=0)
    found = pose_repeatability(campaign(q, 1e-4 * rng.normal(size=(1600, 1, 3))))
    assert len(found) == 800
    assert found.deviation == pytest.approx(1e-4, rel=0.04)
    many = pose_repeatability(campaign(np.zeros((4000, 6)), 1e-4 * rng.normal(size=(4000, 1, 3))))
    assert many.repeatability[0] == pytest.approx(found.expected_repeatability, rel=0.05)
    assert found.repeatability.mean() < 0.4 * many.repeatability[0]


def test_poses_that_do_not_recur_are_refused():
    q = np.radians([[0.0, 0], [1, 0], [1, 0]])
    with pytest.raises(CampaignError, match=r"no two of the 2 rows measured one pose, with joints within 0\.01°"):
        pose_repeatability(campaign(q[:2], np.zeros((2, 1, 3))))
    lost = np.zeros((3, 1, 3))
    lost[1] = np.nan
    with pytest.raises(CampaignError, match="no two of the 3 rows"):
        pose_repeatability(campaign(q, lost))


@pytest.mark.realdata
def test_measured_ur10_repeats_within_its_data_sheet(data_folder):
    measured = read_campaign(data_folder / "ur10_tmac/measurements.csv", load_robot("ur10"))
    found = pose_repeatability(measured)
    assert len(found) == 290
    assert all(len(rows) == 2 for rows in found.rows)
    assert np.sum(found.repeatability > 0.1e-3) == 4
    usual = [row for rows, value in zip(found.rows, found.repeatability, strict=True) if value < 0.1e-3 for row in rows]
    assert pose_repeatability(measured.take(usual)).expected_repeatability < 0.05e-3
