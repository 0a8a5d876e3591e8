"""Hyperparameters are those of the largest marginal likelihood; of very many rows, of some of them."""

import numpy as np
import pytest
import scipy.optimize

from taskcal.identification import hyperparameters as hyperparameter_search
from taskcal.identification.hyperparameters import fit_with_hyperparameters
from taskcal.identification.identify import identify
from taskcal.identification.layout import layout_of, prior_of
from taskcal.identification.options import FitOptions
from taskcal.identification.problem import problem_of
from taskcal.registration.registration import register
from taskcal.virtual.cell import simulate
from tests.identification.arms import arm, defects
from tests.laws.campaigns import measure
from tests.laws.robots import industrial_positions
from tests.reading.virtual_task import MODEL, postures

KINDS = {"points": {"targets": 2, "lost": 0.2}, "poses": {"pose": True, "rotation_sigma": 3e-4}}


def measured(kind: str, rows: int, seed: int = 0):
    rng, model = arm(seed)
    campaign, _ = measure(rng, model, industrial_positions(rng, rows), defects(rng, model), sigma=1e-4, **KINDS[kind])
    return model, campaign


@pytest.mark.parametrize("kind", KINDS)
def test_model_error_and_prior_scale_maximise_the_marginal_likelihood(kind: str) -> None:
    """Against SciPy on the likelihood written out: what was measured is normal with covariance J·Σ·Jᵀ + R."""
    model, campaign = measured(kind, 50)
    layout = layout_of(model, np.arange(len(model)), register(model, campaign), campaign, fixed=False)
    problem, options = problem_of(layout, campaign, None), FitOptions()
    prior = prior_of(layout, options.prior)
    fitted = fit_with_hyperparameters(problem, prior, options)
    at = problem.linearise(fitted.solution.z)
    seen = at.seen.ravel()
    J = at.by_entry.reshape(len(seen), -1)[seen]
    y = at.residual.ravel()[seen] + J @ (fitted.solution.z - prior.mean)
    n, targets, b = problem.noise.shape[:3]
    N = np.zeros((n, targets * b, n, targets * b))
    for i in range(n):
        for t in range(targets):
            N[i, t * b : (t + 1) * b, i, t * b : (t + 1) * b] = problem.noise[i, t]
    N = N.reshape(n * targets * b, -1)[np.ix_(seen, seen)]
    group = np.tile(np.repeat(np.arange(b // 3), 3), n * targets)[seen]

    def negative(logs: np.ndarray) -> float:
        K = J @ prior.covariance(np.exp(logs[-1])) @ J.T + N + np.diag(np.exp(logs[:-1])[group])
        L = np.linalg.cholesky(K)
        white = np.linalg.solve(L, y)
        return float(np.log(np.diag(L)).sum() + 0.5 * white @ white)

    found = np.log([*fitted.hyper.variances, fitted.likeliest_factor])
    best = scipy.optimize.minimize(negative, found, method="Nelder-Mead", options={"xatol": 1e-4, "fatol": 1e-6}).x
    # a tenth of their standard errors: 0.1 of either variance's logarithm and more
    np.testing.assert_allclose(found, best, atol=1.5e-2)


@pytest.mark.parametrize("seed", [1, *(pytest.param(seed, marks=pytest.mark.long) for seed in (2, 3, 5))])
def test_model_error_of_few_lengths_is_as_probable_as_any_other(seed: int) -> None:
    """No model error that is given makes 36 lengths, fewer than the unknowns, more probable than the one that is found.

    One within two standard errors of zero may be taken for zero, which costs two of log evidence at most.
    """
    x = 0.5 * MODEL.tolerances * np.random.default_rng(seed).normal(size=len(MODEL))
    rng = np.random.default_rng((seed, 1))
    campaign, _ = simulate(MODEL, postures(36, seed), rng=rng, x=x, observe="wire", model_error=3e-4)
    found = identify(MODEL, campaign)
    others = [identify(MODEL, campaign, model_error=error).log_evidence for error in (0.0, 1e-4, 2e-4, 3e-4)]
    assert found.log_evidence > max(others) - 2.0


def test_hyperparameters_of_many_rows_are_sought_on_some(monkeypatch: pytest.MonkeyPatch) -> None:
    """What 300 rows say of them is near what 400 say, and the estimate is that of all."""
    model, campaign = measured("points", 400)
    expected = identify(model, campaign)
    monkeypatch.setattr(hyperparameter_search, "SAMPLED_FROM", 300)
    found = identify(model, campaign)
    deviation = np.sqrt(np.diag(expected.z_covariance))
    np.testing.assert_allclose(found.z / deviation, expected.z / deviation, atol=0.2)
    np.testing.assert_allclose(found.model_error, expected.model_error, rtol=0.05)
    np.testing.assert_allclose(found.prior_scale, expected.prior_scale, rtol=0.1)
    assert len(found.residuals) == 400
