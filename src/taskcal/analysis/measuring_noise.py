"""How far a measured point is off per axis: the tracker's noise, and what no parameter explains."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float

from taskcal.geometry import se3
from taskcal.measurement.campaign import Campaign
from taskcal.measurement.tracker import TrackerNoise
from taskcal.measurement.virtual_cell import TRACKER_POSE
from taskcal.public_names import FormerName
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.model_error import ModelError, model_error_of


@dataclass(frozen=True, kw_only=True)
class MeasuringNoise:
    """Standard deviations per axis at every pose, metres."""

    tracker: float
    model_error: ModelError

    @property
    def total(self) -> float:
        """Of both together, metres."""
        return float(np.hypot(self.tracker, self.model_error.position))

    def describe(self) -> str:
        """Its parts in words, and where the model error comes from."""
        return (
            f"{self.total * 1e3:.3g} mm per axis at every pose: tracker {self.tracker * 1e3:.2g} mm, model error "
            f"{self.model_error.position * 1e3:.3g} mm ({self.model_error.source})"
        )

    def summary(self) -> dict[str, Any]:
        """The report, in millimetres."""
        return {
            "noise_mm": self.total * 1e3,
            "tracker_mm": self.tracker * 1e3,
            "model_error_mm": self.model_error.position * 1e3,
            "model_error_origin": self.model_error.source,
        }

    to_json = FormerName("summary")


def measuring_noise(
    model: ErrorModel,
    q: Float[np.ndarray, "n joints"],
    campaign: Campaign | None = None,
    model_error: float | None = None,
) -> MeasuringNoise:
    """The noise of a campaign, or of one that a tracker four metres away would measure.

    Args:
        model: the model.
        q: joint positions, radians.
        campaign: measured there, if it was; its stated uncertainties count.
        model_error: standard deviation per axis, metres; by default that of the robot's file, or of a typical robot.
    """
    if campaign is None:
        covariance = TrackerNoise().covariance(se3.apply(TRACKER_POSE, model.poses(q)[:, :3, 3]))
    else:
        covariance = campaign.covariances()[campaign.valid][:, :3, :3]
    tracker = float(np.sqrt(np.trace(covariance, axis1=-2, axis2=-1).mean() / 3.0))
    return MeasuringNoise(tracker=tracker, model_error=model_error_of(model.robot, model_error))
