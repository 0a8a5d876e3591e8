"""Uncertainty of a laser tracker's points: along the beam and across it, growing with distance."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from taskcal.short_repr import short_repr


@short_repr
@dataclass(frozen=True, kw_only=True)
class TrackerNoise:
    """Maximum permissible errors of range and transverse position, linear in the distance, and what share is 1σ.

    The defaults are those of a Leica AT901: ±(15 µm + 6 µm/m) in both, with the MPE taken as two standard deviations.
    """

    range_m: float = 15e-6
    """MPE along the beam, metres."""
    range_per_m: float = 6e-6
    transverse_m: float = 15e-6
    """MPE across the beam, metres."""
    transverse_per_m: float = 6e-6
    mpe_to_sigma: float = 0.5
    """1σ per MPE: 0.5 where the MPE is two standard deviations, 1/√3 for a rectangular distribution."""
    station: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Where the beam leaves, in the measuring frame, metres."""
    rotation: float = 5e-5
    """1σ of each rotation component of a measured pose, radians."""

    def covariance(self, points: Float[np.ndarray, "*b 3"]) -> Float[np.ndarray, "*b 3 3"]:
        """Covariance of measured points, m²; NaN stays NaN."""
        beam = points - np.asarray(self.station)
        distance = np.linalg.norm(beam, axis=-1)[..., None]
        u = beam / np.maximum(distance, 1e-9)
        along = (self.mpe_to_sigma * (self.range_m + self.range_per_m * distance)) ** 2
        across = (self.mpe_to_sigma * (self.transverse_m + self.transverse_per_m * distance)) ** 2
        return across[..., None] * np.eye(3) + (along - across)[..., None] * u[..., :, None] * u[..., None, :]
