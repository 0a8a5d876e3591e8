"""Beyond the measured range: regions hold though the model error is smooth, and effects do no harm."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.special import chdtri

from taskcal.identification.effects import explain
from taskcal.identification.holdout import about_calibration, end_parts, errors_of_parts
from taskcal.identification.identify import identify
from taskcal.identification.options import FitOptions
from taskcal.identification.problem import problem_of
from taskcal.robot.catalogue import load_robot
from taskcal.robot.effects import SPECTRUM, Harmonics, JointField
from taskcal.robot.error_model import ErrorModel
from taskcal.virtual.cell import draw_defects, simulate

PLAIN = ErrorModel(load_robot("ur10"))
HALF = np.radians(60.0)


def measured(seed, *, narrow=HALF, poses=60):
    """A robot with a smooth error of no effect's form, measured with one joint in a narrower range, and poses beyond that."""
    rng = np.random.default_rng(seed)
    true = PLAIN + JointField(tolerance=5e-5, length=0.8, seed=seed)
    joint, half = seed % 6, np.full(6, HALF)
    half[joint] = narrow
    q, new = rng.uniform(-half, half, (poses, 6)), rng.uniform(-half, half, (50, 6))
    new[:, joint] = half[joint] * rng.uniform(1.0, 1.7, 50)
    x = draw_defects(true, rng)
    return tuple(simulate(true, rows, rng=rng, x=x, model_error=1e-5)[0] for rows in (q, new))


def inside(calibration, campaign):
    error = calibration.residuals_on(campaign)[:, 0]
    C = (calibration.predict_covariance(campaign.q) + campaign.covariances())[:, 0]
    return np.einsum("ni,ni->n", error, np.linalg.solve(C, error[..., None])[..., 0]) < chdtri(3, 0.05)


def test_regions_hold_at_ends_of_a_robot_with_a_smooth_error():
    """Regions of geometry alone hold beyond the measured range; without their growth they do not."""
    shares, before = [], []
    for seed in range(12):
        campaign, new = measured(seed)
        calibration = identify(PLAIN, campaign)
        shares.append(inside(calibration, new).mean())
        before.append(inside(replace(calibration, range_growth=0.0), new).mean())
    assert np.mean(shares) > 0.9
    assert np.mean(before) < np.mean(shares) - 0.02


def test_growth_leaves_the_measured_range_as_it_is():
    campaign, new = measured(0)
    calibration = identify(PLAIN, campaign)
    without = replace(calibration, range_growth=0.0)
    np.testing.assert_array_equal(calibration.predict_covariance(campaign.q), without.predict_covariance(campaign.q))
    ratio = calibration.predict_covariance(new.q) / without.predict_covariance(new.q)
    u = calibration.measured_range.extrapolation(new.q)
    np.testing.assert_allclose(
        ratio, np.broadcast_to((1.0 + calibration.range_growth * u)[:, None, None, None], ratio.shape)
    )


def test_errors_at_ends_are_those_of_fits_without_their_rows():
    campaign, _ = measured(1)
    options = FitOptions(model_error=3e-5, prior_scale=1.0)
    calibration = identify(PLAIN, campaign, model_error=3e-5, prior_scale=1.0)
    problem = problem_of(calibration.layout, campaign, None)
    parts = end_parts(problem)
    assert len(parts) == 12
    errors = errors_of_parts(about_calibration(calibration, problem, options), parts[:4])
    for part, error in zip(parts[:4], errors.whole, strict=True):
        rest = campaign.take(np.setdiff1d(np.arange(len(campaign)), part))
        fitted = identify(PLAIN, rest, model_error=3e-5, prior_scale=1.0)
        assert error == pytest.approx(np.linalg.norm(fitted.residuals_on(campaign.take(part)), axis=2).mean(), rel=1e-2)


def test_an_order_competes_as_far_as_its_period_was_covered():
    q = np.zeros((2, 6))
    q[1] = np.radians([90.0, 360.0, 15.0, 0.0, 45.0, 180.0])
    share = Harmonics(orders=(1, 4)).participation(PLAIN.robot, q).reshape(6, 2, 2)[:, :, 0]
    narrow = 4.0 / np.pi  # power of a joint that moved 45°
    np.testing.assert_allclose(share[:3], [[0.25, 1.0], [1.0, 1.0], [0.01, 0.01]])
    np.testing.assert_allclose(share[4:], [[0.125**narrow, 0.5**narrow], [0.5, 1.0]])
    assert 0.0 < share[3].max() < 0.02


@pytest.mark.long
def test_effects_do_no_harm_beyond_a_narrow_range():
    """One joint in 15° is asked up to 5° beyond: orders of its gear, which competed, are no worse than geometry alone."""
    ratios = []
    for seed in range(4):
        campaign, new = measured(seed, narrow=np.radians(7.5))
        fits = identify(PLAIN, campaign), explain(PLAIN, campaign, candidates=[SPECTRUM]).calibration
        geometry, auto = (np.linalg.norm(fit.residuals_on(new)[:, 0], axis=1).mean() for fit in fits)
        ratios.append(auto / geometry)
    assert np.mean(ratios) < 1.15, ratios
