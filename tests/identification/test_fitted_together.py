"""Campaigns that are fitted together give what each gives by itself."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from taskcal.demo.procedure import reference_task
from taskcal.effects import Compliance
from taskcal.errors import NothingLearntError
from taskcal.estimation.prior import GaussianPrior, Huber
from taskcal.identification.batch import fit_together
from taskcal.identification.identify import identify
from taskcal.identification.options import FitOptions
from taskcal.observations.base import TrackerNoise
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.task.task import reach_task
from taskcal.virtual.cell import simulate
from tests.identification.arms import arm, defects

NEAR = 1e-6
"""Standard deviations."""


def campaigns_of(seed, robots, rows=40, model_error=1e-4, **options):
    """Of one random arm, whose defects differ."""
    rng, model = arm(seed)
    q = [rng.uniform(-1.2, 1.2, (rows, len(model.robot.joints))) for _ in range(robots)]
    simulated = (
        simulate(model, one, rng=rng, x=defects(rng, model), model_error=model_error, **options)[0] for one in q
    )
    return model, list(simulated)


def assert_same(found, alone):
    deviations = np.sqrt(np.diag(alone.z_covariance))
    relative = found.layout.registration.T_tracker_base - alone.layout.registration.T_tracker_base
    assert np.abs(relative).max() < 1e-9  # z counts from there
    assert (np.abs(found.z - alone.z) <= NEAR * deviations).all()
    np.testing.assert_allclose(
        found.z_covariance / deviations / deviations[:, None], alone.correlation, rtol=0.0, atol=10.0 * NEAR
    )
    np.testing.assert_allclose(found.model_error, alone.model_error, rtol=NEAR, atol=1e-12)
    np.testing.assert_allclose(found.prior_scale, alone.prior_scale, rtol=NEAR)


OPTIONS = {
    "all is found": FitOptions(),
    "a model error that is known": FitOptions(model_error=1e-4),
    "a scale that is known": FitOptions(prior_scale=1.0),
    "both are known": FitOptions(model_error=5e-5, prior_scale=0.7),
    "no search for wrong rows": FitOptions(gross_errors="keep"),
    "another tracker": FitOptions(noise=TrackerNoise(range_m=5e-5, station=(1.0, 0.0, 0.0))),
}


@pytest.mark.parametrize("name", OPTIONS)
def test_every_estimate_is_that_of_the_campaign_by_itself(name):
    model, campaigns = campaigns_of(3, 5)
    found = fit_together(model, campaigns, OPTIONS[name])
    for one, campaign in zip(found, campaigns, strict=True):
        assert_same(one, identify(model, campaign, options=OPTIONS[name]))


@given(seed=st.integers(0, 10**6))
@settings(max_examples=8)
def test_so_are_those_of_any_arm_that_deviates_by_any_amount(seed):
    size = 10.0 ** (seed % 4 - 1.0)
    rng, model = arm(seed)
    q = rng.uniform(-1.5, 1.5, (50, len(model.robot.joints)))
    campaign, _ = simulate(model, q, rng=rng, x=defects(rng, model, size), model_error=2e-5 * (seed % 5))
    (found,) = fit_together(model, [campaign], FitOptions())
    if found is not None:
        assert_same(found, identify(model, campaign))
    assert found is not None or size > 5.0


@pytest.mark.parametrize("spread_deg", [0.0, 20.0])
def test_joint_fit_equals_single_fits_for_four_bar(spread_deg):
    """Four-bar robots give the same calibrations in a joint fit, measured in one orientation or in many."""
    model = ErrorModel(load_robot("abb-irb6660-205-1.9"))
    q = reach_task(model, reference_task(np.radians(spread_deg)), 60).q
    campaigns = [simulate(model, q, rng=np.random.default_rng(seed), model_error=5e-5)[0] for seed in range(4)]
    for found, campaign in zip(fit_together(model, campaigns, FitOptions()), campaigns, strict=True):
        alone = identify(model, campaign)
        assert_same(found, alone)
        error = found.predict(q) - alone.predict(q)
        assert np.abs(error).max() < 1e-9
        np.testing.assert_allclose(found.predict_covariance(q), alone.predict_covariance(q), rtol=1e-5)
        np.testing.assert_allclose(found.standard_errors, alone.standard_errors, rtol=1e-5)


def test_priors_and_uncertainties_that_are_stated_count():
    model, campaigns = campaigns_of(5, 3)
    prior = GaussianPrior.of_deviations(0.3 * model.tolerances)
    stated = [replace(one, uncertainty=np.full(one.points.shape[:2], 4e-5)) for one in campaigns]
    options = FitOptions(prior=prior)
    for found, campaign in zip(fit_together(model, stated, options), stated, strict=True):
        assert_same(found, identify(model, campaign, options=options))


def test_what_stands_beside_a_campaign_does_not_change_a_byte():
    model, campaigns = campaigns_of(7, 20)
    campaigns += campaigns_of(7, 3, rows=31)[1]
    together = fit_together(model, campaigns, FitOptions())
    alone = [fit_together(model, [one], FitOptions())[0] for one in campaigns]
    for a, b in zip(together, alone, strict=True):
        assert a.z.tobytes() == b.z.tobytes()
        assert a.z_covariance.tobytes() == b.z_covariance.tobytes()
        assert (a.model_error, a.prior_scale) == (b.model_error, b.prior_scale)


def test_joint_fit_is_identical_on_several_threads():
    """A campaign gets the same calibration in a joint fit large enough for several threads."""
    model, campaigns = campaigns_of(7, 70, rows=150)
    found = fit_together(model, campaigns, FitOptions(model_error=1e-4, prior_scale=1.0))
    assert all(one is not None for one in found)
    assert (
        found[0].z.tobytes()
        == fit_together(model, campaigns[:1], FitOptions(model_error=1e-4, prior_scale=1.0))[0].z.tobytes()
    )


def with_row_off(campaign, by):
    points = campaign.points.copy()
    points[7] += by
    return replace(campaign, points=points)


def test_what_is_unusual_is_left_to_the_single_fit():
    model, (plain, *_) = campaigns_of(11, 1)
    lost = plain.points.copy()
    lost[3] = np.nan
    left = {
        "a wrong row": with_row_off(plain, 0.05),
        "a lost beam": replace(plain, points=lost),
        "joints of another robot": replace(plain, q=plain.q[:, ::-1].copy()),
        "too few rows": plain.take(np.arange(3)),
        "two targets": campaigns_of(11, 1, targets=dict(zip("ab", 0.1 * np.eye(3), strict=False)))[1][0],
        "poses": campaigns_of(11, 1, pose=True)[1][0],
    }
    found = fit_together(model, [plain, *left.values()], FitOptions())
    assert [one is None for one in found] == [False] + [True] * len(left)


@pytest.mark.parametrize(
    "options",
    [
        FitOptions(loss=Huber()),
        FitOptions(prior=None),
        FitOptions(frames="fixed"),
        FitOptions(keep=("J1.rx", "J2.rx")),
        FitOptions(model_error=(1e-4, 1e-4)),
    ],
    ids=["robust", "no prior", "frames held", "some parameters", "errors of poses"],
)
def test_so_are_all_campaigns_under_other_options(options):
    model, campaigns = campaigns_of(11, 2)
    assert fit_together(model, campaigns, options) == [None, None]


def test_so_are_correlated_priors_and_effects():
    model, campaigns = campaigns_of(11, 1)
    covariance = np.diag(model.tolerances**2)
    covariance[0, 1] = covariance[1, 0] = 0.5 * model.tolerances[0] * model.tolerances[1]
    correlated = GaussianPrior(np.zeros(len(model)), covariance)
    assert fit_together(model, campaigns, FitOptions(prior=correlated)) == [None]
    assert fit_together(model + Compliance(), campaigns, FitOptions()) == [None]


def test_joint_fit_rejects_uninformative_campaign():
    """With so large a model error some campaigns say nothing."""
    model = ErrorModel(load_robot("abb-irb6660-205-1.9"))
    q = reach_task(model, reference_task(), 12).q
    campaigns = [simulate(model, q, rng=np.random.default_rng(seed), model_error=5e-3)[0] for seed in range(12)]
    refused = []
    for campaign in campaigns:
        try:
            identify(model, campaign)
            refused.append(False)
        except NothingLearntError:
            refused.append(True)
    assert 0 < sum(refused) < len(refused)
    assert [one is None for one in fit_together(model, campaigns, FitOptions())] == refused


def test_joint_fit_leaves_open_loop_poses_to_single_fit():
    """A campaign with a pose at which the loop does not close is left to the single fit."""
    model = ErrorModel(load_robot("abb-irb6660-205-1.9"))
    q = reach_task(model, reference_task(), 30).q
    campaign, _ = simulate(model, q, rng=np.random.default_rng(0))
    folded = q.copy()
    folded[4, 2] += np.pi
    assert fit_together(model, [replace(campaign, q=folded)], FitOptions()) == [None]
