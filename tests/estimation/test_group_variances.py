"""Groups whose sizes the rows tell, against textbook formulas and finite differences."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from scipy.optimize import approx_fprime
from scipy.special import logsumexp
from scipy.stats import multivariate_normal

from taskcal.estimation.group_variances import (
    SCALE_RANGE,
    STATED_WITHIN,
    GroupEquations,
    Groups,
    variance_posterior,
)
from taskcal.estimation.noisy_rows import MAX_STEPS, NoisyFit, NoisyRows, PoseNoise, maximise

GROUP = np.array([0, 0, 0, 1, 1, -1, -1, 2])
ALONE = PoseNoise(position=0.0, rotation=None, joints=np.zeros(0), searched=False)
"""Of single poses, beside the noise that is known."""


def fit_of(A, y, groups: Groups, log_variances) -> NoisyFit:
    """The model of rows of unit noise at some sizes."""
    n, p = A.shape
    rows = NoisyRows(
        groups=groups,
        A=A[:, None],
        y=y[:, None],
        seen=np.ones((n, 1), dtype=bool),
        noise=np.ones((n, 1, 1, 1)),
        units=[np.ones((n, 1, 1))],
        beside=(np.zeros((0, p)), np.zeros(0)),
    )
    return rows.under(ALONE, log_variances)


def find_sizes(A, y, groups: Groups, start, gain: float = 1e-2):
    """The likeliest sizes."""
    return maximise(fit_of(A, y, groups, groups.starting(start)), MAX_STEPS, gain)[0].found


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
def test_evidence_and_estimate_are_the_textbooks(rows):
    """With more parameters than rows, and with fewer."""
    A, y, groups = problem(rows)
    theta = np.array([1.0, -2.0, 0.3])
    D = prior(groups, theta)
    K = np.eye(rows) + A @ D @ A.T
    at = GroupEquations.of_rows(A, y, groups).at(theta)
    assert at.log == pytest.approx(multivariate_normal(cov=K).logpdf(y) + 0.5 * rows * np.log(2.0 * np.pi))
    np.testing.assert_allclose(at.mean, D @ A.T @ np.linalg.solve(K, y), atol=1e-8)
    np.testing.assert_allclose(at.covariance, D - D @ A.T @ np.linalg.solve(K, A @ D), atol=1e-8)


def test_few_rows_say_what_their_normal_equations_say():
    """Whichever of both is smaller is worked with, and draws, spread and scores are the same."""
    A, y, groups = problem(7)
    few = GroupEquations.of_rows(A, y, groups)
    whole = GroupEquations(groups=groups, given=A.T @ A, b=A.T @ y, square=float(y @ y))
    assert few.few is not None
    assert whole.few is None
    at, same = (equations.at(np.array([1.0, -2.0, 0.3])) for equations in (few, whole))
    new = np.random.default_rng(1).normal(size=(5, 2, len(GROUP)))
    for a, b in (
        (at.log_integrated([1]), same.log_integrated([1])),
        (at.effective_parameters, same.effective_parameters),
        (at.spread(new), same.spread(new)),
        (at.spread(new), new @ at.covariance @ np.swapaxes(new, 1, 2)),
        (at.determined, same.determined),
        (at.information, same.information),
        (at.times_covariance(new[0].T), same.times_covariance(new[0].T)),
    ):
        np.testing.assert_allclose(a, b, rtol=1e-9, atol=1e-9)
    spreads = [one.averaged_spread(new, 6, np.random.default_rng(2)) for one in (at, same)]
    np.testing.assert_allclose(*spreads, rtol=1e-8)
    S = same.averaged(6, np.random.default_rng(2))[1]
    np.testing.assert_allclose(spreads[0], new @ S @ np.swapaxes(new, 1, 2), rtol=1e-8)


def test_the_gradient_is_that_of_the_evidence():
    A, y, groups = problem(30)
    groups = replace(groups, spread=np.array([[9.0, 4.0, 0.0], [4.0, 5.0, 0.0], [0.0, 0.0, 4.0]]))
    theta = np.array([0.5, -1.0, 0.2])
    numeric = approx_fprime(theta, lambda t: fit_of(A, y, groups, t).log_posterior, 1e-6)
    np.testing.assert_allclose(fit_of(A, y, groups, theta).ascent().gradient, numeric, rtol=1e-4)


def test_group_variances_maximise_evidence_and_null_is_small():
    """Group variances maximise the evidence, and the variance of an absent group is small."""
    A, y, groups = problem(400)
    at = find_sizes(A, y, groups, np.zeros(3))
    np.testing.assert_allclose(fit_of(A, y, groups, at.log_variances).ascent().gradient, 0.0, atol=0.3)
    sizes = np.exp(0.5 * at.log_variances)
    assert 1.0 < sizes[0] < 9.0
    assert sizes[1] < 0.2
    assert at.log - at.without([0]).log > 10.0
    assert at.log - at.without([1]).log < 3.0


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
            at = find_sizes(A / 3.0, y / 3.0, groups, np.zeros(20))
            errors[k] += np.sum(at.mean[3:] ** 2)
            sizes = np.exp(0.5 * at.log_variances)
        assert sizes[0] > 3.0 * sizes[1:].max()
    assert errors[1] < 0.75 * errors[0], errors


def test_averaging_over_the_sizes_adds_their_uncertainty():
    A, y, groups = problem(12)
    at = find_sizes(A, y, groups, np.zeros(3))
    mean, S = at.averaged(200, np.random.default_rng(0))
    assert np.trace(S) > np.trace(at.covariance)
    np.testing.assert_array_equal(mean, at.mean)
    assert np.linalg.eigvalsh(S).min() > 0.0


@pytest.mark.parametrize("rows", [15, 60])
@pytest.mark.parametrize("precision", [1e2, 1e4, 1e5])
def test_covariance_is_nowhere_negative_where_rows_are_precise(rows, precision):
    """However much better than its prior a parameter is known, and however alike two of them are."""
    rng = np.random.default_rng(0)
    A = precision * rng.normal(size=(rows, 20))
    A[:, 1] = A[:, 0] + 1e-4 * A[:, 2]
    groups = Groups(group=np.arange(20) // 4 - 1, held=np.eye(4), location=np.zeros(4), spread=np.eye(4))
    at = find_sizes(A, A @ rng.normal(size=20) + rng.normal(size=rows), groups, np.zeros(4))
    for S in (at.covariance, at.averaged(12, rng)[1]):
        deviation = np.sqrt(np.diag(S))
        assert np.linalg.eigvalsh(S / deviation / deviation[:, None]).min() > -1e-13
    prior = at.root
    inverse = np.linalg.inv(np.linalg.qr(np.concatenate([A, np.diag(1.0 / prior)])).R)
    variance = np.diag(at.covariance)
    np.testing.assert_allclose(variance, np.square(inverse).sum(axis=1), rtol=2e-2)


def test_a_held_group_keeps_its_size():
    A, y, groups = problem(60)
    held = Groups(group=GROUP, held=groups.held, location=np.array([0.0, 1.5, 0.0]), spread=np.diag([9.0, 0.0, 9.0]))
    assert find_sizes(A, y, held, np.zeros(3)).log_variances[1] == 1.5


def test_the_sizes_are_integrated_out():
    """Against the sum over a grid, of groups of which two are expected together."""
    A, y, groups = problem(60)
    spread = np.array([[9.0, 0.0, 0.0], [0.0, 2.0, 1.0], [0.0, 1.0, 2.0]])
    groups = replace(groups, spread=spread)
    at = find_sizes(A, y, groups, np.zeros(3))
    steps, expected = np.linspace(-12.0, 9.0, 22), np.linalg.inv(spread)
    logs = []
    for point in product(steps, repeat=3):
        sizes = np.array(point)
        logs.append(at.equations.at(sizes).log - 0.5 * sizes @ expected @ sizes)
    total = logsumexp(logs) + 3.0 * np.log(steps[1] - steps[0]) + 0.5 * np.log(np.linalg.det(expected / (2.0 * np.pi)))
    assert at.log_integrated() == pytest.approx(
        total, abs=0.6
    )  # Laplace's approximation takes a flat side for a steep one
    assert at.log_integrated() < at.log - 2.0
    assert at.log_integrated([0, 1, 2]) == at.without(np.arange(3)).log
    assert at.log_integrated() - at.log_integrated([0]) > 10.0


def alone(parameters: int, spread: float = 1e12) -> Groups:
    """One group of all parameters, of whose size nothing is expected."""
    return Groups(
        group=np.zeros(parameters, dtype=int), held=np.zeros((0, 0)), location=np.zeros(1), spread=np.array([[spread]])
    )


def test_mean_variance_equals_that_of_a_grid_of_evidences():
    """Against the evidence on a grid, of parameters of one group beside others without."""
    rng = np.random.default_rng(1)
    A = rng.normal(size=(40, 9))
    y = A @ np.concatenate([1.4 * rng.normal(size=6), 5.0 * rng.normal(size=3)]) + rng.normal(size=40)
    groups = replace(alone(9), group=np.repeat([0, -1], [6, 3]), held=1e-4 * np.eye(3))
    equations, logarithm = GroupEquations.of_rows(A, y, groups), np.linspace(*np.log(SCALE_RANGE), 151)
    posterior = np.array([equations.at(np.array([one])).log for one in logarithm])
    posterior -= 0.5 * (logarithm / np.log(STATED_WITHIN**2)) ** 2
    weight = np.exp(posterior - posterior.max())
    assert variance_posterior(equations).mean == pytest.approx(weight @ np.exp(logarithm) / weight.sum(), rel=1e-2)


def test_unobserved_parameter_coverage_is_nominal():
    """Five of six parameters are seen: 95 % of the sixth lie within 1.96 of what is expected, not of what is most probable."""
    seen, inside = np.diag([100.0] * 5 + [0.0]), np.zeros(2)
    draws = np.random.default_rng(0).normal(size=(1500, 6))
    for x in draws:
        at = find_sizes(seen, seen @ x, alone(6), np.zeros(1), gain=1e-6)
        likeliest = float(np.exp(at.log_variances[0]))
        inside += np.abs(x[5]) < 1.959964 * np.sqrt([likeliest, variance_posterior(at.equations).mean])
    most_probable, expected = inside / len(draws)
    assert most_probable < 0.91
    assert 0.93 < expected < 0.97


def test_regions_hold_whatever_the_variance_is():
    """Of variances as they are expected, three parameters that nothing tells of lie within 95 % regions as often as stated."""
    seen, inside = np.diag([100.0] * 3 + [0.0] * 3), 0
    rng = np.random.default_rng(0)
    draws = rng.normal(size=(2000, 6)) * STATED_WITHIN ** rng.normal(size=(2000, 1))
    for x in draws:
        found = variance_posterior(GroupEquations.of_rows(seen, seen @ x, alone(6)))
        inside += x[3:] @ x[3:] < 7.814728 * found.mean * found.region_factor
    assert inside / len(draws) == pytest.approx(0.95, abs=0.01)


def test_effective_parameters_are_the_share_of_prior_variance_that_rows_take_away():
    """γ = tr(H·S): the sum of λ·v/(1 + λ·v) over the eigenvalues λ of the information, by a single group of variance v."""
    rng = np.random.default_rng(8)
    A = rng.normal(size=(5, 9)) * np.geomspace(1.0, 30.0, 9)
    groups = Groups(group=np.zeros(9, dtype=int), held=np.zeros((0, 0)), location=np.zeros(1), spread=np.zeros((1, 1)))
    equations = GroupEquations.of_rows(A, rng.normal(size=5), groups)
    values = np.linalg.eigvalsh(A.T @ A)
    for v in (1e-6, 1.0, 1e3):
        at = equations.at(np.array([np.log(v)]))
        np.testing.assert_allclose(at.effective_parameters, (values * v / (1.0 + values * v)).sum(), atol=1e-6)
        np.testing.assert_allclose(at.effective_parameters, np.trace(equations.H @ at.covariance), atol=1e-6)
    assert equations.at(np.array([-np.inf])).effective_parameters == 0.0
