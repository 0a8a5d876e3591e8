"""Residuals beside their stated covariances: regions and outliers of what each kind measures, target by target."""

import numpy as np
import pytest
from scipy.stats import chi2

from taskcal.campaigns.campaign import Campaign
from taskcal.identification.held_out import in_regions, studentise
from taskcal.observations import Lengths, Point, Pose

KINDS = (Point(), Pose(), Lengths(anchors=("a",), of=np.zeros(400, dtype=int)))
"""Lengths alone, lengths and angles, and a single number."""


def residuals(rng, kinds, n=400):
    """Residuals as likely as their covariances say, all that a kind does not measure zero; and a target that nobody saw."""
    residual, own = np.zeros((n, len(kinds) + 1, 6)), np.zeros((n, len(kinds) + 1, 6, 6))
    for t, kind in enumerate((*kinds, Point())):
        block = kind.block()
        root = (1e-4, 1.0)[t % 2] * (np.eye(len(block)) + 0.1 * rng.normal(size=(n, len(block), len(block))))
        own[:, t][:, *np.ix_(block, block)] = root @ np.swapaxes(root, 1, 2)
        residual[:, t, block] = (root @ rng.normal(size=(n, len(block), 1)))[..., 0]
    residual[:, -1] = np.nan
    return residual, own, own.copy()


def alone(residual, own, block):
    """Squares of residuals in units of their covariances, by NumPy."""
    part = own[:, *np.ix_(block, block)]
    return np.einsum("ni,nij,nj->n", residual[:, block], np.linalg.inv(part), residual[:, block])


@pytest.mark.parametrize("order", [(0, 1, 2), (2, 0, 1), (1, 2, 0)])
def test_each_target_is_judged_by_what_its_kind_measures(order):
    """In whatever order they stand, one that nobody saw among them."""
    kinds = tuple(KINDS[k] for k in order)
    residual, own, noise = residuals(np.random.default_rng(0), kinds)
    last = [len(kinds), *range(len(kinds))]  # the target that nobody saw comes first
    residual, own, noise = residual[:, last], own[:, last], noise[:, last]
    lengths = in_regions(residual, own, noise, (Point(), *kinds))
    angles = in_regions(residual, own, noise, (Point(), *kinds), rotations=True)
    assert np.isnan(lengths[:, 0]).all()
    for t, kind in enumerate(kinds, 1):
        block = kind.block()[:3]
        limit = chi2.ppf(0.95, len(block))
        np.testing.assert_array_equal(lengths[:, t], alone(residual[:, t], own[:, t], block) <= limit)
        assert np.mean(lengths[:, t]) == pytest.approx(0.95, abs=0.035)
        if kind.angles:
            np.testing.assert_array_equal(
                angles[:, t], alone(residual[:, t], own[:, t], [3, 4, 5]) <= chi2.ppf(0.95, 3)
            )
        else:
            assert np.isnan(angles[:, t]).all()


def test_directions_that_a_fit_follows_are_not_judged():
    """A residual of no variance is none; the others have so many degrees of freedom less."""
    rng = np.random.default_rng(1)
    residual, own = np.zeros((300, 1, 3)), np.zeros((300, 1, 3, 3))
    R = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    own[:] = R @ np.diag([1e-8, 1e-8, 0.0]) @ R.T
    residual[:, 0] = 1e-4 * rng.normal(size=(300, 2)) @ R[:, :2].T
    noise = np.tile(1e-8 * np.eye(3), (300, 1, 1, 1))
    inside = in_regions(residual, own, noise, (Point(),))[:, 0]
    square = (residual[:, 0] ** 2).sum(axis=1) / 1e-8
    np.testing.assert_array_equal(inside, square <= chi2.ppf(0.95, 2))
    assert np.isnan(in_regions(residual, 0.0 * own, noise, (Point(),))).all()


def test_outliers_are_those_beyond_chance_among_all_points():
    """Their lengths are those of their own covariances, the longest first; the level is shared among all points."""
    residual, own, noise = residuals(np.random.default_rng(2), KINDS)
    residual[5, 1] *= 9.0
    residual[17, 0, :3] *= 7.0
    points = np.zeros((400, 4, 3))
    points[:, 3] = np.nan
    campaign = Campaign(
        ids=tuple(f"p{i}" for i in range(400)),
        q=np.zeros((400, 6)),
        targets=("a", "b", "c", "d"),
        points=points,
        rotations=np.tile(np.eye(3), (400, 1, 1)),
        observations=(*KINDS, Point()),
        rows=np.arange(400) + 1000,
    )
    lengths, outliers = studentise(residual, own, noise, campaign, 0.01)
    expected = []
    for t, kind in enumerate(KINDS):
        square = alone(residual[:, t], own[:, t], kind.block())
        np.testing.assert_allclose(lengths[:, t] ** 2, square, rtol=1e-6)
        beyond = np.flatnonzero(chi2.sf(square, len(kind.block())) < 0.01 / 1200)
        expected += [(float(square[i]) ** 0.5, f"p{i}", "abc"[t]) for i in beyond]
    assert [(o.id, o.target) for o in outliers] == [
        (name, target) for _, name, target in sorted(expected, reverse=True)
    ]
    assert len(outliers) >= 1
    assert all(o.row == 1000 + int(o.id[1:]) for o in outliers)
    assert [o.residual for o in outliers] == pytest.approx(
        [np.linalg.norm(residual[int(o.id[1:]), "abc".index(o.target), :3]) for o in outliers]
    )
    assert np.isnan(lengths[:, 3]).all()
