"""Rows under errors of single poses and sizes of groups, against the normal distribution written out."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import approx_fprime, minimize
from scipy.stats import multivariate_normal

from taskcal.estimation.group_variances import Groups
from taskcal.estimation.noisy_rows import MAX_STEPS, NoisyFit, NoisyRows, PoseNoise, maximise, weigh

GAIN = 1e-6
GROUP = np.array([0, 0, 0, 0, 1, 1, 1, 1, -1])
STANDING = PoseNoise(position=0.3, rotation=None, joints=np.array([0.2]), expected=0.5, width=2.0)
SIZES = np.array([0.4, -1.0])


def noisy_rows(poses: int = 30, seed: int = 0) -> NoisyRows:
    """Poses of three numbers, with a white error and one of a joint."""
    rng, n, p = np.random.default_rng(seed), poses, len(GROUP)
    A, along = rng.normal(size=(n, 3, p)), rng.normal(size=(n, 3))
    x = np.where(GROUP == 0, 2.0, 0.5) * rng.normal(size=p)
    errors = 0.4 * rng.normal(size=(n, 3)) + 0.7 * along * rng.normal(size=(n, 1)) + 0.3 * rng.normal(size=(n, 3))
    return NoisyRows(
        groups=Groups(
            group=GROUP, held=np.eye(1) / 4.0, location=np.zeros(2), spread=np.array([[9.0, 2.0], [2.0, 4.0]])
        ),
        A=A,
        y=A @ x + errors,
        seen=np.ones((n, 3), dtype=bool),
        noise=np.broadcast_to(0.09 * np.eye(3), (n, 1, 3, 3)),
        units=[np.broadcast_to(np.eye(3), (n, 3, 3)), along[:, :, None] * along[:, None, :]],
        beside=(rng.normal(size=(2, p)), rng.normal(size=2)),
    )


def at_logs(rows: NoisyRows, logs: np.ndarray) -> NoisyFit:
    return rows.under(STANDING.with_variances(np.exp(logs[:2])), logs[2:])


def test_log_posterior_is_that_of_the_normal_distribution():
    rows, logs = noisy_rows(8), np.log([0.3, 0.2, 1.5, 0.4])
    found = at_logs(rows, logs)
    D = np.diag(np.where(GROUP < 0, 4.0, np.exp(found.found.log_variances)[GROUP]))
    A = np.concatenate([rows.A.reshape(24, -1), rows.beside[0]])
    R = np.eye(26)
    for i in range(8):
        R[3 * i : 3 * i + 3, 3 * i : 3 * i + 3] = 0.09 * np.eye(3) + 0.3 * rows.units[0][i] + 0.2 * rows.units[1][i]
    y = np.concatenate([rows.y.reshape(-1), rows.beside[1]])
    expected = multivariate_normal(cov=R + A @ D @ A.T).logpdf(y) + 13.0 * np.log(2.0 * np.pi)
    expected -= 0.5 * logs[2:] @ np.linalg.solve(rows.groups.spread, logs[2:])
    expected -= 0.5 * ((logs[:2] - np.log(0.5)) ** 2).sum() / 4.0
    assert found.log_posterior == pytest.approx(expected)


def test_scores_are_the_gradient_of_the_log_posterior():
    rows, logs = noisy_rows(), np.log([0.3, 0.2, 1.5, 0.4])
    numeric = approx_fprime(logs, lambda at: at_logs(rows, at).log_posterior, 1e-6)
    np.testing.assert_allclose(at_logs(rows, logs).ascent().gradient, numeric, rtol=1e-4, atol=1e-4)


@pytest.mark.parametrize("noise", [0.09, 30.0])
def test_the_search_ends_at_the_maximum_wherever_it_starts(noise: float):
    """Errors and sizes a hundredth and a hundred times as large to begin with, next to nothing beside the noise or not, against
    SciPy."""
    rows = noisy_rows()
    rows = replace(rows, noise=np.broadcast_to(noise * np.eye(3), (30, 1, 3, 3)))
    best = -minimize(lambda at: -at_logs(rows, at).log_posterior, np.zeros(4), tol=1e-8).fun
    for begin in (-2.0, 2.0):
        end, ended = maximise(at_logs(rows, np.full(4, begin) * np.log(10.0)), MAX_STEPS, GAIN)
        assert ended
        assert best - end.log_posterior < 2.0 * GAIN


@pytest.mark.parametrize("seed", range(3))
def test_weights_of_poses_are_the_most_probable_with_errors_and_sizes(seed: int):
    """Twelve poses, one of which errs by much more, against SciPy."""
    rows = replace(noisy_rows(12, seed), tails=True)
    rows.y[5] += 6.0

    def at(logs: np.ndarray) -> NoisyFit:
        return rows.under(STANDING.with_variances(np.exp(logs[:2])), logs[2:4], np.exp(logs[4:]))

    best = minimize(lambda logs: -at(logs).log_posterior, np.zeros(16), tol=1e-8)
    end, ended = maximise(at(np.zeros(16)), MAX_STEPS, GAIN)
    assert ended
    assert -best.fun - end.log_posterior < 2.0 * GAIN
    np.testing.assert_allclose(np.log(end.weights), best.x[4:], atol=2e-3)


@pytest.mark.parametrize("searched", [False, True])
def test_a_fit_without_some_poses_is_that_of_the_others(searched: bool):
    """Its sizes follow; of errors that were sought the weights do too, from those that the others have alone."""
    rows, part = replace(noisy_rows(), tails=True), np.array([3, 4, 11])
    errors = replace(STANDING, searched=searched)
    fitted = rows.under(errors, SIZES, np.random.default_rng(1).uniform(0.5, 1.5, 30))
    found, held = fitted.without(part, MAX_STEPS, GAIN), replace(errors, searched=False)
    others = rows.take(np.delete(np.arange(30), part))
    expected = maximise(others.under(held, SIZES), MAX_STEPS, GAIN)[0]
    if searched:
        square = (expected.left**2).sum(axis=1) + np.trace(expected.explained, axis1=1, axis2=2)
        weights = weigh(square, np.full(27, 3))
        expected = maximise(others.under(held, expected.found.log_variances, weights), MAX_STEPS, GAIN)[0]
    np.testing.assert_allclose(found.log_variances, expected.found.log_variances, atol=1e-9)
    np.testing.assert_allclose(found.mean, expected.found.mean, atol=1e-9)
    np.testing.assert_allclose(found.covariance, expected.found.covariance, atol=1e-9)
