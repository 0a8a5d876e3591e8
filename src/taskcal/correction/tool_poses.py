"""Tool poses at joint values, nominal and calibrated, and joint values for tool poses."""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float

from taskcal.arguments import joints_checked
from taskcal.errors import ReachError
from taskcal.geometry import se3
from taskcal.identification.calibration import Calibration
from taskcal.kinematics.inverse import (
    REAL_ROBOT,
    ROUNDED_POSE,
    SAME_POSTURE_RAD,
    Miss,
    Reached,
    find_postures,
    solve_near,
)
from taskcal.robot.conditions import Conditions
from taskcal.robot.error_model import ErrorModel
from taskcal.short_repr import short_repr

SETTLED_RAD = 1e-10
"""What conditions add has settled when it moves no joint by more than this, radians."""

MAX_ROUNDS = 8


@joints_checked
def solve_calibrated(
    calibration: Calibration,
    T: Float[np.ndarray, "n 4 4"],
    seed: Float[np.ndarray, "n joints"],
    conditions: Conditions | None = None,
) -> Reached:
    """Solve each tool pose in the base from its own seed, on the seed's branch, on the robot as calibrated.

    What the conditions add to the pose is small: what they add at the last joint positions is taken off the pose, until that
    settles.

    Args:
        calibration: the robot, with effects.
        T: poses of the robot's own tool in the calibrated base.
        seed: joint positions to start from, radians; the nominal robot's are near enough.
        conditions: how the poses are reached, for effects that depend on it; as in the middle by default.
    """
    x = calibration.estimate
    solution = solve_near(calibration.model, T, seed, x)
    if conditions is None:
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


@short_repr
@dataclass(frozen=True, eq=False, kw_only=True)
class ToolPoses:
    """Poses of the tool in the robot's base, and how they differ."""

    nominal: Float[np.ndarray, "n 4 4"]
    calibrated: Float[np.ndarray, "n 4 4"]
    uncertainty: Float[np.ndarray, " n"]
    """Standard deviation of the calibrated TCP in space, its model error included, metres."""

    @property
    def moved(self) -> Float[np.ndarray, "n 3"]:
        """Calibrated less nominal position, metres, in base axes."""
        return self.calibrated[:, :3, 3] - self.nominal[:, :3, 3]

    @property
    def turned(self) -> Float[np.ndarray, " n"]:
        """Angle between the two orientations, radians."""
        R = self.calibrated[:, :3, :3] @ np.swapaxes(self.nominal[:, :3, :3], 1, 2)
        return np.linalg.norm(se3.log(R), axis=1)


@short_repr
@dataclass(frozen=True, eq=False, kw_only=True)
class ToolJoints:
    """Joint positions for tool poses."""

    nominal: Float[np.ndarray, "n joints"]
    """Of the nominal robot, radians or metres; NaN where it does not reach the pose."""
    calibrated: Float[np.ndarray, "n joints"] | None
    """Of the calibrated one, on the same branch; None where there is no calibration."""

    @property
    def reached(self) -> Bool[np.ndarray, " n"]:
        """Whether each pose is reached, inside all limits."""
        q = self.nominal if self.calibrated is None else self.calibrated
        return np.asarray(np.isfinite(np.concatenate([self.nominal, q], axis=1)).all(axis=1))


@joints_checked
def locate_tool(calibration: Calibration, q: Float[np.ndarray, "n joints"]) -> ToolPoses:
    """Tool poses by the nominal robot, and by the calibrated one in its calibrated base.

    Args:
        calibration: the robot.
        q: joint positions, radians or metres.

    Raises:
        ReachError: joint positions that can only be degrees.
        ClosureError: a closed loop cannot be assembled at some pose.
    """
    return ToolPoses(
        nominal=ErrorModel(calibration.model.robot).poses(q),
        calibrated=calibration.tool_in_base(q),
        uncertainty=np.sqrt(np.trace(calibration.tool_covariance(q)[:, :3, :3], axis1=1, axis2=2)),
    )


@joints_checked
def find_joints(
    source: ErrorModel | Calibration, T: Float[np.ndarray, "n 4 4"], seed: Float[np.ndarray, "n joints"] | None = None
) -> ToolJoints:
    """Joint positions that bring the tool to poses in the robot's base.

    Without seeds each pose is reached on the branch of the one before it where that can be, else in the posture that lies
    deepest inside the limits.

    Args:
        source: a model, of which the nominal robot counts, or a calibration.
        T: tool poses.
        seed: joint positions near those looked for, radians or metres.
    """
    calibrated = isinstance(source, Calibration)
    model = ErrorModel(source.model.robot if calibrated else source.robot)
    q = np.full((len(T), len(model.robot.joints)), np.nan)
    last: np.ndarray | None = None
    for i in range(len(T)):
        near = seed[i] if seed is not None else last
        q[i] = _posture(model, T[i], near, REAL_ROBOT if calibrated else ROUNDED_POSE, free=seed is None)
        last = q[i] if np.isfinite(q[i]).all() else last
    if not calibrated:
        return ToolJoints(nominal=q, calibrated=None)
    found = np.isfinite(q).all(axis=1)
    own = np.full_like(q, np.nan)
    if found.any():
        solved = solve_calibrated(source, T[found], q[found])
        own[found] = np.where(solved.reached[:, None], solved.q, np.nan)
    return ToolJoints(nominal=q, calibrated=own)


def _posture(
    model: ErrorModel, T: Float[np.ndarray, "4 4"], near: Float[np.ndarray, " joints"] | None, miss: Miss, *, free: bool
) -> Float[np.ndarray, " joints"]:
    """A posture near another, or, where `free`, any; NaN where there is none."""
    if near is not None:
        solution = solve_near(model, T[None], near[None], miss=miss)
        if solution.reached[0]:
            return solution.q[0]
        if not free:
            return np.full(len(near), np.nan)
    try:
        postures = find_postures(model, T, miss=miss)
    except ReachError:
        return np.full(len(model.robot.joints), np.nan)
    if near is None:
        return postures[0]
    distance = np.abs(postures - near).max(axis=1)
    return postures[int(np.argmin(np.maximum(distance, SAME_POSTURE_RAD)))]
