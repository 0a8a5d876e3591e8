"""A virtual robot is measured with what it was asked for, and nothing else."""

import numpy as np
import pytest

from taskcal.observations.base import TrackerNoise
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.virtual.cell import SimulationOptions, simulate

MODEL = ErrorModel(load_robot("ur5"))
Q = np.random.default_rng(0).uniform(-1.0, 1.0, size=(2000, 6))


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
    with pytest.raises(TypeError, match=r"no option 'target' of a simulation; there are x, targets, pose"):
        simulate(MODEL, Q[:5], rng=np.random.default_rng(1), target={})
