"""Pinocchio: poses and its kinematic regressors of every joint's placement as an analytic Jacobian for SciPy's `least_squares`.

Pinocchio calibrates nothing by itself; this is what its derivatives are worth to whoever writes the calibration.
"""

import time

import numpy as np
import pinocchio as pin
from protocol import Fitted, main, start_frames
from scipy.optimize import least_squares
from serial_chain import independent


class Chain:
    """A model whose joint placements, base and reflector move."""

    def __init__(self, case, base, target):
        self.model = pin.buildModelFromUrdf(str(case.folder / "robot.urdf"))
        self.frame = self.model.getFrameId("tool" if self.model.existFrame("tool") else "tool0")
        self.nominal = [placement.copy() for placement in self.model.jointPlacements]
        self.base, self.target = pin.SE3(base), target
        self.errors = 6 * (self.model.njoints - 1)

    def place(self, x):
        """Placements with small motions behind them; returns the base and the reflector."""
        for k in range(1, self.model.njoints):
            self.model.jointPlacements[k] = self.nominal[k] * pin.exp6(x[6 * k - 6 : 6 * k])
        self.data = self.model.createData()
        return self.base * pin.exp6(x[self.errors : self.errors + 6]), self.target + x[-3:]

    def points(self, x, Q):
        base, target = self.place(x)
        out = np.empty((len(Q), 3))
        for i, q in enumerate(Q):
            pin.framesForwardKinematics(self.model, self.data, q)
            out[i] = base.act(self.data.oMf[self.frame].act(target))
        return out

    def jacobian(self, x, Q):
        """By the regressor in the reflector's frame; at x, to first order in the motions behind the placements."""
        base, target = self.place(x)
        J = np.zeros((len(Q), 3, self.errors + 9))
        at = pin.SE3(np.eye(3), target)
        for i, q in enumerate(Q):
            pin.framesForwardKinematics(self.model, self.data, q)
            tool = self.data.oMf[self.frame]
            R = (base * tool).rotation
            frame = self.model.frames[self.frame]
            regressor = pin.computeJointKinematicRegressor(
                self.model, self.data, frame.parentJoint, pin.LOCAL, frame.placement * at
            )
            J[i, :, : self.errors] = R @ regressor[:3]
            p = tool.act(target)
            J[i, :, self.errors : self.errors + 3] = base.rotation
            J[i, :, self.errors + 3 : self.errors + 6] = -base.rotation @ pin.skew(p)
            J[i, :, -3:] = R
        return J.reshape(-1, self.errors + 9)


def calibrate(case, given: bool) -> Fitted:
    base, target = start_frames(case, given)
    chain = Chain(case, base, target)
    zero = np.zeros(chain.errors + 9)
    kept = independent(chain.jacobian(zero, case.chain_q))

    def full(z):
        x = zero.copy()
        x[kept] = z
        return x

    begin = time.process_time()
    solution = least_squares(
        lambda z: (chain.points(full(z), case.chain_q) - case.points).ravel(),
        np.zeros(len(kept)),
        jac=lambda z: chain.jacobian(full(z), case.chain_q)[:, kept],
        method="lm",
        x_scale="jac",
    )
    kernel = time.process_time() - begin
    return Fitted(
        predict=lambda held: chain.points(full(solution.x), held.chain_q_held), parameters=len(kept), kernel_s=kernel
    )


if __name__ == "__main__":
    main(calibrate)
