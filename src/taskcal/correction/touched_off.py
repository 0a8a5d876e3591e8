"""Errors at targets on a part that was touched off, or measured, where it stands.

Whatever is common to all targets, a shift and a turn of the part against the robot, is then found and taken out. What is left is
the error of the targets against each other.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float, Int

from taskcal.correction.assessment import Deviations
from taskcal.correction.controller_trajectory import ControllerTrajectory
from taskcal.correction.frame_calibration import FrameCalibration
from taskcal.correction.rigid_motion import without_rigid_motion


def on_touched_parts(
    frames: Sequence[FrameCalibration],
    number: Int[np.ndarray, " m"],
    trajectory: ControllerTrajectory,
    found: Deviations,
) -> tuple[float, float]:
    """Mean squares of the known error and of what is not known, each part touched off for itself, metres².

    Args:
        frames: tools and parts.
        number: of the frames of every motion.
        trajectory: of the controller.
        found: errors of the program as it was given.
    """
    known, left, count = 0.0, 0.0, 0
    for k, frame in enumerate(frames):
        rows = np.flatnonzero(found.at_target & (number[found.move] == k))
        if not len(rows):
            continue
        points = trajectory.segments.end[found.move[rows]][:, :3, 3]
        known += float((without_rigid_motion(points, found.error[rows][:, :, None]) ** 2).sum())
        left += len(rows) * touched_off_variance(frame, found.q[rows])
        count += len(rows)
    return known / max(count, 1), left / max(count, 1)


def touched_off_variance(frame: FrameCalibration, q: Float[np.ndarray, "n joints"]) -> float:
    """Mean square of the error in space that a calibration must expect at targets of one touched part, metres².

    The model error at a pose counts whole; touching off takes little of it where the targets are many.

    Args:
        frame: the tool and the part.
        q: joint positions at the targets, radians.
    """
    left = without_rigid_motion(frame.points(q), frame.spread(q))
    return float((left**2).sum(axis=(1, 2)).mean() + frame.model_variance(q).mean())
