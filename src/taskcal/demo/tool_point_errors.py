"""Errors of the tool point in a few numbers."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from taskcal.identification.calibration import Calibration


@dataclass(frozen=True, kw_only=True)
class Errors:
    """Errors of the predicted tool point against the true one, in the robot's base axes, metres."""

    mean: float
    maximum: float
    per_axis: tuple[float, float, float]


def errors_in_base(in_tracker: Float[np.ndarray, "n 3"], calibration: Calibration) -> Errors:
    """The size of errors, along the robot's base axes.

    Args:
        in_tracker: errors of the tool point in the tracker frame, metres.
        calibration: says how the base lies in it.
    """
    in_base = in_tracker @ calibration.T_tracker_base[:3, :3]
    length = np.linalg.norm(in_base, axis=1)
    x, y, z = np.abs(in_base).max(axis=0)
    return Errors(mean=float(length.mean()), maximum=float(length.max()), per_axis=(float(x), float(y), float(z)))
