"""Hyperparameters: model error and prior scale of the largest marginal likelihood, each of its own group."""

from dataclasses import replace

import numpy as np
import pytest

from taskcal.estimation.least_squares import Stopping
from taskcal.identification.hyperparameters import Hyperparameters, fit_weighed
from taskcal.identification.identify import identify
from taskcal.identification.layout import layout_of, prior_of
from taskcal.identification.problem import problem_of
from taskcal.observations.base import TrackerNoise
from taskcal.registration.registration import register
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot_file import robot_from
from tests.laws.campaigns import measure
from tests.laws.observations import socket_campaign
from tests.laws.robots import industrial, industrial_positions

NOISE = TrackerNoise(rotation=1e-5)

POSITION, ROTATION = 2e-4, 5e-5
"""Model errors that no parameter explains, metres and radians; in metres the rotation's would be a quarter of the other."""


def poses_with_model_error(seed: int, position: float, rotation: float):
    """Poses of a robot whose points and rotations err at random, by far more than the tracker of 10 µm and 10 µrad says."""
    rng = np.random.default_rng(seed)
    model = ErrorModel(robot_from(industrial(rng)))
    x = 0.5 * rng.normal(size=len(model)) * model.tolerances
    q = industrial_positions(rng, 80)
    campaign, _ = measure(rng, model, q, x, pose=True, sigma=position, rotation_sigma=rotation, uncertainty=1e-5)
    return model, campaign


@pytest.mark.parametrize(("position", "rotation"), [(POSITION, ROTATION), (ROTATION, POSITION)])
def test_each_group_of_a_pose_has_the_model_error_of_the_truth(position: float, rotation: float) -> None:
    """Its standard error is a tenth or less: 240 numbers in each group, less the parameters that both share."""
    model, campaign = poses_with_model_error(11, position, rotation)
    noise = campaign.covariances(NOISE)
    own = np.sqrt([noise[..., 0, 0].mean(), noise[..., 3, 3].mean()])
    found = identify(model, campaign, noise=NOISE)
    assert len(found.model_error) == 2
    for group, truth in enumerate((position, rotation)):
        expected = np.sqrt(max(truth**2 - own[group] ** 2, 0.0))
        assert found.model_error[group] == pytest.approx(expected, rel=0.2), group


def test_rotation_model_error_is_zero_if_only_position_has_one() -> None:
    """Rotations without model error get none although positions have model error."""
    model, campaign = poses_with_model_error(12, POSITION, 1e-9)
    found = identify(model, campaign, noise=NOISE)
    assert found.model_error[0] == pytest.approx(POSITION, rel=0.2)
    assert found.model_error[1] == 0.0


def test_a_model_error_that_is_given_is_that_of_its_own_group() -> None:
    """The covariance of predictions has the variance of each group on its own diagonal."""
    model, campaign = poses_with_model_error(13, POSITION, ROTATION)
    found = identify(model, campaign, noise=NOISE, model_error=(POSITION, ROTATION), prior_scale=1.0)
    assert found.model_error == pytest.approx((POSITION, ROTATION))
    q = campaign.q[:5]
    added = found.predict_covariance(q) - found.predict_covariance(q, model_error=False)
    expected = np.diag([POSITION**2] * 3 + [ROTATION**2] * 3)
    np.testing.assert_allclose(added[:, 0], np.broadcast_to(expected, (5, 6, 6)), atol=1e-6 * ROTATION**2)


@pytest.mark.parametrize("error", ["estimate", 1e-4])
@pytest.mark.parametrize("scale", [0.2, 3.0])
def test_a_prior_scale_that_is_given_is_kept(error: float | str, scale: float) -> None:
    """Whatever scale the rows would ask for, and with a model error that is sought or given; there is no group to be found then."""
    model, campaign = poses_with_model_error(16, POSITION, ROTATION)
    points = replace(campaign.take(range(40)), rotations=None)
    found = identify(model, points, prior_scale=scale, model_error=error)
    assert found.prior_scale == pytest.approx(scale, rel=1e-12)
    assert found.parameter_groups is None
    sought = identify(model, points, model_error=error)
    assert 0.3 < sought.prior_scale < 1.0
    assert sought.parameter_groups == 1


def test_fit_without_tracker_ends_if_rotation_is_prior_only():
    """A fit without a tracker ends although only the prior determines the rotation of the fixed objects."""
    model, rng = ErrorModel(load_robot("abb-irb120")), np.random.default_rng(3)
    campaign, _ = socket_campaign(rng, model, rng.normal(size=len(model)) * model.tolerances, 90, noise=2e-5)
    calibration = identify(model, campaign, gross_errors="keep")
    assert calibration.iterations > 50  # a fit with a tracker takes four or five


@pytest.mark.parametrize("size", [0.1, 1.0])
def test_the_evidence_of_an_unfinished_fit_is_that_of_its_end(size: float) -> None:
    """Newton's step to the end and what it gains are known before it is taken: rows are nearly linear."""
    rng = np.random.default_rng(14)
    model = ErrorModel(robot_from(industrial(rng)))
    campaign, _ = measure(rng, model, industrial_positions(rng, 40), 0.1 * model.tolerances, sigma=1e-4)
    layout = layout_of(model, np.arange(len(model)), register(model, campaign), campaign, fixed=False)
    problem, prior = problem_of(layout, campaign, NOISE), prior_of(layout, "tolerances")
    hyper = Hyperparameters.of_deviations((1e-4,), 1.0)
    ended = fit_weighed(problem, prior, hyper, layout.start(), Stopping())
    A = ended.solution.information + prior.precision(1.0)
    step = np.linalg.solve(np.linalg.cholesky(A).T, rng.normal(size=len(A)))
    step *= size / np.sqrt(step @ A @ step)
    early = fit_weighed(problem, prior, hyper, ended.solution.z + step, Stopping(decrement=10.0))
    np.testing.assert_array_equal(early.solution.z, ended.solution.z + step)
    assert early.solution.objective - ended.solution.objective == pytest.approx(0.5 * size**2, rel=0.05)
    assert early.evidence() == pytest.approx(ended.evidence(), abs=0.02 * size**2)


def test_sizes_of_their_own_are_those_of_their_model_alone() -> None:
    model = ErrorModel(robot_from(industrial(np.random.default_rng(15))))
    own = np.linspace(1.0, 2.0, len(model))
    np.testing.assert_array_equal(
        Hyperparameters(variances=np.zeros(1), prior_factor=4.0, own=own).deviations(model), own
    )
    plain = Hyperparameters(variances=np.zeros(1), prior_factor=4.0)
    np.testing.assert_array_equal(plain.deviations(model), 2.0 * model.tolerances)
    with pytest.raises(ValueError, match=f"known of 3 parameters, the model has {len(model)}"):
        Hyperparameters(variances=np.zeros(1), prior_factor=4.0, own=own[:3]).deviations(model)
