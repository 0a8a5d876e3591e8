"""What is uncertain of a pose where it is not known from which sides the joints come."""

from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float

from taskcal.geometry import se3
from taskcal.robot.conditions import Conditions

if TYPE_CHECKING:
    from taskcal.identification.calibration import Calibration


def approach_covariance(
    calibration: "Calibration", q: Float[np.ndarray, "n joints"]
) -> Float[np.ndarray, "n targets b b"]:
    """Covariance of the targets where the last moves are unknown, metres² (and radians², for poses), tracker frame.

    Each joint came from either side with even chance. Its share of the largest move is evenly spread between nothing and
    all, so that the mean of its square is 1/3, and of its product with the side 1/2.

    Args:
        calibration: with effects that depend on the approach or on the move.
        q: joint positions, radians.
    """
    middle = calibration.target_poses(q)
    out = np.zeros((*middle.shape[:2], 6, 6))
    for j in range(q.shape[1]):
        way = np.broadcast_to(np.eye(q.shape[1])[j], q.shape)
        side, move = (
            _displacement(middle, calibration.target_poses(q, conditions))
            for conditions in (Conditions(approach=way), Conditions(move=way))
        )
        both = side[..., :, None] * move[..., None, :]
        out += side[..., :, None] * side[..., None, :] + 0.5 * (both + np.swapaxes(both, -1, -2))
        out += move[..., :, None] * move[..., None, :] / 3.0
    return out if calibration.layout.pose else out[..., :3, :3]


def _displacement(
    middle: Float[np.ndarray, "n targets 4 4"], ends: Float[np.ndarray, "n targets 4 4"]
) -> Float[np.ndarray, "n targets 6"]:
    """How far the targets move and turn."""
    moved = ends[..., :3, 3] - middle[..., :3, 3]
    turned = se3.log(ends[..., :3, :3] @ np.swapaxes(middle[..., :3, :3], -1, -2))
    return np.concatenate([moved, turned], axis=-1)
