"""The prior of an estimate: its precision and covariance, and fits with and without it."""

from dataclasses import replace

import numpy as np
import pytest

from taskcal.errors import TaskcalError
from taskcal.estimation.prior import GaussianPrior
from taskcal.identification.effects import explain
from taskcal.identification.identify import identify
from taskcal.identification.layout import TARGET_FROM_TCP, prior_of, unlocated_directions
from tests.identification.arms import arm, defects, true_points
from tests.laws.campaigns import measure
from tests.laws.robots import industrial_positions


@pytest.mark.parametrize(
    "keep", [None, ["J2", "J3", "J4", "J5"], ["J1.tz", "J1.rz", "J2", "tool"]], ids=["all", "redundant", "mixed"]
)
@pytest.mark.parametrize("seed", range(3))
def test_without_a_prior_redundant_parameters_do_not_run_away(keep, seed):
    rng, model = arm(seed)
    x = defects(rng, model)
    if keep is not None:
        x[np.setdiff1d(np.arange(len(model)), model.indices(keep))] = 0.0
    campaign, truth = measure(rng, model, industrial_positions(rng, 60), x, sigma=2e-5, uncertainty=2e-5)
    calibration = identify(model, campaign, keep=keep, prior=None)
    assert np.abs(calibration.estimate).max() < 5.0 * np.abs(x).max()
    q = industrial_positions(rng, 200)
    error = np.linalg.norm(calibration.predict(q) - true_points(model, truth, q), axis=-1)
    assert error.mean() < 5e-5
    assert calibration.prior_scale is None


@pytest.mark.parametrize("factor", [0.3, 1.0, 4.0])
def test_the_priors_scale_is_that_of_the_defects(factor):
    rng, model = arm(9)
    campaign, _ = measure(
        rng, model, industrial_positions(rng, 150), defects(rng, model, factor), sigma=1e-5, targets=3
    )
    assert identify(model, campaign).prior_scale == pytest.approx(factor, rel=0.5)


def test_a_prior_of_another_size_is_refused():
    rng, model = arm(0)
    campaign, _ = measure(rng, model, industrial_positions(rng, 40))
    with pytest.raises(ValueError, match="the prior has 3 parameters, 6 are estimated"):
        identify(model, campaign, keep=["J3"], prior=GaussianPrior.of_deviations(np.ones(3)))


@pytest.mark.parametrize("kind", [{}, {"targets": 3}, {"pose": True}], ids=["a target", "three targets", "poses"])
@pytest.mark.parametrize("factor", [0.25, 1.0, 9.0])
def test_the_precision_is_the_inverse_of_the_covariance(kind, factor):
    """A factor scales the parameters alone."""
    rng, model = arm(4)
    campaign, _ = measure(rng, model, industrial_positions(rng, 30), **kind)
    layout = identify(model, campaign).layout
    prior = prior_of(layout, "tolerances")
    C = prior.covariance(factor)
    np.testing.assert_allclose(prior.precision(factor) @ C, np.eye(len(C)), atol=1e-9)
    p = len(model)
    np.testing.assert_allclose(np.diag(C)[:p], factor * model.tolerances**2, rtol=1e-12)
    np.testing.assert_array_equal(C[p:, p:], prior.covariance(1.0)[p:, p:])
    assert not prior_of(layout, None).precision(factor)[:p].any()


def test_targets_are_held_along_what_the_poses_do_not_tell():
    """There they are at the TCP, as far off as stated, each of them; across it as free as any, base and parameters too."""
    rng, model = arm(4)
    campaign, _ = measure(rng, model, industrial_positions(rng, 30), targets=3)
    layout = identify(model, campaign).layout
    n = rng.normal(size=3)
    u = np.tile(n / np.linalg.norm(n), 3) / np.sqrt(3.0)
    hidden = replace(layout, registration=replace(layout.registration, unobservable=np.outer(u, u)))
    place, others = np.concatenate([one.columns for one in layout.places]), np.arange(len(model), len(model) + 6)
    C, free = prior_of(hidden, "tolerances").covariance(1.0), prior_of(layout, "tolerances").covariance(1.0)
    own = C[np.ix_(place, place)]
    assert u @ own @ u < 1e-11
    across = np.eye(9) - np.outer(u, u)
    np.testing.assert_allclose(across @ own @ across, across, atol=1e-3)
    np.testing.assert_allclose(C[np.ix_(others, others)], free[np.ix_(others, others)], rtol=1e-3)
    np.testing.assert_array_equal(C[: len(model)], free[: len(model)])
    for stated, taken in ((0.02, 0.02), (5.0, TARGET_FROM_TCP)):
        (direction,) = unlocated_directions(hidden, stated).T
        np.testing.assert_allclose(np.linalg.norm(direction[place].reshape(3, 3), axis=1), taken)
        assert not np.delete(direction, place).any()


@pytest.mark.parametrize("found", [{}, {"model_error": 0.0, "prior_scale": 1.0}], ids=["estimated", "given"])
def test_a_robot_that_its_prior_knows_is_left_where_that_has_it(found):
    """About the prior's mean, far from zero, nothing is left that a model error would have to explain."""
    rng, model = arm(4)
    x = 5.0 * defects(rng, model)
    campaign, truth = measure(rng, model, industrial_positions(rng, 40), x, sigma=1e-5, uncertainty=1e-5)
    prior = GaussianPrior(x, np.diag((1e-3 * model.tolerances) ** 2))
    calibration = identify(model, campaign, prior=prior, **found)
    np.testing.assert_allclose(calibration.estimate, x, atol=0.05 * model.tolerances.min())
    assert calibration.model_error[0] < 1e-5
    q = industrial_positions(rng, 100)
    assert np.abs(calibration.predict(q) - true_points(model, truth, q)).max() < 5e-5


def test_a_prior_that_is_given_moves_with_its_mean():
    """The fit of rows that were moved as much as the prior is the fit moved: to first order, all else alike."""
    rng, model = arm(6)
    q = industrial_positions(rng, 40)
    d, root = 1e-3 * defects(rng, model), rng.normal(size=(len(model), len(model))) / np.sqrt(len(model))
    covariance = (0.2 * root @ root.T + np.eye(len(model))) * np.outer(model.tolerances, model.tolerances)
    options = {"model_error": 1e-4, "prior_scale": 1.0, "gross_errors": "keep"}
    here, truth = measure(np.random.default_rng(1), model, q, defects(rng, model), sigma=1e-4, uncertainty=1e-4)
    moved = true_points(model, replace(truth, x=truth.x + d), q) - true_points(model, truth, q)
    zero = np.zeros(len(model))
    first = identify(model, here, prior=GaussianPrior(zero, covariance), **options)
    there = replace(here, points=here.points + moved)
    second = identify(model, there, prior=GaussianPrior(d, covariance), **options)
    np.testing.assert_allclose(second.estimate - first.estimate, d, atol=0.02 * np.abs(d).max())
    alone = identify(model, there, prior=GaussianPrior(zero, covariance), **options)
    assert np.abs(alone.estimate - first.estimate - d).max() > 0.2 * np.abs(d).max()


def test_effects_are_not_sought_beside_a_prior_that_would_be_ignored():
    rng, model = arm(0)
    campaign, _ = measure(rng, model, industrial_positions(rng, 40))
    prior = GaussianPrior.of_deviations(model.tolerances)
    with pytest.raises(TaskcalError, match="not with one that is given"):
        explain(model, campaign, prior=prior)
