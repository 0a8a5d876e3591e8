"""Against dense Gaussian conditioning with a start that is as good as unknown."""

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from taskcal.campaigns.drift import smooth

DIFFUSE_DEVIATION = 100.0


def draw(rng, n, step, white, noise):
    course = np.cumsum(rng.normal(scale=step, size=n)) + rng.normal(scale=white, size=n) + rng.normal()
    seen = course + rng.normal(size=n) * np.sqrt(noise)
    seen[rng.random(n) < 0.1] = np.nan
    return course, seen


def prior(n, step, white):
    """Covariance of the course, whose first row may be anywhere."""
    rows = np.arange(n)
    return DIFFUSE_DEVIATION**2 + step**2 * np.minimum.outer(rows, rows) + white**2 * np.eye(n)


@pytest.mark.parametrize("seed", range(3))
def test_smoother_is_conditional_mean_at_likeliest_variances(seed):
    """The smoothed course is the conditional mean, and the variances maximise the likelihood."""
    rng = np.random.default_rng(seed)
    n, noise = 150, rng.uniform(0.01, 0.04, 150)
    _, seen = draw(rng, n, 0.1, 0.2, noise)
    known = ~np.isnan(seen)
    found = smooth(seen, noise)

    K = prior(n, found.step, found.white)
    gain = K[:, known] @ np.linalg.inv(K[np.ix_(known, known)] + np.diag(noise[known]))
    np.testing.assert_allclose(found.mean, gain @ seen[known], atol=5e-5)
    np.testing.assert_allclose(found.variance, np.diag(K - gain @ K[known]), rtol=1e-3, atol=1e-6)

    def likelihood(step, white):
        S = prior(n, step, white)[np.ix_(known, known)] + np.diag(noise[known])
        return multivariate_normal.logpdf(seen[known], cov=S)

    best = likelihood(found.step, found.white)
    for factor in (0.8, 1.25):
        assert likelihood(found.step * factor, found.white) < best
        assert likelihood(found.step, found.white * factor) < best


def test_intervals_cover_the_true_course():
    rng = np.random.default_rng(0)
    noise = np.full(400, 0.01)
    course, seen = draw(rng, 400, 0.05, 0.1, noise)
    found = smooth(seen, noise)
    scaled = (found.mean - course) / np.sqrt(found.variance)
    assert 0.85 < np.sqrt(np.mean(scaled**2)) < 1.15


def test_what_stands_still_is_told_far_better_than_by_each_row():
    rng = np.random.default_rng(1)
    noise = np.full(300, 1e-4)
    found = smooth(rng.normal(scale=1e-2, size=300), noise)
    assert np.abs(found.mean).max() < 4e-3
    assert found.step < 1e-3
    assert found.white < 4e-3


def test_white_component_is_zero_without_own_noise():
    """Without a white component of its own, all white variation counts as measurement noise."""
    rng = np.random.default_rng(2)
    noise = np.full(300, 0.04)
    course, seen = draw(rng, 300, 0.02, 0.0, noise)
    found = smooth(seen, noise, own_noise=False)
    assert found.white == 0.0
    assert np.std(found.mean - course) < 0.5 * np.nanstd(seen - course)
