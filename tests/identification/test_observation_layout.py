from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from taskcal.geometry import se3
from taskcal.identification.identify import identify
from taskcal.identification.layout import frame_precision, layout_of, problem_of
from taskcal.identification.problem import linearise_rows, whitener
from taskcal.kernels import walk
from taskcal.kernels.covariance import propagate
from taskcal.kernels.normal_equations import HUBER, SQUARED, normal_equations
from taskcal.observations import Point, Pose
from taskcal.registration.registration import register
from taskcal.virtual.cell import simulate
from tests.identification.arms import KINDS, arm
from tests.laws.observations import KINDS_WITHOUT_TRACKER, observed, observed_with_points

seeds = st.integers(0, 2**32 - 1)


def tracked(seed, kind, rows=25):
    """What a tracker measured, as it is and as observations like any other."""
    rng, model = arm(seed)
    options = dict(KINDS[kind])
    options.pop("rotation_sigma", None)
    targets = {f"t{k}": rng.normal(size=3) * 0.1 for k in range(options.pop("targets", 1))}
    q = rng.uniform(-2.0, 2.0, (rows, 6))
    campaign, _ = simulate(model, q, rng=rng, targets=targets, **options)
    one = Pose() if campaign.rotations is not None else Point()
    return model, campaign, replace(campaign, observations=(one,) * len(campaign.targets))


@pytest.mark.parametrize("kind", KINDS)
@settings(max_examples=4)
@given(seeds)
def test_a_tracker_s_points_and_poses_are_observations_like_any_other(kind, seed):
    model, plain, general = tracked(seed, kind)
    kept, registration = np.arange(len(model)), register(model, plain)
    problems = [
        problem_of(layout_of(model, kept, registration, campaign, fixed=False), campaign, None)
        for campaign in (plain, general)
    ]
    a, b = problems
    assert a.frames.names == b.frames.names
    np.testing.assert_allclose(a.noise[a.seen.valid], b.noise[b.seen.valid], rtol=1e-14)
    rng = np.random.default_rng(seed)
    z = a.frames.start() + 1e-3 * rng.normal(size=len(a.frames.names))
    W = whitener(a.noise)
    for loss in (SQUARED, HUBER):
        cost, g, H = a.equations(W, loss, 1.5)(z)
        other_cost, other_g, other_H = b.equations(W, loss, 1.5)(z)
        size = np.sqrt(np.diag(H) + 1e-300)
        np.testing.assert_allclose(other_cost, cost, rtol=1e-12)
        np.testing.assert_allclose(other_g / size, g / size, rtol=0, atol=1e-11 * np.abs(g / size).max())
        np.testing.assert_allclose(other_H / np.outer(size, size), H / np.outer(size, size), rtol=0, atol=1e-12)
    C = np.diag(rng.uniform(1e-8, 1e-6, len(z)))
    for x, y in zip(a.propagate(z, C), b.propagate(z, C), strict=True):
        np.testing.assert_allclose(y, x, rtol=1e-9, atol=1e-15)
    dense, other = linearise_rows(a, z), linearise_rows(b, z)
    np.testing.assert_allclose(other.residual, dense.residual, rtol=1e-9, atol=1e-13)
    positions = np.arange(dense.residual.shape[1]) % b.frames.block_size < 3
    np.testing.assert_allclose(other.by_entry[:, positions], dense.by_entry[:, positions], rtol=1e-9, atol=1e-13)
    np.testing.assert_allclose(other.by_joint[:, positions], dense.by_joint[:, positions], rtol=1e-9, atol=1e-13)


@pytest.mark.parametrize("kind", KINDS)
def test_a_tracker_s_campaign_gives_the_same_calibration_either_way(kind):
    model, plain, general = tracked(3, kind, rows=40)
    a, b = identify(model, plain), identify(model, general)
    assert a.all_names == b.all_names
    sigma = np.sqrt(np.diag(a.z_covariance))
    np.testing.assert_allclose(b.z / sigma, a.z / sigma, rtol=0, atol=2e-5)
    np.testing.assert_allclose(
        b.z_covariance / np.outer(sigma, sigma), a.z_covariance / np.outer(sigma, sigma), atol=1e-6
    )
    np.testing.assert_allclose(b.model_error, a.model_error, rtol=1e-5)
    np.testing.assert_allclose(b.residuals, a.residuals, atol=1e-10)
    np.testing.assert_allclose(b.studentised, a.studentised, rtol=1e-4)


@pytest.mark.parametrize("kind", KINDS_WITHOUT_TRACKER)
@settings(max_examples=4)
@given(seeds)
def test_what_is_predicted_moves_as_its_derivative_says(kind, seed):
    model, campaign, _ = observed(kind, seed, rows={"distance": 40, "cube": 30}.get(kind, 16))
    registration = register(model, campaign)
    problem = problem_of(layout_of(model, np.arange(len(model)), registration, campaign, fixed=False), campaign, None)
    rng = np.random.default_rng(seed)
    z = problem.frames.start() + 1e-3 * rng.normal(size=len(problem.frames.names))
    at, h = linearise_rows(problem, z), 1e-6
    for i in range(len(z)):
        step = h * np.eye(len(z))[i]
        moved = (linearise_rows(problem, z - step).residual - linearise_rows(problem, z + step).residual) / (2 * h)
        np.testing.assert_allclose(at.by_entry[:, :, i], moved, rtol=1e-5, atol=2e-7, err_msg=problem.frames.names[i])


@pytest.mark.parametrize("kind", KINDS_WITHOUT_TRACKER)
def test_the_streamed_equations_are_those_of_the_dense_rows_and_of_what_is_stated(kind):
    model, campaign, _ = observed_with_points(kind, 5)
    registration = register(model, campaign)
    problem = problem_of(layout_of(model, np.arange(len(model)), registration, campaign, fixed=False), campaign, None)
    z = problem.frames.start()
    W = whitener(problem.noise)
    cost, g, H = problem.equations(W, SQUARED, 1.0)(z)
    at = linearise_rows(problem, z)
    n, targets, b = W.shape[:3]
    r = np.einsum("ntij,ntj->nti", W, at.residual.reshape(n, targets, b)).reshape(-1)
    A = np.einsum("ntij,ntjk->ntik", W, at.by_entry.reshape(n, targets, b, -1)).reshape(len(r), -1)
    known = problem.frames.stated(z, problem.kinds)
    if known is not None:
        r, A = np.concatenate([r, known.residual]), np.concatenate([A, known.by_entry])
    np.testing.assert_allclose(cost, 0.5 * r @ r, rtol=1e-9)
    size = np.sqrt(np.diag(H) + 1e-300)
    np.testing.assert_allclose(g / size, A.T @ r / size, rtol=0, atol=1e-9 * np.abs(g / size).max())
    np.testing.assert_allclose(H / np.outer(size, size), A.T @ A / np.outer(size, size), rtol=0, atol=1e-11)


@pytest.mark.parametrize("kind", KINDS_WITHOUT_TRACKER)
def test_rows_that_are_kept_say_what_streamed_ones_do(kind):
    model, campaign, _ = observed_with_points(kind, 5)
    registration = register(model, campaign)
    problem = problem_of(layout_of(model, np.arange(len(model)), registration, campaign, fixed=False), campaign, None)
    z, W = problem.frames.start(), whitener(problem.noise)
    walked = problem.walked(z)
    seen, rows = problem.linearised(walked, z), problem.kept_rows(z)
    cost, g, H = normal_equations(walked, seen, W)
    size = np.sqrt(np.diag(H) + 1e-300)
    kept = rows.equations(W)
    np.testing.assert_allclose(kept[0], cost, rtol=1e-12)
    np.testing.assert_allclose(kept[1] / size, g / size, rtol=0, atol=1e-11 * np.abs(g / size).max())
    np.testing.assert_allclose(kept[2] / np.outer(size, size), H / np.outer(size, size), rtol=0, atol=1e-12)
    C = np.diag(np.random.default_rng(0).uniform(1e-8, 1e-6, len(z)))
    for kept_one, streamed in zip(rows.propagate(C), propagate(walked, seen, C), strict=True):
        np.testing.assert_allclose(kept_one, streamed, rtol=1e-9, atol=1e-15)
    assert problem.kept_rows(z) is rows
    assert problem.kept_rows(z + 1e-6) is not rows


def test_the_prior_of_the_frames_holds_what_no_row_tells():
    model, campaign, _ = observed("socket", 1)
    registration = replace(register(model, campaign), unobservable=np.diag([0.0, 0.0, 1.0]))
    layout = layout_of(model, np.arange(len(model)), registration, campaign, fixed=False)
    loose = np.diag(frame_precision(layout))
    assert loose[2] > 1e9
    assert (np.delete(loose, 2) <= 1.0).all()


def test_frames_that_are_held_have_no_columns():
    model, campaign, _ = observed("socket", 1)
    layout = layout_of(model, np.arange(len(model)), register(model, campaign), campaign, fixed=True)
    problem = problem_of(layout, campaign, None)
    assert layout.names == model.names
    assert layout.stated(layout.start(), campaign.observations) is None
    walked = problem.walked(layout.start())
    T = walk.poses(walked.chain, walked.s, walked.e)
    np.testing.assert_allclose(T, se3.pose(T[:, :3, :3], T[:, :3, 3]))
    assert np.isfinite(problem.equations(whitener(problem.noise), SQUARED, 1.0)(layout.start())[0])
