import numpy as np
import pytest
import scipy.optimize
from hypothesis import assume, given, settings

from taskcal.estimation.evidence import (
    SCALE_RANGE,
    STATED_WITHIN,
    Linearised,
    expect_prior_scale,
    least_curvature,
    score_model_error,
    score_prior_scale,
)
from tests.laws.robots import generators

B = 3


class LinearModel:
    """y = J·z + noise + model error: known noise, white model error of variance u, prior v·Σ on the scaled z."""

    def __init__(self, rng, blocks=25, scaled=6, free=3, groups=1, u=1.0, v=1.0):
        b, p = B * groups, scaled + free
        self.groups, self.scaled = groups, np.arange(p) < scaled
        self.J = rng.normal(size=(blocks, b, p))
        root = rng.normal(size=(scaled, scaled))
        self.Sigma = root @ root.T + np.eye(scaled)
        noise = rng.normal(size=(blocks, b, b))
        self.noise = 0.02 * noise @ noise.swapaxes(1, 2) + 0.05 * np.eye(b)
        u = np.resize(u, groups)
        z = np.concatenate([np.linalg.cholesky(v * self.Sigma) @ rng.normal(size=scaled), 5 * rng.normal(size=free)])
        error = np.einsum("nij,nj->ni", np.linalg.cholesky(self.covariance(u)), rng.normal(size=(blocks, b)))
        self.y = self.J @ z + error

    def covariance(self, u):
        return self.noise + np.diag(np.repeat(u, B))

    def precision(self, v):
        P = np.eye(len(self.scaled)) * 1e-4
        P[: len(self.Sigma), : len(self.Sigma)] = np.linalg.inv(v * self.Sigma)
        return P

    def log_marginal(self, u, v):
        """Written out: y is normal with covariance J·P⁻¹·Jᵀ + R."""
        J, R = self.J.reshape(-1, len(self.scaled)), self.covariance(u)
        K = J @ np.linalg.solve(self.precision(v), J.T)
        b = R.shape[1]
        for i, block in enumerate(R):
            K[b * i : b * i + b, b * i : b * i + b] += block
        L = np.linalg.cholesky(K)
        white = np.linalg.solve(L, self.y.reshape(-1))
        return -np.log(np.diag(L)).sum() - 0.5 * white @ white

    def linearised(self, u, v):
        R = self.covariance(u)
        W = np.linalg.inv(R)
        H = np.einsum("nia,nij,njb->ab", self.J, W, self.J)
        posterior = np.linalg.inv(H + self.precision(v))
        z = posterior @ np.einsum("nia,nij,nj->a", self.J, W, self.y)
        return Linearised(
            residual=self.y - self.J @ z,
            inverse=W,
            prediction_covariance=self.J @ posterior @ self.J.swapaxes(1, 2),
            information=H,
            precision=self.precision(v),
            posterior=posterior,
            prior_covariance=self.Sigma,
            deviation=z[self.scaled],
            scaled=self.scaled,
        )

    def maximum(self, u, v):
        """Of the exact log marginal likelihood, by SciPy."""

        def negative(logs):
            return -self.log_marginal(np.exp(logs[:-1]), np.exp(logs[-1]))

        start = np.log([*np.resize(u, self.groups), v])
        found = scipy.optimize.minimize(negative, start, method="BFGS", jac="3-point", options={"gtol": 1e-7})
        return np.exp(found.x[:-1]), np.exp(found.x[-1])


@settings(max_examples=4)
@given(generators)
@pytest.mark.parametrize("groups", [1, 2])
def test_scoring_converges_to_maximum_marginal_likelihood(groups, rng):
    """The scoring steps converge to the maximum of the marginal likelihood."""
    model = LinearModel(rng, groups=groups, u=np.array([0.5, 2.0]), v=3.0)
    best_u, best_v = model.maximum(np.array([0.5, 2.0]), 3.0)
    assume(1e-3 < best_v < 1e3 and best_u.min() > 1e-2)
    u, v = np.ones(groups), 1.0
    weights = np.ones(len(model.y))
    for _ in range(100):
        at = model.linearised(u, v)
        steps = [score_model_error(at, slice(B * g, B * g + B), weights)[0] for g in range(groups)]
        v = score_prior_scale(at, v)
        u = np.maximum(u + steps, 0.01 * u)
    np.testing.assert_allclose(u, best_u, rtol=1e-4)
    np.testing.assert_allclose(v, best_v, rtol=1e-4)


@settings(max_examples=10)
@given(generators)
def test_scoring_step_is_slope_over_information(rng):
    """A scoring step is the slope over the information, and its error is given by the curvature."""
    model = LinearModel(rng, u=0.5)
    u, v, h = np.array([0.7]), 1.0, 1e-5
    at = model.linearised(u, v)
    step, error = score_model_error(at, slice(0, B), np.ones(len(model.y)))
    slope = (model.log_marginal(u + h, v) - model.log_marginal(u - h, v)) / (2 * h)
    # a scoring step is slope over information, and information is 1/error²
    np.testing.assert_allclose(step, slope * error**2, rtol=1e-4, atol=1e-8)
    factor = score_prior_scale(at, v)
    slope = (model.log_marginal(u, v + h) - model.log_marginal(u, v - h)) / (2 * h)
    assert np.sign(factor - v) == np.sign(slope)


@settings(max_examples=10)
@given(generators)
@pytest.mark.parametrize("groups", [1, 2])
def test_the_curvature_is_at_least_as_large_as_is_said(groups, rng):
    model = LinearModel(rng, groups=groups, u=0.5)
    at, weights = model.linearised(np.full(groups, 0.5), 1.0), rng.uniform(0.2, 1.0, len(model.y))
    J, W = model.J, np.linalg.inv(model.covariance(np.full(groups, 0.5)))
    b = J.shape[1]
    white = (W @ J).reshape(-1, J.shape[2])
    Q = -white @ at.posterior @ white.T
    for i, block in enumerate(W):
        Q[b * i : b * i + b, b * i : b * i + b] += block
    for g in range(groups):
        for w in (np.ones(len(weights)), weights):
            own = np.tile(np.arange(b) // B == g, len(J))
            G = np.repeat(1.0 / w, B)
            exact = np.sum((Q[np.ix_(own, own)] * G) * (Q[np.ix_(own, own)] * G).T)
            components = slice(B * g, B * g + B)
            assert 0.0 < least_curvature(at, components, w) < exact * (1.0 + 1e-9)


def test_a_weighted_block_counts_as_one_of_larger_variance():
    rng = np.random.default_rng(0)
    model = LinearModel(rng)
    weights = rng.uniform(0.2, 1.0, len(model.y))
    plain = model.linearised(np.ones(1), 1.0)
    weighted = Linearised(**{**vars(plain), "inverse": plain.inverse * weights[:, None, None]})
    step, _ = score_model_error(weighted, slice(0, B), weights)
    # derivative of the covariance by u is 1/weight in every block: s and t weighted by hand
    W = weighted.inverse
    Q = W - W @ weighted.prediction_covariance @ W
    Qr = np.einsum("nij,nj->ni", W, weighted.residual)
    s, t = (Qr**2).sum(axis=1) @ (1 / weights), np.trace(Q, axis1=1, axis2=2) @ (1 / weights)
    np.testing.assert_allclose(step, (s - t) / ((Q**2).sum(axis=(1, 2)) @ (1 / weights**2)))


@settings(max_examples=3)
@given(generators)
def test_expected_prior_scale_equals_exact_marginal_mean(rng):
    """The expected scale is that of the exact marginal likelihood."""
    model = LinearModel(rng, v=2.0)
    logarithm = np.linspace(*np.log(SCALE_RANGE), 151)
    believed = np.array([model.log_marginal(1.0, np.exp(one)) for one in logarithm])
    believed -= 0.5 * (logarithm / np.log(STATED_WITHIN**2)) ** 2
    weight = np.exp(believed - believed.max())
    expected = weight @ np.exp(logarithm) / weight.sum()
    # whichever factor the fit was made with
    for v in (0.5, 2.0):
        assert expect_prior_scale(model.linearised(1.0, v), v) == pytest.approx(expected, rel=1e-2)


def test_unobserved_parameter_coverage_is_nominal():
    """Five of six parameters are seen: 95 % of the sixth lie within 1.96 of what is expected, not of what is most probable."""
    seen = np.diag([1.0, 1.0, 1.0, 1.0, 1.0, 0.0]) * 1e4
    draws = np.random.default_rng(0).normal(size=(1500, 6))
    inside = np.zeros(2)
    for x in draws:
        told = seen @ x / 1e4
        v = float(np.mean(told[:5] ** 2))
        posterior = np.linalg.inv(seen + np.eye(6) / v)
        at = Linearised(
            residual=np.zeros((0, 3)),
            inverse=np.zeros((0, 3, 3)),
            prediction_covariance=np.zeros((0, 3, 3)),
            information=seen,
            precision=np.eye(6) / v,
            posterior=posterior,
            prior_covariance=np.eye(6),
            deviation=posterior @ seen @ x,
            scaled=np.ones(6, dtype=bool),
        )
        inside += np.abs(x[5]) < 1.959964 * np.sqrt([v, expect_prior_scale(at, v)])
    most_probable, expected = inside / len(draws)
    assert most_probable < 0.91
    assert 0.93 < expected < 0.97
