import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from taskcal.errors import CampaignError, FileError
from taskcal.geometry import se3
from taskcal.observations import Landmarks, Measured
from taskcal.reading.reader import read_campaign
from taskcal.reading.writer import write_campaign
from tests.observations.files import ROBOT, written

seeds = st.integers(0, 2**32 - 1)


def sighted(seed, rows=40, landmarks=2, flat=False):
    """Poses of a tool that carries a sensor, and landmarks in the sensor's frame."""
    rng = np.random.default_rng(seed)
    tool = se3.pose(se3.exp(rng.uniform(-1.5, 1.5, (rows, 3))), rng.uniform(-0.6, 0.6, (rows, 3)))
    X = se3.pose(se3.exp(rng.normal(size=3)), rng.uniform(-0.2, 0.2, 3))
    of, kind_of = np.arange(rows) % landmarks, rng.uniform(-1, 1, (landmarks, 3))
    if flat:  # a camera that always stands as far from the landmark, straight before it
        seen = np.concatenate([rng.uniform(-0.05, 0.05, (rows, 2)), np.full((rows, 1), 0.3)], axis=1)
        tool[:, :3, 3] = kind_of[of] - (tool[:, :3, :3] @ se3.apply(X, seen)[:, :, None])[:, :, 0]
    y = se3.apply(se3.inverse(tool @ X), kind_of[of])
    return tool, Measured(y), Landmarks(landmarks=tuple("abc"[:landmarks]), of=of), X, kind_of


@pytest.mark.parametrize("flat", [False, True])
@given(seeds)
@settings(max_examples=10)
def test_sensor_and_landmarks_are_found_without_a_guess(flat, seed):
    tool, measured, kind, X, landmarks = sighted(seed, flat=flat)
    placed = kind.place(tool, measured)
    np.testing.assert_allclose(placed.T_tool_target, X, atol=1e-6)
    np.testing.assert_allclose(placed.unknown.reshape(-1, 3), landmarks, atol=1e-6)
    assert not placed.unobservable.any()


@given(seeds)
@settings(max_examples=5)
def test_landmark_registration_is_robust_to_wrong_rows(seed):
    """Camera and landmarks are located with an inaccurate robot and some wrong rows."""
    rng = np.random.default_rng(seed)
    tool, measured, kind, X, landmarks = sighted(seed, rows=60)
    tool[:, :3, 3] += 5e-4 * rng.normal(size=(60, 3))
    measured.points[::20] += 0.1
    placed = kind.place(tool, measured)
    np.testing.assert_allclose(placed.T_tool_target, X, atol=5e-3)
    np.testing.assert_allclose(placed.unknown.reshape(-1, 3), landmarks, atol=5e-3)
    assert set(np.flatnonzero(placed.distance > 0.05)) == {0, 20, 40}


def test_in_one_orientation_the_sensor_stays_at_the_tool_point():
    tool, _, kind, _, landmarks = sighted(3)
    tool[:, :3, :3] = np.eye(3)
    y = se3.apply(se3.inverse(tool), landmarks[kind.of])
    placed = kind.place(tool, Measured(y))
    np.testing.assert_allclose(placed.unobservable, np.eye(3), atol=1e-6)
    np.testing.assert_allclose(placed.T_tool_target, np.eye(4), atol=1e-5)


def test_few_sightings_are_refused():
    tool, measured, kind, _, _ = sighted(6, rows=6)
    with pytest.raises(CampaignError, match="6 sightings do not tell where the sensor is; measure 8 or more"):
        kind.place(tool, measured)


def test_landmarks_settle_where_the_sensor_is_known():
    tool, measured, kind, X, landmarks = sighted(7)
    np.testing.assert_allclose(kind.settle(tool @ X, measured, np.zeros(6)), landmarks.reshape(-1), atol=1e-12)


def test_some_rows_keep_only_the_landmarks_that_they_name():
    kind = Landmarks(landmarks=("a", "b", "c"), of=np.array([0, 1, 2, -1, 2]))
    some = kind.take(np.array([4, 3, 0]))
    assert (some.landmarks, some.of.tolist()) == (("c", "a"), [0, -1, 1])
    assert Landmarks.of_description(kind.describe()).describe() == kind.describe()


def test_sightings_are_read_and_written(tmp_path):
    file = written(tmp_path, "sx_mm,sy_mm,sz_mm,landmark", "1,2,300,left", ",,,", "4,5,310,right")
    campaign = read_campaign(file, ROBOT)
    (kind,) = campaign.observations
    assert (campaign.targets, kind.landmarks, kind.of.tolist()) == (("sensor",), ("left", "right"), [0, -1, 1])
    np.testing.assert_allclose(campaign.points[[0, 2], 0], [[0.001, 0.002, 0.3], [0.004, 0.005, 0.31]])
    write_campaign(tmp_path / "again.csv", campaign, ROBOT)
    np.testing.assert_allclose(read_campaign(tmp_path / "again.csv", ROBOT).points, campaign.points)


@pytest.mark.parametrize(
    ("header", "row", "message"),
    [
        (
            "sx_mm,sy_mm,sz_mm,landmark",
            "1,2,3,",
            "campaign.csv:2: column 'landmark': the cell is empty; name the landmark",
        ),
        ("sx_mm,sy_mm,sz_mm", "1,,3", "campaign.csv:2: column 'sx_mm': sx, sy and sz belong together"),
    ],
)
def test_a_wrong_cell_is_refused(tmp_path, header, row, message):
    with pytest.raises(FileError, match=re.escape(message)):
        read_campaign(written(tmp_path, header, row), ROBOT)


def test_tracker_poses_with_sightings_keep_their_rotations(tmp_path):
    """Tracker poses in a file with sightings are written with their rotations."""
    header = "x_mm,y_mm,z_mm,qx,qy,qz,qw,sx_mm,sy_mm,sz_mm,landmark"
    campaign = read_campaign(written(tmp_path, header, "400,1,2,0,0,0.6,0.8,1,2,300,a"), ROBOT)
    write_campaign(tmp_path / "again.csv", campaign, ROBOT)
    again = read_campaign(tmp_path / "again.csv", ROBOT)
    assert [one.key for one in again.observations] == ["pose", "landmark"]
    np.testing.assert_allclose(again.rotations, campaign.rotations, atol=1e-9)
