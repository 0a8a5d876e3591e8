"""The residual field of calibrations that were made before all effects were fitted at once: read and used, no longer learned.

It is a Gaussian process over the joints (Rasmussen and Williams 2006, chapter 2). Far from the measured poses it fades to zero and
its uncertainty grows to its full size. What a file holds are arrays, evaluated here.

The correction is always that of all rows. Its variance is exact up to `MAX_DENSE_ROWS` rows. Beyond, two linear predictors are
tried whose weights are free only in part, and the better one tells the variance, which is then never less than the exact
one, for that is the least of all linear predictors (chapter 2.2): weights that vary smoothly over all rows, good where
the field is smooth, and weights of the nearest rows alone, good where it is rough. Towards the edge of a neighbourhood
its rows count less, as if measured with more noise, so that the variance has no steps where the nearest change.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Float

from taskcal.estimation.matrices import squared_exponential
from taskcal.short_repr import short_repr

if TYPE_CHECKING:
    from scipy.spatial import KDTree

MAX_DENSE_ROWS, LOW_RANK, NEIGHBOURS = 3000, 400, 60
"""Rows up to which the variance is that of all; beyond, degrees of freedom of smooth weights, and nearest rows."""

CORE_SHARE, MIN_RADIUS = 0.8, 1e-3
"""Share of a neighbourhood's radius in which its rows count in full, and the smallest radius, in length scales."""

BATCH_ROWS = 256
"""Poses evaluated at a time."""


@short_repr
@dataclass(frozen=True, eq=False, kw_only=True)
class ResidualField:
    """Corrections of the tool pose in base axes: of position, metres, and where poses were measured of rotation, radians."""

    q: Float[np.ndarray, "n joints"]
    """Joint positions it was learned at, radians."""
    weights: Float[np.ndarray, "n outputs"]
    """What each adds to the correction, metres (and radians) per unit of correlation."""
    lengths: Float[np.ndarray, " joints"]
    """Length scale of each joint, radians."""
    deviation: Float[np.ndarray, " outputs"]
    """Standard deviation of the field in each output."""
    noise: Float[np.ndarray, " outputs"]
    """Standard deviation of what it takes for noise."""

    @cached_property
    def _ratio(self) -> float:
        """Variance of the noise over the field's; outputs differ in size alone."""
        return float((self.noise[0] / self.deviation[0]) ** 2)

    @cached_property
    def _scaled(self) -> Float[np.ndarray, "n joints"]:
        return self.q / self.lengths

    @cached_property
    def _factor(self) -> Float[np.ndarray, "n n"]:
        """Cholesky factor of correlation and relative noise."""
        return np.linalg.cholesky(_correlation(self._scaled, self._scaled) + self._ratio * np.eye(len(self.q)))

    @cached_property
    def _smooth(self) -> Float[np.ndarray, "n k"]:
        """Smooth weights V·G^(−½), G their covariance Vᵀ(K + ρI)V; V spans the correlation with rows spread over all."""
        picked = self._scaled[np.linspace(0, len(self.q) - 1, LOW_RANK).astype(int)]
        V, _ = np.linalg.qr(_correlation(self._scaled, picked))
        G = V.T @ _in_batches(lambda at: _correlation(at, self._scaled) @ V, self._scaled)
        from scipy.linalg import solve_triangular

        factor = np.linalg.cholesky(0.5 * (G + G.T) + self._ratio * np.eye(LOW_RANK))
        return solve_triangular(factor, V.T, lower=True).T

    @cached_property
    def _tree(self) -> "KDTree":
        from scipy.spatial import KDTree

        return KDTree(self._scaled)

    def mean(self, q: Float[np.ndarray, "n joints"]) -> Float[np.ndarray, "n outputs"]:
        """The correction at joint positions q."""
        return _in_batches(lambda at: _correlation(at, self._scaled) @ self.weights, q / self.lengths)

    def variance(self, q: Float[np.ndarray, "n joints"]) -> Float[np.ndarray, "n outputs"]:
        """Variance of the true correction about it, what the field takes for noise included."""
        left = _in_batches(self._left, q / self.lengths)
        return left[:, None] * self.deviation**2 + self.noise**2

    def _left(self, at: Float[np.ndarray, "n joints"]) -> Float[np.ndarray, " n"]:
        """Share of the field's variance that the rows leave."""
        k = _correlation(self._scaled, at)
        if len(self.q) <= MAX_DENSE_ROWS:
            from scipy.linalg import solve_triangular

            known_variance = (solve_triangular(self._factor, k, lower=True) ** 2).sum(axis=0)
        else:
            known_variance = np.maximum(((self._smooth.T @ k) ** 2).sum(axis=0), self._told_nearby(at))
        return np.maximum(1.0 - known_variance, 0.0)

    def _told_nearby(self, at: Float[np.ndarray, "n joints"]) -> Float[np.ndarray, " n"]:
        """Share of the variance that the nearest rows tell; a row of weight w counts as if its noise were 1/w times as much."""
        neighbours = self._tree.query(at, NEIGHBOURS + 1)
        distance, rows = np.asarray(neighbours[0]), np.asarray(neighbours[1])
        radius = np.maximum(distance[:, -1:], MIN_RADIUS)
        distance, near = distance[:, :-1], self._scaled[rows[:, :-1]]
        inward = np.clip((radius - distance) / ((1.0 - CORE_SHARE) * radius), 0.0, 1.0)
        root = np.sqrt(inward**2 * (3.0 - 2.0 * inward))
        apart = near - at[:, None]  # from the pose, where the subtraction below loses nothing
        square = (apart**2).sum(axis=2)
        inner = square[:, :, None] + square[:, None] - 2.0 * apart @ np.swapaxes(apart, 1, 2)
        K = squared_exponential(inner) * root[:, :, None] * root[:, None] + self._ratio * np.eye(NEIGHBOURS)
        k = squared_exponential(distance**2) * root
        return np.einsum("nk,nk->n", k, np.linalg.solve(K, k[:, :, None])[:, :, 0])

    def to_json(self) -> dict[str, Any]:
        """Arrays and numbers only."""
        return {name: getattr(self, name).tolist() for name in _ARRAYS}

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> "ResidualField":
        """What `to_json` wrote.

        Raises:
            KeyError: an array is missing.
            ValueError: shapes that do not belong together.
        """
        arrays = {name: np.array(data[name], dtype=float) for name in _ARRAYS}
        n, outputs = arrays["weights"].shape
        fits = (
            arrays["q"].shape == (n, len(arrays["lengths"]))
            and len(arrays["noise"]) == len(arrays["deviation"]) == outputs
        )
        if not fits or not all(np.isfinite(array).all() for array in arrays.values()):
            raise ValueError("the field's arrays do not belong together")
        return cls(**arrays)


_ARRAYS = ("q", "weights", "lengths", "deviation", "noise")


def _correlation(a: Float[np.ndarray, "n joints"], b: Float[np.ndarray, "k joints"]) -> Float[np.ndarray, "n k"]:
    """Between joint positions in units of their length scales."""
    square = (a**2).sum(axis=1)[:, None] + (b**2).sum(axis=1) - 2.0 * a @ b.T
    return squared_exponential(square)


def _in_batches(function: Callable[[np.ndarray], np.ndarray], at: Float[np.ndarray, "n joints"]) -> np.ndarray:
    """The function of all rows, a batch at a time, so that memory does not grow with their number."""
    return np.concatenate([function(at[i : i + BATCH_ROWS]) for i in range(0, max(len(at), 1), BATCH_ROWS)])
