"""What a measurement tells apart: directions of parameters of which its data say more than their tolerances did."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float

from taskcal.errors import shortened

SMALLEST = 0.05
"""Share of a direction's largest coefficient under which one is left out of its description."""


@dataclass(frozen=True, kw_only=True)
class Direction:
    """A combination of parameters that the poses see, independent of all others before and after the measurement."""

    coefficients: Mapping[str, float]
    """In units of the tolerances, the largest first and positive; their squares add up to one."""
    information: float
    """λ, how much more the data say of it than the prior: the prior's variance over that of the data alone."""

    def __repr__(self) -> str:
        terms = ", ".join(f"{name} {c:+.3g}" for name, c in self.leading.items())
        return f"Direction({self.left:.3g} σ left: {shortened(terms, 120)})"

    @property
    def left(self) -> float:
        """Standard deviation after the measurement over that before, (1 + λ)^−½."""
        return float((1.0 + self.information) ** -0.5)

    @property
    def leading(self) -> dict[str, float]:
        """Coefficients of at least a twentieth of the largest."""
        largest = max(map(abs, self.coefficients.values()))
        return {name: c for name, c in self.coefficients.items() if abs(c) >= SMALLEST * largest}


@dataclass(frozen=True, eq=False, kw_only=True)
class ToldApart:
    """Directions that are independent exactly, and how many of them a measurement with noise tells apart."""

    noise: float
    """Standard deviation per axis at every pose, metres."""
    directions: tuple[Direction, ...]
    """As many as the exact rank, the weakest first."""

    @property
    def count(self) -> int:
        """Directions of which the data say more than the tolerances, λ > 1: less than half of the variance is left."""
        return sum(direction.information > 1.0 for direction in self.directions)

    @property
    def lost(self) -> tuple[Direction, ...]:
        """Directions that are independent exactly and not told apart, the weakest first."""
        return self.directions[: len(self.directions) - self.count]

    def summary(self) -> dict[str, Any]:
        """The report; coefficients in units of the tolerances."""
        return {
            "count": self.count,
            "rank": len(self.directions),
            "directions": [
                {"coefficients": d.leading, "information": d.information, "left": d.left} for d in self.directions
            ],
        }

    def __repr__(self) -> str:
        weakest = f"; weakest: {shortened(', '.join(self.directions[0].leading), 80)}" if self.directions else ""
        return f"ToldApart({self.count} of {len(self.directions)} directions at {self.noise * 1e3:.3g} mm{weakest})"


def find_told_apart(
    matrix: Float[np.ndarray, "rows p"],
    names: tuple[str, ...],
    tolerances: Float[np.ndarray, " p"],
    rank: int,
    noise: float,
) -> ToldApart:
    """Compare the information of a measurement with that of the tolerances, direction by direction.

    With S the stacked sensitivities in units of the tolerances and σ the noise, H = SᵀS/σ² is the information that the data
    add to a prior of unit covariance. Prior and H share the eigenvectors of H: along each, the variance falls from 1 to
    1/(1 + λ).

    Args:
        matrix: stacked sensitivities, or their triangular factor, SI units.
        names: of its columns.
        tolerances: prior standard deviations of the columns, metres and radians.
        rank: how many directions are independent exactly.
        noise: standard deviation per axis at every pose, metres.

    Raises:
        ValueError: the noise is not a positive number.
    """
    if not 0.0 < noise < np.inf:
        raise ValueError(
            f"noise of {noise!r} m; give a positive standard deviation per axis in metres, such as that of tracker and "
            "model error together, 0.3e-3"
        )
    _, s, Vt = np.linalg.svd(matrix * (tolerances / noise), full_matrices=False)
    weakest_first = range(min(rank, len(s)) - 1, -1, -1)
    return ToldApart(
        noise=float(noise),
        directions=tuple(_direction(Vt[k], names, float(s[k] ** 2)) for k in weakest_first),
    )


def _direction(v: Float[np.ndarray, " p"], names: tuple[str, ...], information: float) -> Direction:
    order = np.argsort(-np.abs(v), kind="stable")
    sign = 1.0 if v[order[0]] > 0.0 else -1.0
    return Direction(coefficients={names[i]: float(sign * v[i]) for i in order}, information=information)
