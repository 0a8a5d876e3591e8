"""Outliers: a residual's length in its own standard deviations, and those too long for chance."""

import numpy as np
import pytest
from scipy.stats import chi2

from taskcal.identification.outlier import studentise
from taskcal.measurement.campaign import Campaign


def campaign_of(points: np.ndarray) -> Campaign:
    n, targets = points.shape[:2]
    names = tuple(f"smr{t + 1}" for t in range(targets))
    return Campaign(ids=tuple(f"p{i}" for i in range(n)), q=np.zeros((n, 6)), targets=names, points=points)


@pytest.mark.parametrize("width", [3, 6])
def test_the_length_is_that_of_the_whitened_residual(width: int) -> None:
    rng = np.random.default_rng(0)
    factor = rng.normal(size=(20, 2, width, width))
    own = factor @ np.swapaxes(factor, -1, -2) + 0.1 * np.eye(width)
    residual = rng.normal(size=(20, 2, width))
    points = np.zeros((20, 2, 3))
    points[4, 1] = residual[4, 1] = np.nan
    lengths, _ = studentise(residual, own, own, campaign_of(points), 0.01)
    white = np.linalg.solve(np.linalg.cholesky(own), residual[..., None])[..., 0]
    np.testing.assert_allclose(lengths, np.linalg.norm(white, axis=2), rtol=1e-9)
    assert np.isnan(lengths[4, 1])
    assert np.isnan(lengths).sum() == 1


def test_a_direction_that_the_fit_follows_entirely_is_not_judged() -> None:
    own = np.broadcast_to(np.diag([1.0, 1.0, 0.0]), (4, 1, 3, 3))
    residual = np.full((4, 1, 3), 2.0)
    lengths, _ = studentise(
        residual, own, np.broadcast_to(np.eye(3), own.shape), campaign_of(np.zeros((4, 1, 3))), 0.01
    )
    np.testing.assert_allclose(lengths, np.sqrt(8.0))


def test_the_limit_is_the_quantile_shared_among_all_points_and_the_longest_comes_first() -> None:
    own = np.broadcast_to(np.eye(3), (50, 2, 3, 3))
    limit = np.sqrt(chi2.isf(0.05 / 100, 3))
    residual = np.zeros((50, 2, 3))
    residual[7, 1, 0], residual[31, 0, 2], residual[12, 0, 1] = 1.001 * limit, -2.0 * limit, 0.999 * limit
    _, outliers = studentise(residual, own, own, campaign_of(np.zeros((50, 2, 3))).take(range(50)), 0.05)
    assert [(o.row, o.id, o.target) for o in outliers] == [(31, "p31", "smr1"), (7, "p7", "smr2")]
    assert outliers[0].residual == pytest.approx(2.0 * limit)


def test_a_sound_campaign_names_any_outlier_as_often_as_the_level_says() -> None:
    rng = np.random.default_rng(1)
    own, campaign = np.broadcast_to(np.eye(3), (40, 1, 3, 3)), campaign_of(np.zeros((40, 1, 3)))
    named = sum(bool(studentise(rng.normal(size=(40, 1, 3)), own, own, campaign, 0.1)[1]) for _ in range(1000))
    assert 70 < named < 130  # three standard deviations about 95
