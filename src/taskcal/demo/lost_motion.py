"""Lost motion as gears have it: after a reversal the joint falls behind little by little, not at once."""

import numpy as np
from jaxtyping import Float

from taskcal.robot.approach import drive_motion
from taskcal.robot.robot import Robot

WIDTHS, SHARES = (2e-4, 1e-3, 5e-3), (0.5, 0.3, 0.2)
"""Half the way, radians of the joint, on which each share of the lost motion is taken up after a reversal."""


def lost_motion(robot: Robot, q: Float[np.ndarray, "n joints"]) -> Float[np.ndarray, "n joints"]:
    """How far through its lost motion each drive is, from −1 to 1, at joint positions reached one after another.

    Play operators of several widths, side by side (Prandtl and Ishlinskii); at the first position every drive is in the
    middle. Where only the direction counts, this is its sign.

    Args:
        robot: the robot.
        q: joint positions in the order in which they are reached, each joint turning in one direction between two, radians.
    """
    turn = np.diff(q @ drive_motion(robot).T, axis=0, prepend=(q @ drive_motion(robot).T)[:1])
    widths = np.array(WIDTHS)[:, None]
    state = np.zeros((len(WIDTHS), q.shape[1]))
    out = np.empty_like(q)
    for i, step in enumerate(turn):
        state = np.clip(state + step, -widths, widths)
        out[i] = np.array(SHARES) @ (state / widths)
    return out
