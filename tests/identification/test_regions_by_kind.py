"""Regions of what was measured without a tracker: as many hold as they state, whatever the rows locate themselves."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from scipy.stats import binom

from taskcal.errors import CampaignError
from taskcal.identification.calibration import covariance_on, load_calibration
from taskcal.identification.held_out import REGION
from taskcal.identification.holdout import hold_out
from taskcal.identification.identify import fit_nominal, identify
from taskcal.identification.options import FitOptions, Holdout
from taskcal.identification.validation import examine, validate
from taskcal.report.comparison import describe_regions
from taskcal.robot.conditions import Conditions, conditions_in_order
from taskcal.robot.effects import Backlash
from tests.laws.observations import observed

OPTIONS = FitOptions(gross_errors="keep", model_error=0.0, prior_scale=1.0)
NOISE = 2e-5


def measured(kind, seed, rows=80):
    """A model and a campaign that states its noise."""
    model, campaign, _ = observed(kind, seed, rows=rows, noise=NOISE)
    return model, replace(campaign, uncertainty=np.full((len(campaign), 1), NOISE))


def fit_of(model):
    return partial(identify, model, options=OPTIONS)


@pytest.mark.parametrize("kind", ["socket", "distance", pytest.param("landmark", marks=pytest.mark.long)])
def test_regions_of_held_out_rows_hold_their_share(kind):
    """Predicted at what is known to stand, and at what stands as these rows have it."""
    inside, again = [], []
    for seed in range(4):
        model, campaign = measured(kind, seed)
        nominal = partial(fit_nominal, model, options=OPTIONS)
        calibration = hold_out(fit_of(model), campaign, Holdout(share=0.4, by="rows", seed=seed), nominal)
        inside.append(calibration.held_out.inside[:, 0])
        again.append(examine(calibration, campaign.take(calibration.held_out.rows)).inside)
    # rows of one robot have its errors in common: their own noise is the larger part, so that half of them count
    inside, again = np.concatenate(inside), np.concatenate(again)
    count = len(inside) // 2
    low, high = binom.ppf([0.001, 0.999], count, REGION) / count
    assert np.isfinite(inside).all()
    assert low < np.mean(inside) <= high
    assert low < np.mean(again) <= high


@pytest.mark.parametrize("kind", ["socket", "distance"])
def test_what_is_not_told_of_a_row_and_its_joints_widen_its_region(kind):
    """Of a robot with lost motion, whatever measures it."""
    model, campaign = measured(kind, 1)
    told = conditions_in_order(model.robot, campaign.q)
    fitted = fit_of(model + Backlash())(replace(campaign, conditions=told))
    still = replace(fitted, joint_error=())
    loose = replace(fitted, joint_error=tuple(np.full(len(model.robot.joints), 1e-4)))
    noise, known = campaign.covariances(), replace(campaign, conditions=told).take(np.arange(1, len(campaign)))
    told, untold, scattered = (
        np.trace(covariance_on(one, rows, noise[1:])[:, 0], axis1=1, axis2=2)
        for one, rows in ((still, known), (still, replace(known, conditions=Conditions())), (loose, known))
    )
    assert (untold[told > 0] > told[told > 0]).all()
    assert (scattered > told).all()


def test_a_socket_that_two_rows_locate_leaves_them_half_of_their_noise():
    """Each is off the mean of both by half of their difference, whose covariance that of the fit and of the noise make."""
    model, campaign = measured("socket", 3)
    (kind,) = campaign.observations
    fitted = fit_of(model)(campaign.take(np.flatnonzero(kind.of != 3)))
    pair = campaign.take(np.flatnonzero(kind.of == 3)[:2])

    def apart(z):
        ball = replace(fitted, z=z, T_tool_target=fitted.layout.frames(z)[1]).target_poses(pair.q)[:, 0, :3, 3]
        return 0.5 * (ball[1] - ball[0])

    step = 1e-6 * np.eye(len(fitted.z))
    J = np.stack([(apart(fitted.z + dz) - apart(fitted.z - dz)) / 2e-6 for dz in step], axis=1)
    expected = J @ fitted.z_covariance @ J.T + 0.5 * NOISE**2 * np.eye(3)
    held = replace(fitted, range_growth=0.0)  # which is of each row's own pose
    np.testing.assert_allclose(
        covariance_on(held, pair, pair.covariances())[:, 0], [expected] * 2, rtol=1e-4, atol=1e-15
    )


def test_a_row_that_locates_its_own_socket_is_not_judged():
    model, campaign = measured("socket", 4)
    (kind,) = campaign.observations
    calibration = fit_of(model)(campaign.take(np.flatnonzero(kind.of != 3)))
    alone = campaign.take(np.append(np.flatnonzero(kind.of == 1)[:8], np.flatnonzero(kind.of == 3)[0]))
    examined = examine(calibration, alone)
    assert list(examined.judged) == [True] * 8 + [False]
    assert examined.points()[-1]["inside"] is None
    assert examined.summary()["inside_share"] == pytest.approx(examined.inside[:8].mean())
    assert "of 8 points)" in describe_regions(examined)
    assert "1 not judged" in describe_regions(examined)
    only = examine(calibration, alone.take(np.array([8])))
    assert only.summary()["inside_share"] is None
    assert "not judged" in describe_regions(only)


def test_regions_of_held_out_rows_are_kept_with_the_calibration(tmp_path):
    model, campaign = measured("board", 1, rows=40)
    nominal = partial(fit_nominal, model, options=OPTIONS)
    calibration = hold_out(fit_of(model), campaign, Holdout(folds=2), nominal)
    calibration.save(tmp_path / "cal.json")
    kept = load_calibration(tmp_path / "cal.json").held_out
    np.testing.assert_array_equal(kept.inside, calibration.held_out.inside)
    np.testing.assert_array_equal(kept.rotation_inside, calibration.held_out.rotation_inside)
    assert kept.summary()["inside_share"] == pytest.approx(np.mean(kept.inside))
    assert kept.summary()["rotation_inside_share"] == pytest.approx(np.mean(kept.rotation_inside))


def test_a_row_that_is_wrong_is_outside_and_named():
    model, campaign = measured("distance", 2)
    calibration = fit_of(model)(campaign.take(np.arange(60)))
    other = campaign.take(np.arange(60, 80))
    points = other.points.copy()
    points[7, 0, 0] += 3e-3
    examined = examine(calibration, replace(other, points=points))
    assert not examined.inside[7]
    assert [outlier.row for outlier in examined.outliers][:1] == [other.row_of(7)]
    assert examined.validation.summary() == validate(calibration, replace(other, points=points)).summary()


def test_rows_without_any_uncertainty_are_refused():
    model, campaign = measured("socket", 4)
    (kind,) = campaign.observations
    calibration = fit_of(model)(campaign.take(np.flatnonzero(kind.of != 3)))
    certain = replace(campaign, uncertainty=np.zeros((len(campaign), 1)))
    with pytest.raises(CampaignError, match="state no uncertainty at some point"):
        examine(calibration, certain)


@pytest.mark.parametrize("kind", ["landmark", "distance"])
def test_errors_of_single_joints_add_up_to_that_of_all(kind):
    """Joints err each by itself: their variances add, whichever of them err."""
    model, campaign = measured(kind, 2, rows=40)
    calibration = replace(fit_of(model)(campaign), range_growth=0.0)
    errors = np.array([1e-4, 0.0, 3e-4, 0.0, 2e-4, 5e-4])

    def added(joint_error):
        stated = replace(calibration, joint_error=tuple(joint_error))
        return [
            covariance_on(stated, campaign, campaign.covariances())
            - covariance_on(calibration, campaign, campaign.covariances()),
            stated.predict_covariance(campaign.q[:5]) - calibration.predict_covariance(campaign.q[:5]),
        ]

    each = [added(error) for error in np.diag(errors)]
    for whole, *parts in zip(added(errors), *each, strict=True):
        np.testing.assert_allclose(whole, sum(parts), atol=1e-6 * np.abs(whole).max())
        assert np.abs(whole).max() > 1e-9
