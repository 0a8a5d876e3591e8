"""A virtual robot is measured with what it was asked for, and nothing else."""

import numpy as np
import pytest

from taskcal.geometry import se3
from taskcal.observations.base import TrackerNoise
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.virtual.cell import simulate
from taskcal.virtual.options import SimulationOptions

MODEL = ErrorModel(load_robot("ur5"))
Q = np.random.default_rng(0).uniform(-1.0, 1.0, size=(2000, 6))
QUIET = TrackerNoise(mpe_to_sigma=1e-4)


def test_options_as_a_whole_and_by_keyword_are_the_same():
    whole = SimulationOptions(targets={"a": np.zeros(3), "b": np.full(3, 0.1)}, lost=0.5, model_error=1e-4)
    by_value, _ = simulate(MODEL, Q[:20], rng=np.random.default_rng(1), options=whole)
    by_name, _ = simulate(MODEL, Q[:20], rng=np.random.default_rng(1), **vars(whole))
    np.testing.assert_array_equal(by_value.points, by_name.points)
    none_lost, _ = simulate(MODEL, Q[:20], rng=np.random.default_rng(1), options=whole, lost=0.0)
    assert none_lost.valid.all()
    assert not by_value.valid.all()


def test_the_model_error_adds_to_the_tracker_s_noise_in_squares():
    quiet = TrackerNoise(mpe_to_sigma=0.1)
    campaign, truth = simulate(MODEL, Q, rng=np.random.default_rng(1), noise=quiet, model_error=3e-4)
    off = (campaign.points - truth.points(Q)).reshape(-1, 3)
    tracker = np.mean(np.trace(quiet.covariance(truth.points(Q)), axis1=-2, axis2=-1)) / 3.0
    assert np.mean(off**2) == pytest.approx(tracker + 9e-8, rel=0.05)


def test_poses_are_of_the_first_target_alone():
    targets = {"a": np.full(3, 0.1), "b": np.zeros(3)}
    campaign, truth = simulate(MODEL, Q[:5], rng=np.random.default_rng(1), targets=targets, pose=True)
    assert campaign.targets == ("a",)
    np.testing.assert_allclose(campaign.points, truth.points(Q[:5]), atol=1e-3)


def test_an_option_that_there_is_not_is_refused_by_name():
    with pytest.raises(TypeError, match=r"no option 'target' of simulate; there are x, targets, pose"):
        simulate(MODEL, Q[:5], rng=np.random.default_rng(1), target={})


def test_a_joint_s_error_moves_every_target_of_a_pose_together():
    """Beside the tracker's noise, as the joints' derivative says; the controller says what it was told."""
    q = np.tile([0.3, -1.2, 1.0, 0.4, -0.7, 0.5], (4000, 1))
    off = np.array([1e-3, 5e-4, 0.0, 2e-3, 1e-3, 0.0])
    targets = {"a": np.array([0.1, 0.0, 0.05]), "b": np.array([-0.1, 0.08, 0.0])}
    rng = np.random.default_rng(3)
    campaign, truth = simulate(MODEL, q, rng=rng, targets=targets, joint_error=off, noise=QUIET)
    np.testing.assert_array_equal(campaign.q, q)
    error = (campaign.points - truth.points(q)).reshape(len(q), 6)
    step = 1e-6 * np.eye(6)
    J = np.stack([(truth.points(q[:1] + d) - truth.points(q[:1] - d)).ravel() / 2e-6 for d in step], axis=1)
    expected = (J * off**2) @ J.T
    np.testing.assert_allclose(np.cov(error.T), expected, atol=0.08 * np.abs(expected).max())


def test_a_measured_rotation_scatters_by_what_is_stated():
    noise = TrackerNoise(rotation=4e-4)
    campaign, truth = simulate(MODEL, Q, rng=np.random.default_rng(1), pose=True, noise=noise)
    turn = se3.log(campaign.rotations @ np.swapaxes(truth.poses(Q)[:, 0, :3, :3], 1, 2))
    np.testing.assert_allclose(turn.std(axis=0), 4e-4, rtol=0.06)


@pytest.mark.parametrize("stations", [2, 3])
def test_stations_see_one_robot_from_places_about_it(stations):
    """Blocks of rows one after another, all in the frame of the first; each tracker is as far from the base as the first."""
    q = Q[:24]
    nothing = np.zeros(len(MODEL))
    campaign, truth = simulate(MODEL, q, rng=np.random.default_rng(1), x=nothing, stations=stations, noise=QUIET)
    np.testing.assert_allclose(campaign.points, truth.points(q), atol=1e-7)
    np.testing.assert_array_equal(campaign.stations.of, np.arange(24) * stations // 24)
    base = truth.T_tracker_base[:3, 3]
    places = campaign.stations.T_first_station[:, :3, 3]
    np.testing.assert_allclose(np.linalg.norm(places - base, axis=1), np.linalg.norm(base), rtol=1e-6)
    assert len(np.unique(places.round(3), axis=0)) == stations


def test_each_beam_is_lost_by_itself():
    """A share of all points; where one target of a row is lost, another is as often as anywhere."""
    targets = {"a": np.zeros(3), "b": np.full(3, 0.1), "c": np.array([0.1, 0.0, 0.0])}
    campaign, _ = simulate(MODEL, Q, rng=np.random.default_rng(1), targets=targets, lost=0.3)
    lost = ~campaign.valid
    np.testing.assert_allclose(lost.mean(axis=0), 0.3, atol=0.04)
    np.testing.assert_allclose(np.corrcoef(lost.T)[np.triu_indices(3, 1)], 0.0, atol=0.08)
