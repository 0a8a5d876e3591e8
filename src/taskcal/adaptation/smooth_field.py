"""What geometry does not explain, as a smooth random field over the joints instead of white noise."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from taskcal.estimation.squared_exponential import squared_exponential

LANDMARKS, FIELD_LENGTH = 40, 2.0
"""A smooth model error has so many landmarks, and varies over so many standard deviations of each joint's positions."""


@dataclass(frozen=True, eq=False, kw_only=True)
class SmoothField:
    """What geometry does not explain, as a smooth random field over the joints instead of white noise.

    The residuals of a real robot are much alike at neighbouring poses (gears, compliance). If they were white, the best
    poses would crowd at the extremes, and there they would teach the geometry what is the field's; as a Gaussian process
    they call for poses that represent the task. Its covariance is approximated on landmarks (Nyström; the remainder stays
    white, as in Snelson and Ghahramani 2006).
    """

    deviation: float
    """Standard deviation per axis, metres."""
    landmarks: Float[np.ndarray, "k joints"]
    """In units of `scale`."""
    scale: Float[np.ndarray, " joints"]
    """Length scale of each joint, radians or metres."""
    root: Float[np.ndarray, "k k"]
    """Inverse Cholesky factor of the landmarks' correlation."""

    @classmethod
    def over(
        cls, deviation: float, q: Float[np.ndarray, "n joints"], spread: Float[np.ndarray, " joints"]
    ) -> "SmoothField":
        """A field whose landmarks are some of the poses q."""
        scale = FIELD_LENGTH * np.maximum(spread, 1e-6)
        landmarks = q[np.linspace(0, len(q) - 1, min(LANDMARKS, len(q))).astype(int)] / scale
        K = _correlation(landmarks, landmarks) + 1e-6 * np.eye(len(landmarks))
        return cls(deviation=deviation, landmarks=landmarks, scale=scale, root=np.linalg.inv(np.linalg.cholesky(K)))

    def columns(self, q: Float[np.ndarray, "n joints"]) -> tuple[Float[np.ndarray, "n 3 c"], Float[np.ndarray, " n"]]:
        """Sensitivities of a point to the field's coefficients, of unit variance; and the variance left white."""
        features = _correlation(q / self.scale, self.landmarks) @ self.root.T
        k = features.shape[1]
        out = np.zeros((len(q), 3, 3 * k))
        for axis in range(3):
            out[:, axis, axis * k : (axis + 1) * k] = self.deviation * features
        white = self.deviation**2 * np.clip(1.0 - (features**2).sum(axis=1), 0.0, 1.0)
        return out, white


def _correlation(a: Float[np.ndarray, "n joints"], b: Float[np.ndarray, "k joints"]) -> Float[np.ndarray, "n k"]:
    return squared_exponential(((a[:, None] - b[None]) ** 2).sum(axis=2))
