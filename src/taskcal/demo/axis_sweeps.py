"""Sweeps of single motors about a pose, as the publication's figure 6 needs them to register the tracker."""

import numpy as np
from jaxtyping import Float

from taskcal.geometry import se3
from taskcal.robot.robot import Robot

HALF_SWEEP, PER_MOTOR = np.radians(40.0), 12
"""How far each motor turns to both sides, radians, and at how many angles it is measured."""


def sweep_motors(robot: Robot, q: Float[np.ndarray, "n joints"]) -> Float[np.ndarray, "m joints"]:
    """Each motor alone, the others as at that one of some poses that is nearest to their middle; within the limits."""
    middle = q[int(np.argmin(np.linalg.norm(q - q.mean(axis=0), axis=1)))]
    turns = np.linspace(-HALF_SWEEP, HALF_SWEEP, PER_MOTOR)
    rows = np.concatenate([middle + turns[:, None] * motor for motor in np.eye(len(middle))])
    return rows[robot.inside_limits(rows)]


def frame_error(found: Float[np.ndarray, "4 4"], true: Float[np.ndarray, "4 4"]) -> tuple[float, float]:
    """How far a frame is off, metres, and by how much it is turned, radians."""
    off = se3.inverse(true) @ found
    return float(np.linalg.norm(off[:3, 3])), float(np.linalg.norm(se3.log(off[None, :3, :3])))
