"""Outliers: a residual's length in its own standard deviations, and those too long for chance."""

import numpy as np
import pytest
from scipy.stats import chi2

from taskcal.campaigns.campaign import Campaign
from taskcal.identification.held_out import shared_with_neighbours, studentise


def campaign_of(points: np.ndarray, *, poses: bool = False) -> Campaign:
    n, targets = points.shape[:2]
    names = tuple(f"smr{t + 1}" for t in range(targets))
    rotations = np.tile(np.eye(3), (n, 1, 1)) if poses else None
    return Campaign(
        ids=tuple(f"p{i}" for i in range(n)), q=np.zeros((n, 6)), targets=names, points=points, rotations=rotations
    )


@pytest.mark.parametrize("width", [3, 6])
def test_the_length_is_that_of_the_whitened_residual(width: int) -> None:
    rng = np.random.default_rng(0)
    factor = rng.normal(size=(20, 2, width, width))
    own = factor @ np.swapaxes(factor, -1, -2) + 0.1 * np.eye(width)
    residual = rng.normal(size=(20, 2, width))
    points = np.zeros((20, 2, 3))
    points[4, 1] = residual[4, 1] = np.nan
    lengths, _ = studentise(residual, own, own, campaign_of(points, poses=width == 6), 0.01)
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


def test_outlier_limit_is_bonferroni_quantile_longest_first() -> None:
    """The limit is the quantile shared among all points, and outliers are listed by falling length."""
    own = np.broadcast_to(np.eye(3), (50, 2, 3, 3))
    limit = np.sqrt(chi2.isf(0.05 / 100, 3))
    residual = np.zeros((50, 2, 3))
    residual[7, 1, 0], residual[31, 0, 2], residual[12, 0, 1] = 1.001 * limit, -2.0 * limit, 0.999 * limit
    _, outliers = studentise(residual, own, own, campaign_of(np.zeros((50, 2, 3))).take(range(50)), 0.05)
    assert [(o.row, o.id, o.target) for o in outliers] == [(31, "p31", "smr1"), (7, "p7", "smr2")]
    assert outliers[0].residual == pytest.approx(2.0 * limit)


def test_false_outlier_rate_equals_level() -> None:
    """A campaign without outliers names one as often as the level states."""
    rng = np.random.default_rng(1)
    own, campaign = np.broadcast_to(np.eye(3), (40, 1, 3, 3)), campaign_of(np.zeros((40, 1, 3)))
    named = sum(bool(studentise(rng.normal(size=(40, 1, 3)), own, own, campaign, 0.1)[1]) for _ in range(1000))
    assert 70 < named < 130  # three standard deviations about 95


def judged(residual: np.ndarray, q: np.ndarray) -> dict[int | None, bool]:
    """Whether neighbours share the error, of every outlier by its row; unit noise."""
    own = np.broadcast_to(np.eye(3), (*residual.shape, 3))
    lengths, outliers = studentise(residual, own, own, campaign_of(np.zeros_like(residual)), 0.01)
    return dict(zip((o.row for o in outliers), shared_with_neighbours(outliers, residual, lengths, q), strict=True))


@pytest.mark.parametrize("order", ["rows", "poses"])
def test_outliers_that_neighbours_share_are_model_error(order: str) -> None:
    """Ten rows or poses beside each other have an error in common, the longest of which are outliers; one reading is wrong."""
    rng = np.random.default_rng(2)
    q = np.linspace(0.0, 3.0, 100)[:, None] * np.ones(6) + 0.01 * rng.normal(size=(100, 6))
    residual = rng.normal(size=(100, 1, 3))
    residual[40:50, 0] += [3.0, 3.0, 0.0]
    residual[80, 0] = [0.0, 7.0, 0.0]
    mixed = rng.permutation(100)
    if order == "rows":  # poses beside each other are anywhere
        q = q[mixed]
    else:
        residual, q = residual[mixed], q[mixed]
    named = judged(residual, q)
    wrong = 80 if order == "rows" else int(np.flatnonzero(mixed == 80)[0])
    assert not named.pop(wrong)
    assert 1 <= len(named) < 10
    assert all(named.values())


def test_outlier_of_one_posture_shot_thrice_is_a_reading() -> None:
    """Three shots of one posture share its wrong joint values, which no neighbouring pose does."""
    rng = np.random.default_rng(3)
    q = np.repeat(rng.uniform(-1.0, 1.0, (30, 6)), 3, axis=0)
    residual = rng.normal(size=(90, 1, 3))
    residual[30:33, 0] = [8.0, 0.0, 0.0]
    assert judged(residual, q) == {30: False, 31: False, 32: False}


def test_sound_neighbours_seldom_excuse_a_wrong_reading() -> None:
    rng = np.random.default_rng(4)
    excused = 0
    for _ in range(300):
        residual = rng.normal(size=(60, 2, 3))
        residual[20, 1] = 6.0 * np.array([0.0, 0.6, 0.8])
        residual[3, 1] = np.nan
        excused += judged(residual, rng.uniform(-1.0, 1.0, (60, 6)))[20]
    assert excused <= 6
