"""Joint positions that bring the calibrated robot's tool to given poses."""

from dataclasses import replace

import numpy as np
from jaxtyping import Float

from taskcal.geometry import se3
from taskcal.identification.calibration import Calibration
from taskcal.kinematics.inverse import Reached, solve_near

SETTLED_RAD = 1e-10
"""The residual field's correction has settled when it moves no joint by more than this, radians."""

MAX_ROUNDS = 8


def solve_calibrated(
    calibration: Calibration, T: Float[np.ndarray, "n 4 4"], seed: Float[np.ndarray, "n joints"]
) -> Reached:
    """Solve each tool pose in the base from its own seed, on the seed's branch, on the robot as calibrated.

    A residual field is small and smooth: what it adds at the last joint positions is taken off the pose, until that
    settles.

    Args:
        calibration: the robot, with effects and field.
        T: poses of the robot's own tool in the calibrated base.
        seed: joint positions to start from, radians; the nominal robot's are near enough.
    """
    x = calibration.estimate
    solution = solve_near(calibration.model, T, seed, x)
    if calibration.field is None:
        return solution
    settled = np.zeros(len(T), dtype=bool)
    for _ in range(MAX_ROUNDS):
        learned = calibration.field.mean(solution.q)
        goal = np.array(T)
        goal[:, :3, 3] -= learned[:, :3]
        if learned.shape[1] == 6:
            goal[:, :3, :3] = se3.exp(-learned[:, 3:]) @ goal[:, :3, :3]
        refined = solve_near(calibration.model, goal, solution.q, x)
        settled = np.abs(refined.q - solution.q).max(axis=1) < SETTLED_RAD
        solution = refined
        if settled.all():
            break
    return replace(solution, reached=solution.reached & settled)
