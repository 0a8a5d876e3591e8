"""SciPy's `least_squares` with differences of two points on a vectorised walk in NumPy; of six errors a joint, independent ones."""

import time

import numpy as np
from protocol import Fitted, main, start_frames
from scipy.optimize import least_squares
from serial_chain import independent, motion, turn


def calibrate(case, given: bool) -> Fitted:
    base, target = start_frames(case, given)
    errors = 6 * len(case.before)
    turns = [turn(q) for q in case.chain_q.T]

    def points(x, turns):
        T = np.broadcast_to(base @ motion(x[errors : errors + 6]), (len(turns[0]), 4, 4))
        for k, before in enumerate(case.before):
            T = T @ (before @ motion(x[6 * k : 6 * k + 6])) @ turns[k]
        end = case.end @ np.append(target + x[-3:], 1.0)
        return (T @ end)[:, :3]

    def full(z):
        x = np.zeros(errors + 9)
        x[kept] = z
        return x

    kept = np.arange(errors + 9)
    nominal = points(np.zeros(errors + 9), turns)
    J = np.column_stack([(points(step, turns) - nominal).ravel() * 1e6 for step in 1e-6 * np.eye(errors + 9)])
    kept = independent(J)
    begin = time.process_time()
    solution = least_squares(
        lambda z: (points(full(z), turns) - case.points).ravel(), np.zeros(len(kept)), method="lm", x_scale="jac"
    )
    kernel = time.process_time() - begin
    return Fitted(
        predict=lambda held: points(full(solution.x), [turn(q) for q in held.chain_q_held.T]),
        parameters=len(kept),
        kernel_s=kernel,
    )


if __name__ == "__main__":
    main(calibrate)
