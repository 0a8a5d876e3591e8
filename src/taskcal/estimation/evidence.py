"""Marginal likelihood: how large the model error and the prior are, from the data themselves.

Measured = predicted + model error + tracker noise. The model error is white with variance u in each group of residual
components, the prior's covariance is v times the stated one; u and v are those under which the data are most probable.
With Q the marginal precision of the data, each scoring step solves s(u) = t(u), where s = rᵀQGQr and t = tr QG
(Harville 1977, REML by Fisher scoring); in the linear homogeneous case one step is exact.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float

SCALE_RANGE = 1e-4, 1e4
"""Bounds of the prior's variance factor: a hundred times tighter or wider than stated."""

STATED_WITHIN = 3.0
"""Factor (1σ) within which stated deviations are believed where the data say nothing of their scale."""

MIN_INFORMATION = 1e-6
"""Variance of a direction over that of the data's noise in it, below which the data say nothing of it."""

GRID_POINTS = 201
"""Factors, evenly in their logarithm, over which their posterior is integrated."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Linearised:
    """A fit at its current solution, block by block."""

    residual: Float[np.ndarray, "blocks b"]
    """Measured − predicted."""
    inverse: Float[np.ndarray, "blocks b b"]
    """R⁻¹, of tracker noise and model error together, times each block's robust weight."""
    prediction_covariance: Float[np.ndarray, "blocks b b"]
    """J·A⁻¹·Jᵀ, A the posterior information."""
    information: Float[np.ndarray, "p p"]
    """H = JᵀR⁻¹J."""
    precision: Float[np.ndarray, "p p"]
    """P, of the scaled parameters and of the others, which are believed independently of them."""
    posterior: Float[np.ndarray, "p p"]
    """A⁻¹ = (H + P)⁻¹."""
    prior_covariance: Float[np.ndarray, "k k"]
    """Stated covariance of the scaled parameters, v = 1."""
    deviation: Float[np.ndarray, " k"]
    """Their estimate less the prior's mean."""
    scaled: Bool[np.ndarray, " p"]
    """Which parameters the factor v scales."""

    @cached_property
    def marginal(self) -> Float[np.ndarray, "blocks b b"]:
        """Marginal precision matrix Q of every block."""
        return self.inverse - self.inverse @ self.prediction_covariance @ self.inverse


def score_model_error(at: Linearised, components: slice, weights: Float[np.ndarray, " blocks"]) -> tuple[float, float]:
    """Scoring step for the variance u of some residual components: the change of u, and its standard error.

    Args:
        at: the linearised fit.
        components: which components of every block share the variance.
        weights: robust weight of every block; its covariance holds u/weight.
    """
    Q = at.marginal
    Qr = (at.inverse @ at.residual[:, :, None])[:, components, 0]
    Qg = Q[:, components, components]
    s = float(np.sum((Qr**2).sum(axis=1) / weights))
    t = float(np.sum(np.trace(Qg, axis1=1, axis2=2) / weights))
    curvature = float(np.sum((Qg**2).sum(axis=(1, 2)) / weights**2))
    return (s - t) / curvature, float(np.sqrt(2.0 / curvature))


def least_curvature(at: Linearised, components: slice, weights: Float[np.ndarray, " blocks"]) -> float:
    """Lower bound of tr QGQG, correlations of all blocks included: (tr QG)² over the numbers that are left to judge u by.

    Of few blocks it is more than what they have each by itself: a step by theirs goes too far by the share of the numbers that
    the parameters take up. How they share them among components of two kinds is not known, and there none are taken off.
    """
    Qg = at.marginal[:, components, components]
    t = float(np.sum(np.trace(Qg, axis1=1, axis2=2) / weights))
    left = Qg.shape[0] * Qg.shape[1]
    if Qg.shape[1] == at.marginal.shape[1]:
        left -= float(np.sum(at.posterior * at.information))
    return t * t / max(left, 1.0)


def score_prior_scale(at: Linearised, v: float) -> float:
    """Scoring step for the prior's variance factor: the factor it proposes."""
    k = np.ix_(at.scaled, at.scaled)
    P = at.precision[k]
    M = (P - P @ at.posterior[k] @ P) @ at.prior_covariance  # JᵀQJ·Σ: H − H·A⁻¹·H is P − P·A⁻¹·P
    s = float(at.deviation @ P @ at.deviation) / v
    t = float(np.trace(M))
    curvature = float(np.sum(M * M.T))
    if curvature <= 0.0:
        return v
    # a factor of ten at most in one step: far from the solution the scoring step overshoots
    return float(np.clip(v + (s - t) / curvature, max(0.1 * v, SCALE_RANGE[0]), min(10.0 * v, SCALE_RANGE[1])))


def expect_prior_scale(at: Linearised, v: float) -> float:
    """Expectation of the prior's variance factor, where `score_prior_scale` finds the factor that is most probable.

    What the data do not tell of a parameter varies by the factor's expectation. That is the larger one: few parameters that are
    well seen say what the size of the others is, as a few draws say what a variance is, and a variance that is most probable is
    too small on average (for d of them and Jeffreys' prior by d/(d − 2)).

    Args:
        at: the linearised fit, its estimate found with the factor v.
        v: the factor.
    """
    H, k = at.information, at.scaled
    free = H[np.ix_(~k, ~k)] + at.precision[np.ix_(~k, ~k)]
    own = H[np.ix_(k, k)] - H[np.ix_(k, ~k)] @ np.linalg.solve(free, H[np.ix_(~k, k)])
    return float(expect_factor(own[None], at.prior_covariance, at.deviation[None], np.array([v]))[0])


def expect_factor(
    own: Float[np.ndarray, "fits k k"],
    prior_covariance: Float[np.ndarray, "k k"],
    deviation: Float[np.ndarray, "fits k"],
    v: Float[np.ndarray, " fits"],
) -> Float[np.ndarray, " fits"]:
    """The same of many fits, from the information of the scaled parameters once the others are eliminated."""
    root = np.linalg.cholesky(prior_covariance)
    values, vectors = np.linalg.eigh(root.T @ own @ root)
    factor = v[:, None]
    told = values * factor > MIN_INFORMATION
    by = np.where(told, values, 0.0)
    w = (np.swapaxes(vectors, -1, -2) @ np.linalg.solve(root, deviation[..., None]))[..., 0]
    # in these directions the data alone say y ± 1/√λ, and the estimate is y·λv/(1 + λv)
    square = np.where(told, w**2 * (1.0 + by * factor) ** 2 / (np.where(told, values, 1.0) * factor**2), 0.0)
    logarithm = np.linspace(np.log(SCALE_RANGE[0]), np.log(SCALE_RANGE[1]), GRID_POINTS)
    spread = 1.0 + by[:, None] * np.exp(logarithm)[:, None]
    likelihood = -0.5 * (np.log(spread) + square[:, None] / spread).sum(axis=-1)
    believed = likelihood - 0.5 * (logarithm / (2.0 * np.log(STATED_WITHIN))) ** 2
    weight = np.exp(believed - believed.max(axis=-1, keepdims=True))
    return (weight * np.exp(logarithm)).sum(axis=-1) / weight.sum(axis=-1)
