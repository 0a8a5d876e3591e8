"""How far a correction moves the targets of a program."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from taskcal.correction.controller_trajectory import ControllerTrajectory
from taskcal.correction.subdivision import Subdivision
from taskcal.geometry import se3
from taskcal.robot.robot import Robot


@dataclass(frozen=True, eq=False, kw_only=True)
class TargetChanges:
    """How far the nodes of every motion are from where the tool is wanted."""

    shift: Float[np.ndarray, " m"]
    """Largest distance that a node is moved by, metres."""
    turn: Float[np.ndarray, " m"]
    """Largest angle that a node is turned by, radians."""
    joint: Float[np.ndarray, " m"]
    """Largest change of a revolute joint at the motion's end, radians; NaN where it is not known."""


def target_changes(robot: Robot, subdivision: Subdivision, trajectory: ControllerTrajectory) -> TargetChanges:
    """How far each motion is changed.

    Args:
        robot: the robot.
        subdivision: the corrected motions.
        trajectory: the controller's, of the program as it was given.
    """
    nodes, m = subdivision.nodes, len(trajectory.end)
    shift, turn, joint = np.zeros(m), np.zeros(m), np.full(m, np.nan)
    np.maximum.at(shift, nodes.move, np.linalg.norm(nodes.T[:, :3, 3] - nodes.wanted[:, :3, 3], axis=1))
    angle = np.linalg.norm(se3.log(nodes.T[:, :3, :3] @ np.swapaxes(nodes.wanted[:, :3, :3], 1, 2)), axis=1)
    np.maximum.at(turn, nodes.move, angle)
    ends = nodes.share == 1.0
    move = nodes.move[ends]
    revolute = [j for j, slides in enumerate(robot.prismatic) if not slides]
    joint[move] = np.abs(nodes.q[ends] - trajectory.end[move])[:, revolute].max(axis=1, initial=0.0)
    return TargetChanges(shift=shift, turn=turn, joint=joint)
