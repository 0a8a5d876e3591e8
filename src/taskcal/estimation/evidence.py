"""Marginal likelihood: how large the model error and the prior are, from the data themselves.

Measured = predicted + model error + tracker noise. The model error is white with variance u in each group of residual
components, the prior's covariance is v times the stated one; u and v are those under which the data are most probable.
With Q the marginal precision of the data, each scoring step solves s(u) = t(u), where s = rᵀQGQr and t = tr QG
(Harville 1977, REML by Fisher scoring); in the linear homogeneous case one step is exact.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

SCALE_RANGE = 1e-4, 1e4
"""Bounds of the prior's variance factor: a hundred times tighter or wider than stated."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Linearised:
    """A fit at its current solution, block by block."""

    residual: Float[np.ndarray, "blocks b"]
    """Measured − predicted."""
    covariance: Float[np.ndarray, "blocks b b"]
    """Of tracker noise and model error together, divided by each block's robust weight."""
    prediction_covariance: Float[np.ndarray, "blocks b b"]
    """J·A⁻¹·Jᵀ, A the posterior information."""
    information: Float[np.ndarray, "p p"]
    """H = JᵀR⁻¹J."""
    posterior: Float[np.ndarray, "p p"]
    """A⁻¹ = (H + P)⁻¹."""
    prior_covariance: Float[np.ndarray, "k k"]
    """Stated covariance of the scaled parameters, v = 1."""
    deviation: Float[np.ndarray, " k"]
    """Their estimate less the prior's mean."""
    scaled: Bool[np.ndarray, " p"]
    """Which parameters the factor v scales."""


def score_model_error(at: Linearised, components: slice, weights: Float[np.ndarray, " blocks"]) -> tuple[float, float]:
    """Scoring step for the variance u of some residual components: the change of u, and its standard error.

    Args:
        at: the linearised fit.
        components: which components of every block share the variance.
        weights: robust weight of every block; its covariance holds u/weight.
    """
    inverse = np.linalg.inv(at.covariance)
    Q = inverse - inverse @ at.prediction_covariance @ inverse
    Qr = (inverse @ at.residual[:, :, None])[:, components, 0]
    Qg = Q[:, components, components]
    s = float(np.sum((Qr**2).sum(axis=1) / weights))
    t = float(np.sum(np.trace(Qg, axis1=1, axis2=2) / weights))
    curvature = float(np.sum((Qg**2).sum(axis=(1, 2)) / weights**2))
    return (s - t) / curvature, float(np.sqrt(2.0 / curvature))


def score_prior_scale(at: Linearised, v: float) -> float:
    """Scoring step for the prior's variance factor: the factor it proposes."""
    H, Sigma = at.information, at.prior_covariance
    k = at.scaled
    marginal = (H - H @ at.posterior @ H)[np.ix_(k, k)]  # JᵀQJ
    M = marginal @ Sigma
    s = float(at.deviation @ np.linalg.solve(Sigma, at.deviation)) / v**2
    t = float(np.trace(M))
    curvature = float(np.sum(M * M.T))
    if curvature <= 0.0:
        return v
    # a factor of ten at most in one step: far from the solution the scoring step overshoots
    return float(np.clip(v + (s - t) / curvature, max(0.1 * v, SCALE_RANGE[0]), min(10.0 * v, SCALE_RANGE[1])))
