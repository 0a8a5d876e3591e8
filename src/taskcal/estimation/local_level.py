"""A local level seen through noise: a random walk and white noise of its own, each of the most probable size, and their sum.

y = w + t + e: w a random walk with steps of variance a², t white with variance b², e noise of known variances. This is the
local level model (Durbin and Koopman 2012, chapter 2) beside a second white part that belongs to what is sought. The
walk's posterior precision is tridiagonal, so that everything costs a few operations a row.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float
from scipy.linalg import cho_solve_banded, cholesky_banded

MIN_SHARE_OF_NOISE = 1e-3
"""Smallest standard deviations that are distinguished from zero, as shares of the noise's."""


@dataclass(frozen=True, eq=False, kw_only=True)
class LocalLevel:
    """The most probable course of a quantity."""

    mean: Float[np.ndarray, " n"]
    """w + t."""
    variance: Float[np.ndarray, " n"]
    """Its posterior variance."""
    step: float
    """Standard deviation of the walk's steps."""
    white: float
    """Standard deviation of the white part."""


def smooth(seen: Float[np.ndarray, " n"], noise: Float[np.ndarray, " n"], *, own_noise: bool = True) -> LocalLevel:
    """Estimate the quantity at every row, with the step and the white noise of the largest marginal likelihood.

    Args:
        seen: what was seen at rows of equal distance; NaN where nothing was.
        noise: variance of its noise.
        own_noise: whether the quantity has white noise of its own; else all that is white belongs to `noise`.
    """
    observed = ~np.isnan(seen)
    size = float(np.sqrt(np.median(noise[observed])))
    largest = max(10.0 * float(np.ptp(seen[observed])), 10.0 * size)
    bounds = [(np.log(MIN_SHARE_OF_NOISE * size), np.log(largest))] * (2 if own_noise else 1)

    def cost(log_sizes: Float[np.ndarray, " k"]) -> float:
        return _Walk.of(seen, noise, *_variances(log_sizes)).cost

    from scipy.optimize import minimize

    starts = [np.log(np.full(len(bounds), size * share)) for share in (0.1, 2.0)]
    trials: list[Any] = [minimize(cost, start, method="Nelder-Mead", bounds=bounds) for start in starts]
    best = min(trials, key=lambda trial: trial.fun).x
    steps, white = _variances(best)
    walk = _Walk.of(seen, noise, steps, white)
    gain = np.where(observed, white / (white + noise), 0.0)
    across = np.where(observed, gain * noise, white)
    return LocalLevel(
        mean=walk.mean + gain * np.where(observed, seen - walk.mean, 0.0),
        variance=(1.0 - gain) ** 2 * walk.variance() + across,
        step=float(np.sqrt(steps)),
        white=float(np.sqrt(white)),
    )


def _variances(log_sizes: Float[np.ndarray, " k"]) -> tuple[float, float]:
    """Variances of step and white noise."""
    a, b = float(log_sizes[0]), float(log_sizes[1]) if len(log_sizes) > 1 else -np.inf
    return float(np.exp(2.0 * a)), float(np.exp(2.0 * b))


@dataclass(frozen=True, eq=False, kw_only=True)
class _Walk:
    """The walk's posterior, of precision DᵀD/a² + V⁻¹ with D the differences of neighbours and V = b² + noise."""

    mean: Float[np.ndarray, " n"]
    factor: Float[np.ndarray, "2 n"]
    """Cholesky factor of the precision: its diagonal, and the elements below."""
    cost: float
    """−2 log likelihood of the two variances, but for a constant."""

    @classmethod
    def of(cls, seen: Float[np.ndarray, " n"], noise: Float[np.ndarray, " n"], step: float, white: float) -> "_Walk":
        observed, n = ~np.isnan(seen), len(seen)
        weight = np.where(observed, 1.0 / (white + noise), 0.0)
        precision = np.zeros((2, n))
        precision[0] = weight + np.r_[1.0, np.full(n - 2, 2.0), 1.0] / step
        precision[1, :-1] = -1.0 / step
        factor = np.asarray(cholesky_banded(precision, lower=True))
        information = np.where(observed, weight * np.nan_to_num(seen), 0.0)
        mean = np.asarray(cho_solve_banded((factor, True), information))
        misfit = float(information @ (np.nan_to_num(seen) - mean))
        determinants = 2.0 * np.log(factor[0]).sum() + (n - 1) * np.log(step) - np.log(weight[observed]).sum()
        return cls(mean=mean, factor=factor, cost=misfit + float(determinants))

    def variance(self) -> Float[np.ndarray, " n"]:
        """Diagonal of the inverse precision, from the last row back (Takahashi et al. 1973)."""
        diagonal, below = self.factor
        out = diagonal**-2.0
        for k in range(len(out) - 2, -1, -1):
            out[k] += (below[k] / diagonal[k]) ** 2 * out[k + 1]
        return out
