"""What a calibrated robot is off once the work's frame and the tool point were taught with it.

Without a tracker nobody knows where the robot's base stands, or asks; and what a camera sees says nothing of a spindle beside it.
Both are taught with the calibrated robot itself. What is left is the error of its shape, the same for every way to measure.
"""

import numpy as np
from jaxtyping import Float

from taskcal.geometry import se3


def aligned_errors(
    tool: Float[np.ndarray, "n 4 4"], true: Float[np.ndarray, "n 3"], weights: Float[np.ndarray, " n"]
) -> Float[np.ndarray, "n 3"]:
    """True less predicted tool points, metres, with the frame and the tool point on the tool that make them least.

    Args:
        tool: poses of the tool that a calibration predicts, in the base.
        true: the true tool points, in the base; some millimetres off, for which the equations are linear.
        weights: how much each pose counts.
    """
    p = tool[:, :3, 3]
    middle = np.average(p, axis=0, weights=weights)
    A = np.concatenate([se3.by_twist(p - middle), tool[:, :3, :3]], axis=2)
    root = np.sqrt(weights)
    x = np.linalg.lstsq((A * root[:, None, None]).reshape(-1, 9), ((true - p) * root[:, None]).reshape(-1), rcond=1e-9)[
        0
    ]
    return true - p - A @ x
