"""Predictions of new poses beside what was true there."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.special import chdtri


@dataclass(frozen=True, eq=False, kw_only=True)
class Predictions:
    """One calibration on poses that it was not fitted to."""

    campaign: str
    """Which poses were measured for it."""
    model: str
    """Which parameters were identified, and how."""
    where: str
    """Which new poses these are."""
    q: Float[np.ndarray, "n joints"]
    """Of the new poses, radians."""
    position: Float[np.ndarray, "n 3"]
    """Nominal tool points in the base, metres."""
    angle: Float[np.ndarray, " n"]
    """Rotation of the tool from a reference orientation, radians."""
    error: Float[np.ndarray, "n 3"]
    """True less predicted tool point in the tracker frame, metres."""
    covariance: Float[np.ndarray, "n 3 3"]
    """Of that error, as the calibration states it, m²."""

    @property
    def length(self) -> Float[np.ndarray, " n"]:
        """Error in space, metres."""
        return np.linalg.norm(self.error, axis=1)

    @property
    def stated(self) -> Float[np.ndarray, " n"]:
        """Stated standard uncertainty in space, metres."""
        return np.sqrt(np.trace(self.covariance, axis1=1, axis2=2))

    @property
    def squared_distance(self) -> Float[np.ndarray, " n"]:
        """Squared Mahalanobis distance of every error: χ² with three degrees of freedom where the statement is right."""
        white = np.linalg.solve(self.covariance, self.error[..., None])[..., 0]
        return np.einsum("ni,ni->n", self.error, white)

    def share_inside(self, probability: float) -> float:
        """Share of the errors inside the stated ellipsoid of a probability."""
        return float(np.mean(self.squared_distance <= chdtri(3, 1.0 - probability)))
