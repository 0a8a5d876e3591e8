"""What a calibration left of the errors at the rows that it was fitted to, beside what the nominal robot leaves there."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from taskcal.geometry import se3
from taskcal.identification.calibration import Calibration
from taskcal.identification.fit_options import FitOptions
from taskcal.identification.nominal_fit import fit_nominal
from taskcal.identification.observation_layout import ObservationLayout
from taskcal.measurement.campaign import Campaign
from taskcal.robot.error_model import ErrorModel


@dataclass(frozen=True, eq=False, kw_only=True)
class MeasuredErrors:
    """Measured less predicted at the fitted rows, in the axes of the robot's base."""

    q: Float[np.ndarray, "n joints"]
    """Radians."""
    points: Float[np.ndarray, "n targets 3"]
    """Where the calibrated robot predicts the targets, in the robot's base, metres."""
    before: Float[np.ndarray, "n targets b"]
    """Of the nominal robot with its own tracker frame and targets, metres (then radians, for poses)."""
    after: Float[np.ndarray, "n targets b"]
    """Of the calibrated robot."""


def measured_errors(calibration: Calibration) -> MeasuredErrors | None:
    """Errors before and after, from what the calibration itself holds.

    What was measured is what is predicted and what it left. Where effects depend on how a pose is reached, which is not kept, the
    prediction is that of the middle of their range.

    Args:
        calibration: the calibration.

    Returns:
        None where the calibration does not hold its poses, or was not fitted to what a tracker measured.
    """
    q = calibration.q
    if q is None or isinstance(calibration.layout, ObservationLayout):
        return None
    residual, R = calibration.residuals, calibration.T_tracker_base[:3, :3]
    ends = calibration.target_poses(q)
    campaign = _as_measured(calibration, q, ends)
    nominal = fit_nominal(ErrorModel(calibration.model.robot), campaign, FitOptions())
    after = np.concatenate([residual[..., k : k + 3] @ R for k in range(0, residual.shape[2], 3)], axis=2)
    base = se3.inverse(calibration.T_tracker_base)
    return MeasuredErrors(
        q=q, points=se3.apply(base, ends[..., :3, 3]), before=nominal.residuals_on(campaign, frame="base"), after=after
    )


def _as_measured(
    calibration: Calibration, q: Float[np.ndarray, "n joints"], ends: Float[np.ndarray, "n targets 4 4"]
) -> Campaign:
    """The campaign, from predictions and residuals."""
    residual = calibration.residuals
    rotations = None
    if calibration.layout.pose:
        rotations = np.full((len(q), 3, 3), np.nan)
        seen = np.isfinite(residual[:, 0, 0])
        turned = se3.exp(calibration.layout.turn(calibration.z)) @ ends[seen, 0, :3, :3]
        rotations[seen] = se3.exp(residual[seen, 0, 3:]) @ turned
    return Campaign(
        ids=calibration.ids,
        q=q,
        targets=calibration.targets,
        points=ends[..., :3, 3] + residual[..., :3],
        rotations=rotations,
    )
