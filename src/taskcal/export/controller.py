"""Joint zeros, tool and base of a controller that fit a calibrated robot best, and the remaining error."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from jaxtyping import Float

from taskcal.arguments import checked
from taskcal.errors import WrongValue
from taskcal.export.forms import placed, poses_or_spread
from taskcal.geometry import se3
from taskcal.identification.calibration import Calibration
from taskcal.identification.uncertainty_budget import check_known
from taskcal.robot.error_model import ErrorModel
from taskcal.short_repr import short_repr

LEVER_M = 0.1
"""Distance at which an error of orientation counts like one of position: the length of a tool."""

MAX_ROUNDS = 8
"""Gauss–Newton converges in three or four from offsets of zero."""

CONVERGED = 1e-12
"""Metres and radians by which the last round may still move."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Remaining:
    """Distance of the TCP from the calibrated robot's, metres."""

    rms: float
    maximum: float


@short_repr
@dataclass(frozen=True, eq=False, kw_only=True)
class ControllerOffsets:
    """Joint zeros, tool and base, and the remaining error over a task, from `fit_offsets`."""

    joint_names: tuple[str, ...]
    prismatic: tuple[bool, ...]
    joints: Float[np.ndarray, " joints"]
    """True joint positions less the controller's readings q, radians or metres."""
    base: Float[np.ndarray, "4 4"]
    """Pose of the robot's calibrated base in its nominal one."""
    tool: Float[np.ndarray, "4 4"]
    """Pose of the calibrated tool in the nominal tool."""
    tool_in_flange: Float[np.ndarray, "4 4"]
    """The tool to be set in the controller."""
    without_zeros: Remaining
    """With tool and base alone."""
    with_zeros: Remaining
    """With joint zeros as well."""
    uncertainty: float
    """Standard uncertainty of the first target at a new pose of the calibrated robot, model error included, 3D rms, metres:
    the error of corrected programs, if the tool is measured as well."""
    poses: int

    def summary(self) -> dict[str, Any]:
        """The report, in millimetres and degrees."""
        return {
            "joint_offsets": {
                f"{name}_{'mm' if slides else 'deg'}": float(value) * (1e3 if slides else 180.0 / np.pi)
                for name, slides, value in zip(self.joint_names, self.prismatic, self.joints, strict=True)
            },
            "base": placed(self.base),
            "tool": placed(self.tool_in_flange),
            "poses": self.poses,
            "tool_and_base": _left(self.without_zeros, self.uncertainty),
            "zeros_tool_and_base": _left(self.with_zeros, self.uncertainty),
            "program_correction": _left(Remaining(rms=0.0, maximum=0.0), self.uncertainty),
        }


def _left(remaining: Remaining, uncertainty: float) -> dict[str, float]:
    return {
        "left_rms_mm": remaining.rms * 1e3,
        "left_max_mm": remaining.maximum * 1e3,
        "expected_rms_mm": float(np.hypot(remaining.rms, uncertainty)) * 1e3,
    }


@checked
def fit_offsets(
    calibration: Calibration,
    q: Float[np.ndarray, "n joints"] | None = None,
    weights: Float[np.ndarray, " n"] | None = None,
    *,
    accept_uncertain: bool = False,
) -> ControllerOffsets:
    """Fit joint zeros, tool and base of the nominal robot to the calibrated one.

    Least squares over poses, positions in metres, orientations at the end of a lever of 0.1 m.

    Args:
        calibration: the robot.
        q: joint positions that reach a task; all over the joints' ranges by default.
        weights: how much each counts; all the same by default.
        accept_uncertain: fit them although the calibration knows less there than the robot's tolerances do.

    Raises:
        WrongValue: q has no rows, or weights not one for each of them.
        TaskcalError: the calibration knows next to nothing at these poses.
    """
    q = poses_or_spread(calibration, q)
    if weights is not None and len(weights) != len(q):
        raise WrongValue(f"weights has {len(weights)} entries, and {len(q)} poses count (q); give one for each")
    if not accept_uncertain:
        check_known(calibration, q, f"offsets for {len(q)} poses are not fitted")
    share = np.full(len(q), 1.0 / len(q)) if weights is None else weights / weights.sum()
    fit = _OffsetFit(model=ErrorModel(calibration.model.robot), q=q, goal=calibration.tool_in_base(q), weights=share)
    start = _Offsets(joints=np.zeros(q.shape[1]), base=np.eye(4), tool=np.eye(4))
    frames, every = fit.solve(start, zeros=False), fit.solve(start, zeros=True)
    covariance = calibration.predict_covariance(q)[:, 0, :3, :3]
    robot = calibration.model.robot
    return ControllerOffsets(
        joint_names=robot.joint_names,
        prismatic=robot.prismatic,
        joints=every.joints,
        base=every.base,
        tool=every.tool,
        tool_in_flange=robot.T_flange_tool @ every.tool,
        without_zeros=fit.remaining(frames),
        with_zeros=fit.remaining(every),
        uncertainty=float(np.sqrt(share @ np.trace(covariance, axis1=1, axis2=2))),
        poses=len(q),
    )


@dataclass(frozen=True, eq=False, kw_only=True)
class _Offsets:
    """Present estimate of a fit."""

    joints: Float[np.ndarray, " joints"]
    base: Float[np.ndarray, "4 4"]
    tool: Float[np.ndarray, "4 4"]


@dataclass(frozen=True, eq=False, kw_only=True)
class _OffsetFit:
    """Nominal robot and goal."""

    model: ErrorModel
    q: Float[np.ndarray, "n joints"]
    goal: Float[np.ndarray, "n 4 4"]
    weights: Float[np.ndarray, " n"]

    def solve(self, at: _Offsets, *, zeros: bool) -> _Offsets:
        """Gauss–Newton steps; among offsets that do the same, such as of the base and the first joint, the smallest."""
        scale = np.sqrt(self.weights)[:, None] * np.array([1.0] * 3 + [LEVER_M] * 3)
        for _ in range(MAX_ROUNDS):
            J, r = self._linearised(at, zeros=zeros)
            J, r = (scale[:, :, None] * J).reshape(-1, J.shape[2]), (scale * r).reshape(-1)
            step = np.linalg.lstsq(J, r, rcond=1e-9)[0]
            at = _moved(at, step)
            if np.abs(step).max() < CONVERGED:
                break
        return at

    def predicted(self, at: _Offsets) -> Float[np.ndarray, "n 4 4"]:
        """Tool poses of the nominal robot with offsets."""
        return at.base @ self.model.poses(self.q + at.joints) @ at.tool

    def remaining(self, at: _Offsets) -> Remaining:
        """Remaining error."""
        off = np.linalg.norm(self.predicted(at)[:, :3, 3] - self.goal[:, :3, 3], axis=1)
        return Remaining(rms=float(np.sqrt(self.weights @ off**2)), maximum=float(off.max()))

    def _linearised(self, at: _Offsets, *, zeros: bool) -> tuple[np.ndarray, np.ndarray]:
        """Columns of base, tool and joints, and what is left: rows vx vy vz wx wy wz at the tool."""
        nominal = self.model.poses(self.q + at.joints)
        T = at.base @ nominal @ at.tool
        p, R = T[:, :3, 3], T[:, :3, :3]
        by_base = np.concatenate([se3.by_twist(p), np.zeros((len(p), 3, 6))], axis=1)
        by_base[:, 3:, 3:] = np.eye(3)
        by_tool = np.zeros((len(p), 6, 6))
        by_tool[:, :3, :3] = by_tool[:, 3:, 3:] = R
        blocks = [by_base, by_tool]
        if zeros:
            arm = (nominal[:, :3, :3] @ at.tool[:3, 3:])[..., 0]
            by_joint = se3.carry(self.model.joint_jacobian(self.q + at.joints), arm)
            blocks.append(
                np.concatenate([at.base[:3, :3] @ by_joint[:, :3], at.base[:3, :3] @ by_joint[:, 3:]], axis=1)
            )
        turn = se3.log(self.goal[:, :3, :3] @ np.swapaxes(R, 1, 2))
        return np.concatenate(blocks, axis=2), np.concatenate([self.goal[:, :3, 3] - p, turn], axis=1)


def _moved(at: _Offsets, step: Float[np.ndarray, " k"]) -> _Offsets:
    base = se3.pose(se3.exp(step[3:6]), step[:3]) @ at.base
    tool = at.tool @ se3.pose(se3.exp(step[9:12]), step[6:9])
    joints = at.joints + step[12:] if len(step) > 12 else at.joints
    return replace(at, base=base, tool=tool, joints=joints)
