"""The residual field: what geometry and effects leave, learned over the joints by a Gaussian process.

Far from the measured poses the field fades to nil and its uncertainty grows to its full size (Rasmussen and Williams 2006,
chapter 2). The hyper-parameters are those of the largest marginal likelihood, found by scikit-learn; what is kept are
arrays, evaluated here.
"""

import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from jaxtyping import Float
from scipy.linalg import cho_solve, cholesky, solve_triangular

from taskcal.errors import CampaignError

SEARCHED, LARGEST = 500, 3000
"""Rows among which the hyper-parameters are sought, and rows that the field keeps at most; more are thinned out evenly."""

FEWEST = 20


@dataclass(frozen=True, eq=False, kw_only=True)
class ResidualField:
    """Corrections of the tool pose in base axes: of position, metres, and where poses were measured of rotation, radians."""

    q: Float[np.ndarray, "n joints"]
    """Joint positions it was learned at, radians."""
    values: Float[np.ndarray, "n outputs"]
    """Residuals there."""
    lengths: Float[np.ndarray, " joints"]
    """Length scale of each joint, radians."""
    deviation: Float[np.ndarray, " outputs"]
    """Standard deviation of the field in each output."""
    noise: Float[np.ndarray, " outputs"]
    """Standard deviation of what it takes for noise."""

    @cached_property
    def _factor(self) -> Float[np.ndarray, "n n"]:
        """Cholesky factor of correlation and relative noise; outputs differ in size alone."""
        ratio = float((self.noise[0] / self.deviation[0]) ** 2)
        return cholesky(self._correlation(self.q, self.q) + ratio * np.eye(len(self.q)), lower=True)

    @cached_property
    def _weights(self) -> Float[np.ndarray, "n outputs"]:
        return np.asarray(cho_solve((self._factor, True), self.values))

    def _correlation(self, a: Float[np.ndarray, "n joints"], b: Float[np.ndarray, "k joints"]) -> np.ndarray:
        a, b = a / self.lengths, b / self.lengths
        square = (a**2).sum(axis=1)[:, None] + (b**2).sum(axis=1) - 2.0 * a @ b.T
        return np.exp(-0.5 * np.maximum(square, 0.0))

    def mean(self, q: Float[np.ndarray, "n joints"]) -> Float[np.ndarray, "n outputs"]:
        """The correction at joint positions q."""
        return self._correlation(np.asarray(q, dtype=float), self.q) @ self._weights

    def variance(self, q: Float[np.ndarray, "n joints"]) -> Float[np.ndarray, "n outputs"]:
        """Variance of the true correction about it, what the field takes for noise included."""
        across = solve_triangular(self._factor, self._correlation(self.q, np.asarray(q, dtype=float)), lower=True)
        left = np.maximum(1.0 - (across**2).sum(axis=0), 0.0)
        return left[:, None] * self.deviation**2 + self.noise**2

    def to_json(self) -> dict[str, Any]:
        """Arrays and numbers only."""
        return {name: getattr(self, name).tolist() for name in ("q", "values", "lengths", "deviation", "noise")}

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> "ResidualField":
        """What `to_json` wrote.

        Raises:
            ValueError: shapes that do not belong together.
        """
        arrays = {name: np.array(data[name], dtype=float) for name in ("q", "values", "lengths", "deviation", "noise")}
        n, outputs = arrays["values"].shape
        fits = (
            arrays["q"].shape == (n, len(arrays["lengths"]))
            and len(arrays["noise"]) == len(arrays["deviation"]) == outputs
        )
        if not fits or not all(np.isfinite(array).all() for array in arrays.values()):
            raise ValueError("the field's arrays do not belong together")
        return cls(**arrays)


def learn_field(
    q: Float[np.ndarray, "n joints"], residual: Float[np.ndarray, "n outputs"], seed: int = 0
) -> ResidualField:
    """Learn a field from residuals.

    Args:
        q: joint positions, radians.
        residual: what is left there in base axes, metres (and radians).
        seed: of the rows among which the hyper-parameters are sought.

    Raises:
        CampaignError: too few rows.
    """
    if len(q) < FEWEST:
        raise CampaignError(
            f"{len(q)} rows are too few to learn a residual field; measure at least {FEWEST}, better 100"
        )
    from sklearn.exceptions import ConvergenceWarning
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel

    spread = np.maximum(q.std(axis=0), 1e-3)
    size = np.sqrt((residual**2).mean(axis=0))
    shape: Any = RBF(np.full(q.shape[1], 2.0), (0.05, 100.0))  # pyright: ignore[reportArgumentType]
    kernel: Any = ConstantKernel(0.5, (1e-4, 1e2)) * shape + WhiteKernel(0.5, (1e-4, 1e1))
    rows = np.sort(np.random.default_rng(seed).permutation(len(q))[:SEARCHED])
    process = GaussianProcessRegressor(kernel, alpha=1e-10, normalize_y=False, random_state=seed)
    with warnings.catch_warnings():
        # a length at its upper bound is a joint without influence, which is an answer
        warnings.simplefilter("ignore", ConvergenceWarning)
        found: Any = process.fit((q / spread)[rows], (residual / size)[rows]).kernel_
    variance, lengths, noise = found.k1.k1.constant_value, np.atleast_1d(found.k1.k2.length_scale), found.k2.noise_level
    kept = np.unique(np.linspace(0, len(q) - 1, min(len(q), LARGEST)).astype(int))
    return ResidualField(
        q=q[kept],
        values=residual[kept],
        lengths=lengths * spread,
        deviation=np.sqrt(variance) * size,
        noise=np.sqrt(noise) * size,
    )
