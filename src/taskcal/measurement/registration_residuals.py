"""What the nominal robot leaves of the measurements in a registered frame."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from taskcal.measurement.campaign import Campaign
from taskcal.measurement.registration import Registration, distances, nominal_poses
from taskcal.robot.error_model import ErrorModel
from taskcal.short_repr import short_repr


@short_repr
@dataclass(frozen=True, eq=False)
class RegistrationResiduals:
    """Distances between the measured targets and where the nominal robot has them."""

    distances: Float[np.ndarray, "n targets"]
    """Metres; NaN where a target was not seen."""

    @property
    def mean(self) -> float:
        """Over all targets seen, metres."""
        return float(np.nanmean(self.distances))

    @property
    def rms(self) -> float:
        """Over all targets seen, metres."""
        return float(np.sqrt(np.nanmean(self.distances**2)))

    @property
    def maximum(self) -> float:
        """Of all targets seen, metres."""
        return float(np.nanmax(self.distances))

    @property
    def by_row(self) -> Float[np.ndarray, " n"]:
        """Of the target that is farthest off in each row, metres; zero where none was seen."""
        return np.nan_to_num(self.distances, nan=0.0).max(axis=1)

    def summary(self) -> dict[str, float]:
        """The report in millimetres."""
        return {"mean_mm": self.mean * 1e3, "rms_mm": self.rms * 1e3, "max_mm": self.maximum * 1e3}


def registration_residuals(registration: Registration, model: ErrorModel, campaign: Campaign) -> RegistrationResiduals:
    """What a registration leaves of the campaign that it is from, or of another one of the same targets.

    Args:
        registration: tracker frame and targets.
        model: the robot's model, taken as nominal.
        campaign: the measurements.

    Raises:
        CampaignError: a closed loop does not close at a row.
    """
    return RegistrationResiduals(distances(registration, campaign, nominal_poses(model, campaign)))
