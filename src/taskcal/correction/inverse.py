"""Joint positions that bring the calibrated robot's tool to given poses."""

from dataclasses import replace

import numpy as np
from jaxtyping import Float

from taskcal.identification.calibration import Calibration
from taskcal.kinematics.inverse import Reached, solve_near
from taskcal.robot.conditions import Conditions

SETTLED_RAD = 1e-10
"""What field and conditions add has settled when it moves no joint by more than this, radians."""

MAX_ROUNDS = 8


def solve_calibrated(
    calibration: Calibration,
    T: Float[np.ndarray, "n 4 4"],
    seed: Float[np.ndarray, "n joints"],
    conditions: Conditions | None = None,
) -> Reached:
    """Solve each tool pose in the base from its own seed, on the seed's branch, on the robot as calibrated.

    What a residual field and the conditions add to the pose is small: what they add at the last joint positions is taken
    off the pose, until that settles.

    Args:
        calibration: the robot, with effects and field.
        T: poses of the robot's own tool in the calibrated base.
        seed: joint positions to start from, radians; the nominal robot's are near enough.
        conditions: how the poses are reached, for effects that depend on it; as in the middle by default.
    """
    x = calibration.estimate
    solution = solve_near(calibration.model, T, seed, x)
    if calibration.field is None and conditions is None:
        return solution
    settled = np.zeros(len(T), dtype=bool)
    for _ in range(MAX_ROUNDS):
        whole = calibration.tool_in_base(solution.q, conditions)
        solved = calibration.model.poses(solution.q, x)
        goal = np.array(T)
        goal[:, :3, 3] -= whole[:, :3, 3] - solved[:, :3, 3]
        goal[:, :3, :3] = solved[:, :3, :3] @ np.swapaxes(whole[:, :3, :3], 1, 2) @ goal[:, :3, :3]
        refined = solve_near(calibration.model, goal, solution.q, x)
        settled = np.abs(refined.q - solution.q).max(axis=1) < SETTLED_RAD
        solution = refined
        if settled.all():
            break
    return replace(solution, reached=solution.reached & settled)
