"""Joint-side terms of the way on which each drive came to a pose."""

from collections.abc import Callable, Sequence

import numpy as np
from jaxtyping import Float, Int

from taskcal.robot.approach import joint_sign
from taskcal.robot.conditions import Conditions
from taskcal.robot.effects.linear_term import LinearTerm
from taskcal.robot.effects.load_path import motor_matrix
from taskcal.robot.robot import Robot

Way = Callable[[Conditions], Float[np.ndarray, "n joints"] | None]


def at_drives(
    names: Sequence[str],
    units: Sequence[str],
    robot: Robot,
    joints: Int[np.ndarray, " p"],
    tolerance: float,
    way: Way,
) -> LinearTerm:
    """A term of which each parameter turns one drive by a multiple of what its way to the pose was.

    Args:
        names: of the parameters.
        units: of the parameters.
        robot: the robot.
        joints: number of the joint whose drive each one turns.
        tolerance: of every parameter.
        way: what counts of the conditions; where they do not have it, the term is zero.
    """
    turned = motor_matrix(robot) if robot.four_bar is not None else np.diag(joint_sign(robot))
    parameter, coordinate = np.nonzero(turned[:, joints].T)
    gear = turned[coordinate, joints[parameter]]

    def unknown(q: Float[np.ndarray, "n joints"]) -> Float[np.ndarray, "n pairs"]:
        return np.zeros((len(q), len(gear)))

    def given(q: Float[np.ndarray, "n joints"], conditions: Conditions) -> Float[np.ndarray, "n pairs"]:
        motion = way(conditions)
        return unknown(q) if motion is None else motion[:, joints[parameter]] * gear

    return LinearTerm(
        names=tuple(names),
        units=tuple(units),
        tolerances=(tolerance,) * len(joints),
        pairs=np.stack([coordinate, parameter], axis=1),
        coordinates=len(robot.joints),
        basis=unknown,
        by_joint=lambda q: np.zeros((len(q), len(gear), q.shape[1])),
        given=given,
    )
