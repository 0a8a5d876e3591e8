"""The doctor's quick and linear fits: what they leave of exact points, of wrong ones, and of small defects."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from taskcal.diagnosis.fits import MIN_ERROR_M, fit_linearly, misfits
from taskcal.diagnosis.hypotheses import Case
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from tests.laws.campaigns import measure, random_pose

ROBOT = load_robot("ur5")
MODEL = ErrorModel(ROBOT)
ROWS, LEVER = 24, 0.3


def exact(seed, **kind):
    """Tool poses, and what an exact tracker measures of the nominal robot."""
    rng = np.random.default_rng(seed)
    q = rng.uniform(-1.5, 1.5, (ROWS, 6))
    return rng, MODEL.poses(q), measure(rng, MODEL, q, **kind)[0]


@pytest.mark.parametrize("kind", [{}, {"targets": 3, "lost": 0.1}, {"pose": True}], ids=["point", "lost", "pose"])
@pytest.mark.parametrize("seed", range(2))
def test_a_misfit_is_the_geometric_mean_of_what_is_off(kind, seed):
    """Exact points leave the least there is, wherever robot and tracker stand; wrong ones count by the logarithm of their error."""
    rng, T, campaign = exact(seed, **kind)
    moved, wrong = random_pose(rng, 2.0) @ T, T[rng.permutation(ROWS)]
    rotations = None if campaign.rotations is None else np.stack([campaign.rotations] * 3)
    found = misfits(np.stack([T, moved, wrong]), np.stack([campaign.points] * 3), rotations, LEVER)
    np.testing.assert_allclose(found[:2], MIN_ERROR_M, rtol=1e-3)
    assert found[2] > 100.0 * MIN_ERROR_M
    points, seen = campaign.points.copy(), campaign.valid
    far = rng.permutation(np.flatnonzero(seen[:, 0]))[:3]
    points[far, 0] += 0.04 * np.array([0.6, -0.8, 0.0])
    share = 3.0 / seen.sum()
    off = misfits(T[None], points[None], None if rotations is None else rotations[:1], LEVER)
    np.testing.assert_allclose(off, MIN_ERROR_M ** (1.0 - share) * 0.04**share, rtol=1e-3)


def test_a_wrong_rotation_counts_as_the_chord_at_its_lever():
    rng, T, campaign = exact(3, pose=True)
    rotations = campaign.rotations.copy()
    far = rng.permutation(ROWS)[:4]
    rotations[far] = rotations[far] @ Rotation.from_rotvec([0.3, 0.0, 0.4]).as_matrix()
    off = misfits(T[None], campaign.points[None], rotations[None], LEVER)
    chord, share = 2.0 * LEVER * np.sin(0.25), 4.0 / ROWS
    np.testing.assert_allclose(off, MIN_ERROR_M ** (1.0 - share) * chord**share, rtol=1e-3)


def test_poses_where_a_loop_does_not_close_are_left_out_if_few():
    _, T, campaign = exact(4)
    some, many = T.copy(), T.copy()
    some[:3], many[:8] = np.nan, np.nan
    few, most = misfits(np.stack([some, many]), np.stack([campaign.points] * 2), None, LEVER)
    assert few == pytest.approx(MIN_ERROR_M, rel=1e-3)
    assert most == np.inf


@pytest.mark.parametrize("targets", [1, 3])
def test_defects_within_tolerance_are_explained_linearly(targets):
    """To second order of the defects: the nominal robot leaves a hundred times as much."""
    rng = np.random.default_rng(5)
    q = rng.uniform(-1.5, 1.5, (40, 6))
    x = 0.1 * rng.normal(size=len(MODEL)) * MODEL.tolerances
    campaign, _ = measure(rng, MODEL, q, x, targets=targets)
    rows = rng.permutation(40)[:32]
    fit = fit_linearly(Case.of(ROBOT, campaign), rows)
    nominal = np.linalg.norm(fit.residual, axis=1)
    assert fit.distance.max() < 0.05 * nominal.max()
    assert np.sqrt(np.mean(fit.distance**2)) < 0.03 * np.sqrt(np.mean(nominal**2))
    assert sorted(set(fit.rows.tolist())) == sorted(rows.tolist())
    turned = fit_linearly(
        Case.of(ROBOT, replace(campaign, points=campaign.points @ random_pose(rng, 1.0)[:3, :3])), rows
    )
    np.testing.assert_allclose(turned.distance, fit.distance, atol=0.01 * nominal.max())
