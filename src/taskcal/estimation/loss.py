"""Losses: how much a large residual counts.

A loss acts on the root mean square z of one point's whitened residuals, so that it does not depend on the choice of
axes; a threshold of 1.5 means one and a half standard deviations.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from taskcal.geometry import normal_equations


@dataclass(frozen=True)
class Squared:
    """Ordinary least squares."""

    code = normal_equations.SQUARED
    threshold: float = 1.0

    def weights(self, z: Float[np.ndarray, "*b"]) -> Float[np.ndarray, "*b"]:
        """Weight of each point."""
        return np.ones_like(z)


@dataclass(frozen=True)
class Huber:
    """Squared up to the threshold, linear beyond (Huber 1964)."""

    threshold: float = 1.5
    code = normal_equations.HUBER

    def weights(self, z: Float[np.ndarray, "*b"]) -> Float[np.ndarray, "*b"]:
        """Weight of each point."""
        return self.threshold / np.maximum(np.abs(z), self.threshold)


@dataclass(frozen=True)
class Cauchy:
    """Logarithmic beyond the threshold: a gross outlier counts for next to nothing."""

    threshold: float = 2.4
    code = normal_equations.CAUCHY

    def weights(self, z: Float[np.ndarray, "*b"]) -> Float[np.ndarray, "*b"]:
        """Weight of each point."""
        return 1.0 / (1.0 + (z / self.threshold) ** 2)


Loss = Squared | Huber | Cauchy
