"""A point on the tool, measured in the tracker's frame."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from jaxtyping import Float

from taskcal.observations.base import Differential, Measured, Observation, TrackerNoise


@dataclass(frozen=True, eq=False, kw_only=True)
class Point(Observation):
    """y = p: what a laser tracker sees of a reflector."""

    key: ClassVar[str] = "point"
    instrument: ClassVar[str] = "tracker"
    along_axes: ClassVar[bool] = True
    in_tracker: ClassVar[bool] = True
    streamed: ClassVar[bool] = True

    def differentiate(
        self, target: Float[np.ndarray, "n 4 4"], unknown: Float[np.ndarray, " u"], measured: Measured
    ) -> Differential:
        """Residual and derivatives."""
        by_target = np.zeros((len(target), 3, 6))
        by_target[:, :, :3] = np.eye(3)
        return Differential(measured.points - target[:, :3, 3], by_target, np.zeros((len(target), 3, 0)))

    def covariance(
        self, measured: Measured, uncertainty: Float[np.ndarray, " n"] | None, tracker: TrackerNoise
    ) -> Float[np.ndarray, "n w w"]:
        """Of the noise of each row."""
        if uncertainty is not None:
            return uncertainty[:, None, None] ** 2 * np.eye(3)
        return tracker.covariance(measured.points)
