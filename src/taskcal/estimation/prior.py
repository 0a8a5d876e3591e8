"""What is known of parameters before any measurement."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float

from taskcal.arguments import checked
from taskcal.errors import WrongValue
from taskcal.estimation.matrices import invert_scaled
from taskcal.short_repr import short_repr


@checked
@short_repr
@dataclass(frozen=True, eq=False)
class GaussianPrior:
    """A normal distribution of parameters."""

    mean: Float[np.ndarray, " p"]
    """Metres and radians."""
    covariance: Float[np.ndarray, "p p"]
    """Positive definite, in the same units squared."""

    def __post_init__(self) -> None:
        p = len(self.mean)
        if self.covariance.shape != (p, p):
            raise WrongValue(f"mean has {p} entries; give a covariance of ({p}, {p}), not {self.covariance.shape}")
        if not np.all(np.linalg.eigvalsh(self._correlation()) > 0):
            raise WrongValue("a prior's covariance must be positive definite")

    def _correlation(self) -> np.ndarray:
        scale = np.sqrt(np.maximum(np.diag(self.covariance), 1e-300))
        return self.covariance / scale / scale[:, None]

    @cached_property
    def precision(self) -> Float[np.ndarray, "p p"]:
        """Inverse of the covariance."""
        return invert_scaled(self.covariance)

    @classmethod
    def of_deviations(cls, deviations: Float[np.ndarray, " p"]) -> "GaussianPrior":
        """Independent parameters about zero, with these standard deviations."""
        return cls(np.zeros(len(deviations)), np.diag(np.asarray(deviations, dtype=float) ** 2))

    def mapped(self, B: Float[np.ndarray, "k p"]) -> "GaussianPrior":
        """The prior of B·x, as when the effect of dropped parameters goes over to the kept ones: Σ_K = B·Σ₀·Bᵀ."""
        return GaussianPrior(B @ self.mean, B @ self.covariance @ B.T)

    def take(self, rows: "np.ndarray") -> "GaussianPrior":
        """The marginal prior of some of the parameters."""
        return GaussianPrior(self.mean[rows], self.covariance[np.ix_(rows, rows)])
