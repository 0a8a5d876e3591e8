"""What planes and cubes have in common: a touch is one number, that nothing is left between the tip and a face."""

from typing import ClassVar

import numpy as np
from jaxtyping import Float

from taskcal.measurement.observation.observation import Measured, Standalone
from taskcal.measurement.tracker import TrackerNoise

TOUCH = 2e-5
"""How well a touch is noticed where the campaign does not say, metres."""


class Touching(Standalone):
    """A kind whose rows are touches of faces."""

    width: ClassVar[int] = 1
    touched: ClassVar[bool] = True

    def covariance(
        self, measured: Measured, uncertainty: Float[np.ndarray, " n"] | None, tracker: TrackerNoise
    ) -> Float[np.ndarray, "n w w"]:
        """Of the noise of each row."""
        deviation = np.full(len(measured.points), TOUCH) if uncertainty is None else uncertainty
        return deviation[:, None, None] ** 2
