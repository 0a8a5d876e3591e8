"""Which motions are not corrected, and why."""

import numpy as np
from jaxtyping import Float

from taskcal.correction.correction import Bounds
from taskcal.correction.subdivision import Subdivision
from taskcal.correction.target_changes import TargetChanges
from taskcal.kinematics.inverse import closes, conditioning
from taskcal.kinematics.tracing import NEARLY_SINGULAR
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot import Robot

SWINGING_RATIO = 0.1
"""Ratio of the Jacobian's singular values under which a large motion of the joints is put down to a singular posture."""


def find_rejections(
    robot: Robot,
    subdivision: Subdivision,
    changes: TargetChanges,
    bounds: Bounds,
) -> dict[int, str]:
    """Motions that are not corrected, and why."""
    nodes = subdivision.nodes
    reasons: dict[int, str] = {}
    for k in np.flatnonzero(~nodes.reached):
        if changes.shift[nodes.move[k]] <= bounds.shift:
            reasons.setdefault(int(nodes.move[k]), _why_unreached(robot, nodes.q[k]))
    for i in np.flatnonzero(subdivision.pieces):
        if i in reasons:
            continue
        if changes.shift[i] > bounds.shift:
            reasons[int(i)] = (
                f"would move by {changes.shift[i] * 1e3:.2f} mm, and {bounds.shift * 1e3:g} mm are allowed; look at where "
                "the cell file has its tool and part, or widen the bound (--max-shift-mm) if that is right"
            )
        elif changes.turn[i] > bounds.turn:
            reasons[int(i)] = (
                f"would turn by {np.degrees(changes.turn[i]):.2f}°, and {np.degrees(bounds.turn):g}° are allowed; widen the bound "
                "(--max-turn-deg) if that is right"
            )
        elif changes.joint[i] > bounds.joint:
            reasons[int(i)] = (
                f"would move a joint by {np.degrees(changes.joint[i]):.1f}°, and {np.degrees(bounds.joint):g}° are allowed "
                f"(--max-joint-deg){_why_joints_swing(robot, nodes.q[nodes.move == i][-1])}"
            )
        elif not np.isfinite(subdivision.deviation[i]):
            reasons[int(i)] = (
                "the nominal robot cannot follow the corrected path; it passes too near to a singular posture"
            )
    return reasons


def _why_joints_swing(robot: Robot, q: Float[np.ndarray, " joints"]) -> str:
    """What to add where a joint moves far for a small correction."""
    if conditioning(ErrorModel(robot), q[None])[0] > SWINGING_RATIO:
        return ""
    return "; near a singular posture a small correction swings the joints"


def _why_unreached(robot: Robot, q: Float[np.ndarray, " joints"]) -> str:
    """Why the calibrated robot does not reach a node, by the joint positions nearest to it that were found."""
    outside = robot.outside_limits(q[None])
    if outside:
        return f"the calibrated robot reaches it outside its limits only: {outside[0][1]}"
    model = ErrorModel(robot)
    if not closes(model, q[None])[0] or conditioning(model, q[None])[0] > NEARLY_SINGULAR:
        return "is out of the calibrated robot's reach in this posture"
    return "lies at a singular posture, where the calibrated robot does not reach it"
