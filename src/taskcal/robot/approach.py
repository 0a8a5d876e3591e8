"""How each drive came to a pose, where poses were reached one after another."""

import numpy as np
from jaxtyping import Bool, Float

from taskcal.robot.conditions import Conditions
from taskcal.robot.robot import Robot

MAX_REST_MOTION = 1e-4
"""Largest motion of a drive that leaves it as it is, radians or metres: what a controller reports of a joint at rest."""


def joint_sign(robot: Robot) -> Float[np.ndarray, " joints"]:
    """Whether the chain coordinate of each joint grows (1) or falls (−1) with the joint's own value."""
    return np.where(np.diag(robot.joint_map.matrix) < 0.0, -1.0, 1.0)


def drive_motion(robot: Robot) -> Float[np.ndarray, "joints joints"]:
    """How far each joint's drive turns, in the joint's own sense, for a change of the controller's positions.

    Behind a four-bar the controller counts motors. A coupling without one is the controller's way of counting, and each
    drive stands at its own axis.
    """
    if robot.four_bar is not None:
        return np.eye(len(robot.joints))
    return robot.joint_map.matrix[: len(robot.joints)] * joint_sign(robot)[:, None]


def conditions_in_order(
    robot: Robot, q: Float[np.ndarray, "n joints"], follows: Bool[np.ndarray, " n"] | None = None
) -> Conditions:
    """The last move of each drive, and its way; a drive that stood still keeps its way.

    Args:
        robot: the robot.
        q: joint positions in the order in which they were reached, radians.
        follows: whether a pose was reached from the one before it; all but the first by default. After a gap nothing is
            known of a drive until it moves.
    """
    reached = np.arange(len(q)) > 0 if follows is None else follows & (np.arange(len(q)) > 0)
    move = np.where(reached[:, None], np.diff(q, axis=0, prepend=q[:1]) @ drive_motion(robot).T, 0.0)
    approach = np.where(np.abs(move) > MAX_REST_MOTION, np.sign(move), 0.0)
    for i in np.flatnonzero(reached):
        approach[i] = np.where(approach[i] == 0.0, approach[i - 1], approach[i])
    return Conditions(approach=approach, move=move)
