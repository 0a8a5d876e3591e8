"""Groups whose sizes the rows tell, against textbook formulas and finite differences."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from scipy.optimize import approx_fprime
from scipy.special import logsumexp
from scipy.stats import multivariate_normal

from taskcal.estimation.group_variances import (
    Groups,
    _scores,
    find_sizes,
    log_integrated,
    reduce_normal,
    reduce_rows,
    without,
)

GROUP = np.array([0, 0, 0, 1, 1, -1, -1, 2])


def problem(rows: int, seed: int = 0):
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(rows, len(GROUP)))
    deviation = np.select([GROUP == 0, GROUP == 1, GROUP == 2], [3.0, 0.0, 0.5], 5.0)
    y = A @ (deviation * rng.normal(size=len(GROUP))) + rng.normal(size=rows)
    groups = Groups(group=GROUP, held=np.diag([1e-2, 4e-2]), location=np.zeros(3), spread=9.0 * np.eye(3))
    return A, y, groups


def prior(groups: Groups, theta):
    out = np.diag(np.exp(theta)[np.maximum(GROUP, 0)])
    out[np.ix_([5, 6], [5, 6])] = np.linalg.inv(groups.held)
    return out


@pytest.mark.parametrize("rows", [4, 30])
def test_evidence_and_estimate_are_the_textbooks_in_both_forms(rows):
    A, y, groups = problem(rows)
    theta, nothing = np.array([1.0, -2.0, 0.3]), np.full(3, -np.inf)
    D = prior(groups, theta)
    K = np.eye(rows) + A @ D @ A.T
    expected = multivariate_normal(cov=K).logpdf(y) + 0.5 * rows * np.log(2.0 * np.pi)
    mean, S = D @ A.T @ np.linalg.solve(K, y), D - D @ A.T @ np.linalg.solve(K, A @ D)
    for reduced in (reduce_rows(A, y, groups), reduce_normal(A.T @ A, A.T @ y, float(y @ y), groups)):
        at = reduced.at(theta)
        assert at.log + reduced.log_alone == pytest.approx(expected)
        assert reduced.at(nothing).log == pytest.approx(0.0, abs=1e-12)
        np.testing.assert_allclose(reduced.mean(at.mean(groups.own)), mean, atol=1e-8)
        np.testing.assert_allclose(reduced.covariance(at.spread), S, atol=1e-8)


def test_the_gradient_is_that_of_the_evidence():
    A, y, groups = problem(30)
    groups = replace(groups, spread=np.array([[9.0, 4.0, 0.0], [4.0, 5.0, 0.0], [0.0, 0.0, 4.0]]))
    reduced, theta = reduce_rows(A, y, groups), np.array([0.5, -1.0, 0.2])
    precision = np.linalg.inv(groups.spread)
    numeric = approx_fprime(theta, lambda t: reduced.at(t).log - 0.5 * t @ precision @ t, 1e-6)
    np.testing.assert_allclose(_scores(reduced.at(theta), groups)[0], numeric, rtol=1e-4)


def test_group_variances_maximise_evidence_and_null_is_small():
    """Group variances maximise the evidence, and the variance of an absent group is small."""
    A, y, groups = problem(400)
    fit = find_sizes(reduce_rows(A, y, groups), np.zeros(3))
    gradient, _ = _scores(fit.evidence, groups)
    np.testing.assert_allclose(gradient, 0.0, atol=0.3)
    sizes = np.exp(0.5 * fit.evidence.log_variances)
    assert 1.0 < sizes[0] < 9.0
    assert sizes[1] < 0.2
    assert fit.evidence.log - without(fit, np.array([0])).log > 10.0
    assert fit.evidence.log - without(fit, np.array([1])).log < 3.0


def test_absent_groups_shrink_similar_groups_only():
    """Twenty groups of three, of which the first is there; each is judged by itself, or with what the others are."""
    own, errors, sizes = np.repeat(np.arange(20), 3), np.zeros(2), np.ones(20)
    for seed in range(5):
        rng = np.random.default_rng(seed)
        A = rng.normal(size=(80, 60))
        x = np.concatenate([[6.0, -5.0, 4.0], np.zeros(57)])
        y = A @ x + 3.0 * rng.normal(size=80)
        for k, spread in enumerate((9.0 * np.eye(20), 16.0 + np.eye(20))):
            groups = Groups(group=own, held=np.zeros((0, 0)), location=np.zeros(20), spread=spread)
            fit = find_sizes(reduce_rows(A / 3.0, y / 3.0, groups), np.zeros(20))
            errors[k] += np.sum(fit.evidence.mean(own)[3:] ** 2)
            sizes = np.exp(0.5 * fit.evidence.log_variances)
        assert sizes[0] > 3.0 * sizes[1:].max()
    assert errors[1] < 0.75 * errors[0], errors


def test_averaging_over_the_sizes_adds_their_uncertainty():
    A, y, groups = problem(12)
    fit = find_sizes(reduce_rows(A, y, groups), np.zeros(3))
    plain = fit.reduced.covariance(fit.evidence.spread)
    mean, S = fit.averaged(200, np.random.default_rng(0))
    assert np.trace(S) > np.trace(plain)
    np.testing.assert_array_equal(mean, fit.reduced.mean(fit.evidence.mean(groups.own)))
    assert np.linalg.eigvalsh(S).min() > 0.0


@pytest.mark.parametrize("rows", [15, 60])
@pytest.mark.parametrize("precision", [1e2, 1e4, 1e5])
def test_covariance_is_nowhere_negative_where_rows_are_precise(rows, precision):
    """However much better than its prior a parameter is known, and however alike two of them are."""
    rng = np.random.default_rng(0)
    A = precision * rng.normal(size=(rows, 20))
    A[:, 1] = A[:, 0] + 1e-4 * A[:, 2]
    groups = Groups(group=np.arange(20) // 4 - 1, held=np.eye(4), location=np.zeros(4), spread=np.eye(4))
    fit = find_sizes(reduce_rows(A, A @ rng.normal(size=20) + rng.normal(size=rows), groups), np.zeros(4))
    for S in (fit.reduced.covariance(fit.evidence.spread), fit.averaged(12, rng)[1]):
        deviation = np.sqrt(np.diag(S))
        assert np.linalg.eigvalsh(S / deviation / deviation[:, None]).min() > -1e-13
    prior = np.concatenate([np.ones(4), fit.evidence.root])
    inverse = np.linalg.inv(np.linalg.qr(np.concatenate([A, np.diag(1.0 / prior)])).R)
    variance = np.diag(fit.reduced.covariance(fit.evidence.spread))
    np.testing.assert_allclose(variance, np.square(inverse).sum(axis=1), rtol=2e-2)


def test_a_held_group_keeps_its_size():
    A, y, groups = problem(60)
    held = Groups(group=GROUP, held=groups.held, location=np.array([0.0, 1.5, 0.0]), spread=np.diag([9.0, 0.0, 9.0]))
    assert find_sizes(reduce_rows(A, y, held), np.zeros(3)).evidence.log_variances[1] == 1.5


def test_the_sizes_are_integrated_out():
    """Against the sum over a grid, of groups of which two are expected together."""
    A, y, groups = problem(60)
    spread = np.array([[9.0, 0.0, 0.0], [0.0, 2.0, 1.0], [0.0, 1.0, 2.0]])
    groups = replace(groups, spread=spread)
    fit = find_sizes(reduce_rows(A, y, groups), np.zeros(3))
    steps, expected = np.linspace(-12.0, 9.0, 22), np.linalg.inv(spread)
    logs = []
    for point in product(steps, repeat=3):
        sizes = np.array(point)
        logs.append(fit.reduced.at(sizes).log - 0.5 * sizes @ expected @ sizes)
    total = logsumexp(logs) + 3.0 * np.log(steps[1] - steps[0]) + 0.5 * np.log(np.linalg.det(expected / (2.0 * np.pi)))
    assert log_integrated(fit) == pytest.approx(
        total, abs=0.6
    )  # Laplace's approximation takes a flat side for a steep one
    assert log_integrated(fit) < fit.evidence.log - 2.0
    assert log_integrated(fit, [0, 1, 2]) == without(fit, np.arange(3)).log == pytest.approx(0.0)
    assert log_integrated(fit) - log_integrated(fit, [0]) > 10.0
