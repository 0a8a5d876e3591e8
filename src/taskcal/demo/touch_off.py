"""Touching off: the controller's frames of parts, set by the robot's own cutter at marks on them."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from taskcal.correction.placement import Placement
from taskcal.correction.rigid_motion import fit_points
from taskcal.errors import TaskcalError
from taskcal.geometry import se3
from taskcal.kinematics.inverse import solve_near
from taskcal.programs.program import Move
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot import Robot

ROUNDS = 4
"""Of jogging: the robot's error changes by a thousandth of each step, so that fewer would do."""

Poses = Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True, eq=False, kw_only=True)
class TouchedPart:
    """A part that the robot has touched."""

    T: Float[np.ndarray, "4 4"]
    """Its frame in the base, as the controller then has it."""
    q: Float[np.ndarray, "marks joints"]
    """Joint positions at its marks, in the order in which they were touched, radians."""


def touch_off(
    robot: Robot,
    move: Move,
    near: Float[np.ndarray, " joints"],
    placement: Placement,
    true_poses: Poses,
    marks: Float[np.ndarray, "marks 3"],
) -> TouchedPart:
    """Touch a part with the cutter of a motion, jogged to each mark, and set the controller's frame by it.

    The frame is where the controller then believes the marks to be. What the robot's errors have in common there is so
    removed from the program.

    Args:
        robot: as its controller knows it.
        move: whose tool touches, and whose part is touched.
        near: joint positions over the part, radians.
        placement: where both truly are.
        true_poses: joint positions (n, joints) to poses (n, 4, 4) of the true robot's tool in its base.
        marks: where the cutter truly stands, upright, when it touches each, in the part's frame, metres.

    Raises:
        TaskcalError: the robot does not reach the marks.
    """
    nominal = ErrorModel(robot)
    upright = np.repeat(se3.rotation("x", np.pi)[None], len(marks), axis=0)
    believed, reached, q = marks, marks, np.repeat(near[None], len(marks), axis=0)
    for _ in range(ROUNDS):
        upright[:, :3, 3] = believed
        jogged = solve_near(nominal, move.flange(upright) @ robot.T_flange_tool, q)
        if not jogged.reached.all():
            raise TaskcalError(f"the robot does not reach the marks on '{move.part.name}'; move the workspace")
        q, reached = jogged.q, believed
        believed = believed + marks - placement.tool_in_part(true_poses(q))[:, :3, 3]
    return TouchedPart(T=move.part.T @ fit_points(marks, reached)[0], q=q)
