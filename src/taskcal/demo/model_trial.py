"""Models tried on a virtual robot that need not follow them: residuals, errors at new poses, and intervals."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from taskcal.campaigns.campaign import Campaign
from taskcal.demo.procedure import Errors, errors_in_base
from taskcal.identification.calibration import Calibration
from taskcal.robot.error_model import ErrorModel
from taskcal.virtual.cell import simulate

Fit = Callable[[Campaign], Calibration]

INSIDE = 1.959964
"""Half the width of a 95 % interval, standard deviations."""


@dataclass(frozen=True, eq=False, kw_only=True)
class ModelTrial:
    """One model on one virtual robot."""

    model: str
    calibration: Calibration
    residual: Errors
    """On the measured poses, against the measurements; as published."""
    new: Errors
    """On new poses, against the truth."""
    inside: float
    """Share of the new errors' components inside their stated 95 % intervals."""


def try_models(
    truth: ErrorModel,
    fits: Mapping[str, Fit],
    q: Float[np.ndarray, "n joints"],
    new: Float[np.ndarray, "k joints"],
    *,
    rng: np.random.Generator,
) -> list[ModelTrial]:
    """Draw a robot, measure it, identify every model from the same campaign, and see what each one leaves.

    Args:
        truth: the model that the true robot follows, which need not be among those identified.
        fits: how to identify each model, by its name.
        q: measured poses, radians.
        new: poses on which the predictions are judged, radians.
        rng: source of the robot and of the tracker's noise.
    """
    campaign, true = simulate(truth, q, rng=rng)
    trials: list[ModelTrial] = []
    for name, fit in fits.items():
        calibration = fit(campaign)
        error = (true.points(new) - calibration.predict(new))[:, 0]
        deviation = np.sqrt(np.diagonal(calibration.predict_covariance(new)[:, 0], axis1=1, axis2=2))
        trials.append(
            ModelTrial(
                model=name,
                calibration=calibration,
                residual=errors_in_base(calibration.residuals[:, 0], calibration),
                new=errors_in_base(error, calibration),
                inside=float(np.mean(np.abs(error) < INSIDE * deviation)),
            )
        )
    return trials
