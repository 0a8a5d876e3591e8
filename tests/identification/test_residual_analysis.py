"""The remainder goes with what it was made of, and with nothing else."""

import json
from dataclasses import replace

import numpy as np
import pytest
from sklearn.linear_model import RidgeCV
from sklearn.preprocessing import SplineTransformer

from taskcal.errors import CampaignError
from taskcal.identification.identify import identify
from taskcal.identification.residual_analysis import Regressor, analyse_residuals, fit_smooth, list_regressors
from taskcal.robot.catalogue import load_robot
from taskcal.robot.effects import Harmonics
from taskcal.robot.error_model import ErrorModel
from taskcal.virtual.cell import simulate
from tests.laws.campaigns import with_conditions

TARGETS = {"a": np.zeros(3), "b": np.array([0.1, 0.0, 0.0]), "c": np.array([0.0, 0.12, 0.05])}


@pytest.fixture(scope="module")
def model():
    return ErrorModel(load_robot("abb-irb120"))


def measure(model, count=120, seed=0, x=None, targets=None):
    rng = np.random.default_rng(seed)
    limits = np.clip(model.robot.limits, -1.2, 1.2)
    q = rng.uniform(limits[:, 0], limits[:, 1], (count, len(limits)))
    return simulate(model, q, rng=rng, x=x, targets=targets)[0]


def examined(model, campaign, **options):
    found = analyse_residuals(identify(model, campaign), campaign, permutations=19, **options)
    return found, {e.regressor.name: e for e in found.explained}


def test_noise_goes_with_nothing(model):
    campaign = measure(model)
    warmth = np.random.default_rng(1).normal(20.0, 1.0, 120)
    campaign = with_conditions(campaign, temperature=warmth)
    found, by_name = examined(model, campaign)
    assert {"position of J3", "gravity on J2", "order of measurement", "temperature", "tilt of the tool"} < set(by_name)
    assert max(e.share for e in found.explained) < 0.03
    assert found.rms == pytest.approx(found.tracker, rel=0.25)
    assert (found.non_rigid, found.rigid) == (None, None)


def test_a_joint_that_errs_often_in_a_turn_is_named_and_drawn(model):
    more = model + Harmonics(orders=(7,), joints=("J3",))
    x = np.zeros(len(more))
    x[-2:] = [6e-4, 3e-4]
    campaign = measure(more, x=x, count=300)
    found, by_name = examined(model, campaign)
    first = found.explained[0]
    assert (first.regressor.name, first.regressor.moves) == ("position of J3", "turn of J3")
    assert first.share > 0.6
    assert first.p_value == pytest.approx(0.05)
    assert by_name["position of J5"].share < 0.1
    angle = first.regressor.values[:, 0]
    true = 6e-4 * np.cos(7 * model.robot.joint_map(campaign.q)[:, 2]) + 3e-4 * np.sin(
        7 * model.robot.joint_map(campaign.q)[:, 2]
    )
    drawn = fit_smooth(first.regressor, found.residual)[:, 0]
    inner = np.abs(angle) < 0.8 * np.abs(angle).max()
    assert np.corrcoef(drawn[inner], true[inner])[0, 1] > 0.95
    assert drawn[inner].std() == pytest.approx(true[inner].std(), rel=0.2)


def test_drift_goes_with_temperature_or_order(model):
    campaign = measure(model)
    warm = np.linspace(20.0, 26.0, len(campaign))
    bent = with_conditions(campaign, temperature=np.random.default_rng(3).permutation(warm))
    moved = bent.points + (bent.temperature - 23.0)[:, None, None] * np.array([6e-5, 0.0, -4e-5])
    found, by_name = examined(model, replace(bent, points=moved))
    assert found.explained[0].regressor.name == "temperature"
    assert found.explained[0].share > 0.5
    assert by_name["order of measurement"].share < 0.05


def test_a_side_of_approach_is_told_from_its_joint(model):
    campaign = measure(model)
    side = np.sign(np.random.default_rng(5).normal(size=campaign.q.shape))
    plain = ErrorModel(model.robot)
    turned = campaign.q.copy()
    turned[:, 0] += 2e-4 * side[:, 0]
    shift = plain.poses(turned)[:, :3, 3] - plain.poses(campaign.q)[:, :3, 3]
    R = identify(model, campaign).T_tracker_base[:3, :3]
    conditions = replace(campaign.conditions, approach=side)
    moved = replace(campaign, points=campaign.points + (shift @ R.T)[:, None], conditions=conditions)
    found, by_name = examined(model, moved)
    assert found.explained[0].regressor.name == "approach of J1"
    assert found.explained[0].share > 0.5
    assert by_name["approach of J2"].share < 0.05


def test_common_target_motion_is_attributed_to_robot(model):
    """Targets that move together indicate the robot; independent ones do not."""
    campaign = measure(model, targets=TARGETS, count=60)
    rng = np.random.default_rng(7)
    common = campaign.points + 3e-4 * rng.normal(size=(60, 1, 3))
    found = analyse_residuals(identify(model, campaign), replace(campaign, points=common), permutations=1)
    assert found.rigid > 2e-4
    assert found.non_rigid == pytest.approx(found.tracker, rel=0.25)
    single = campaign.points + 3e-4 * rng.normal(size=(60, 3, 3))
    found = analyse_residuals(identify(model, campaign), replace(campaign, points=single), permutations=1)
    assert found.non_rigid == pytest.approx(3e-4, rel=0.2)


def test_lost_beams_and_short_campaigns(model):
    campaign = measure(model, targets=TARGETS, count=60)
    points = campaign.points.copy()
    points[3] = np.nan
    points[4:9, 1] = np.nan
    gaps = replace(campaign, points=points)
    found = analyse_residuals(identify(model, gaps), gaps, permutations=1)
    assert found.residual.shape == (59, 3)
    assert np.isfinite(found.residual).all()
    json.dumps(found.summary(), allow_nan=False)
    with pytest.raises(CampaignError, match="29 poses are too few"):
        analyse_residuals(identify(model, campaign), campaign.take(slice(0, 29)))
    with pytest.raises(CampaignError, match="the campaign's targets are a, the calibration's a, b, c"):
        analyse_residuals(identify(model, campaign), campaign.of_targets(["a"]))


def test_levers_are_those_of_the_measured_point(model):
    campaign = measure(model, targets={"far": np.array([0.2, 0.1, 0.3])})
    fitted = identify(model, campaign)
    step = 1e-6
    found = {r.name: r for r in list_regressors(fitted, campaign)}
    points = [
        fitted.T_tracker_base[:3, :3].T @ fitted.predict(campaign.q + s)[:, 0].T
        for s in (step * np.eye(6)[1], -step * np.eye(6)[1])
    ]
    by_hand = (points[0] - points[1]).T / (2 * step)
    np.testing.assert_allclose(found["position of J2"].carrier[:, :, 0], by_hand, atol=1e-6)
    np.testing.assert_allclose(found["gravity on J2"].values[:, 0], -by_hand[:, 2], atol=1e-6)
    away = np.linalg.norm(fitted.predict(campaign.q)[:, 0], axis=1)
    np.testing.assert_allclose(found["distance from the tracker"].values[:, 0], away, atol=1e-9)


@pytest.mark.parametrize(("poses", "functions"), [(60, 8), (105, 9), (165, 13)])
def test_smooth_term_has_one_knot_per_15_poses_at_least_six(poses, functions):
    """A smooth function has one knot for every fifteen poses, and six at least."""
    rng = np.random.default_rng(0)
    values, carrier = rng.uniform(-1.0, 1.0, (poses, 1)), rng.normal(size=(poses, 3, 1))
    regressor = Regressor(name="a", moves="b", values=values, carrier=carrier, unit="", scale=1.0)
    fitted = [fit_smooth(regressor, rng.normal(size=(poses, 3)))[:, 0] for _ in range(functions + 5)]
    assert np.linalg.matrix_rank(np.array(fitted), tol=1e-9) == functions


def test_fit_smooth_is_scikit_learns_ridge_on_its_splines():
    rng = np.random.default_rng(0)
    for poses, kinds in ((60, 1), (170, 1), (90, 2)):
        values, carrier = rng.uniform(-1.0, 1.0, (poses, kinds)), rng.normal(size=(poses, 3, 1))
        regressor = Regressor(name="a", moves="b", values=values, carrier=carrier, unit="", scale=1.0)
        residual = np.sin(3.0 * values.sum(axis=1))[:, None] * carrier[:, :, 0] + rng.normal(size=(poses, 3))
        knots = 6 if kinds == 2 else poses // 15 if poses > 100 else 6
        basis = SplineTransformer(n_knots=knots, degree=3).fit_transform(values)
        X = basis[:, None, :] * carrier / np.sqrt((carrier**2).sum(axis=1).mean())
        ridge = RidgeCV(alphas=np.logspace(-2, 4, 7), fit_intercept=False).fit(
            X.reshape(-1, X.shape[2]), residual.ravel()
        )
        expected = basis @ ridge.coef_ / np.sqrt((carrier**2).sum(axis=1).mean())
        np.testing.assert_allclose(fit_smooth(regressor, residual)[:, 0], expected, atol=1e-9)
