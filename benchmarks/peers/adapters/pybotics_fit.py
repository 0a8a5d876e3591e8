"""pybotics as in its calibration example: `OptimizationHandler` and `optimize_accuracy` under MINPACK's Levenberg–Marquardt.

Its example says to mask parameters and leaves it to the user which: here those that the world frame, the tool's position or a
parallel neighbour say as well. Lengths are in millimetres, as in its own robots.
"""

import time

import numpy as np
from protocol import Fitted, main, start_frames
from pybotics.geometry import matrix_2_vector, vector_2_matrix
from pybotics.optimization import OptimizationHandler, optimize_accuracy
from pybotics.robot import Robot
from pybotics.tool import Tool
from scipy.optimize import least_squares


def calibrate(case, given: bool, residuals=optimize_accuracy, each: int = 1) -> Fitted:
    base, target = start_frames(case, given)
    handler = OptimizationHandler(
        robot=nominal(case, base, target),
        kinematic_chain_mask=independent(case.mdh).ravel().tolist(),
        tool_mask=[True] * 3 + [False] * 3,
        world_mask=True,
    )
    begin = time.process_time()
    solution = least_squares(
        residuals,
        handler.generate_optimization_vector(),
        args=(handler, case.chain_q, case.points * 1e3),
        method="lm" if each * len(case.chain_q) >= len(handler.generate_optimization_vector()) else "trf",
        x_scale="jac",
    )
    kernel = time.process_time() - begin
    handler.apply_optimization_vector(solution.x)
    return Fitted(
        predict=lambda held: np.array([handler.robot.fk(q)[:3, 3] for q in held.chain_q_held]) * 1e-3,
        parameters=len(solution.x),
        kernel_s=kernel,
    )


def independent(mdh):
    """Which of alpha, a, theta, d of each row nothing else says."""
    mask = np.ones((len(mdh), 4), dtype=bool)
    mask[0] = False  # the world frame
    mask[-1, 2:] = False  # the tool's position
    mask[np.flatnonzero(np.abs(np.sin(mdh[1:, 0])) < 1e-9), 3] = (
        False  # shifts along parallel axes: one of them is enough
    )
    return mask


def nominal(case, base, target) -> Robot:
    """The nominal robot; pybotics' links are alpha, a, theta, d."""
    alpha, a, d, theta = case.mdh.T
    robot = Robot.from_parameters(np.column_stack([alpha, a * 1e3, theta, d * 1e3]).ravel())
    robot.world_frame = millimetres(base @ case.mdh_base)
    shift = np.eye(4)
    shift[:3, 3] = target
    tool = Tool()
    tool.matrix = millimetres(case.mdh_tool @ shift)
    robot.tool = tool
    return robot


def millimetres(T):
    scaled = np.array(T)
    scaled[:3, 3] *= 1e3
    return vector_2_matrix(matrix_2_vector(scaled))


if __name__ == "__main__":
    main(calibrate)
