"""Which motions are not corrected, and why."""

import numpy as np
from jaxtyping import Float

from taskcal.correction.chords import Chords
from taskcal.correction.correction import Bounds
from taskcal.correction.motion import SINGULAR
from taskcal.kinematics.inverse import closes, conditioning
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot import Robot

SWINGING = 0.1
"""Ratio of the Jacobian's singular values under which a large motion of the joints is put down to a singular posture."""


def refuse(
    robot: Robot,
    chords: Chords,
    shift: Float[np.ndarray, " m"],
    turn: Float[np.ndarray, " m"],
    joint_change: Float[np.ndarray, " m"],
    bounds: Bounds,
) -> dict[int, str]:
    """Motions that are not corrected, and why."""
    nodes = chords.nodes
    out: dict[int, str] = {}
    for k in np.flatnonzero(~nodes.reached):
        if shift[nodes.move[k]] <= bounds.shift:
            out.setdefault(int(nodes.move[k]), _why_lost(robot, nodes.q[k]))
    for i in np.flatnonzero(chords.pieces):
        if i in out:
            continue
        if shift[i] > bounds.shift:
            out[int(i)] = (
                f"would move by {shift[i] * 1e3:.2f} mm, and {bounds.shift * 1e3:g} mm are allowed; look at where the cell file "
                "has its tool and part, or widen the bound (--max-shift-mm) if that is right"
            )
        elif turn[i] > bounds.turn:
            out[int(i)] = (
                f"would turn by {np.degrees(turn[i]):.2f}°, and {np.degrees(bounds.turn):g}° are allowed; widen the bound "
                "(--max-turn-deg) if that is right"
            )
        elif joint_change[i] > bounds.joint:
            out[int(i)] = (
                f"would move a joint by {np.degrees(joint_change[i]):.1f}°, and {np.degrees(bounds.joint):g}° are allowed "
                f"(--max-joint-deg){_why_swung(robot, nodes.q[nodes.move == i][-1])}"
            )
        elif not np.isfinite(chords.deviation[i]):
            out[int(i)] = "the nominal robot cannot follow the corrected way; it passes too near to a singular posture"
    return out


def _why_swung(robot: Robot, q: Float[np.ndarray, " joints"]) -> str:
    """What to add where a joint moves far for a small correction."""
    if conditioning(ErrorModel(robot), q[None])[0] > SWINGING:
        return ""
    return "; near a singular posture a small correction swings the joints"


def _why_lost(robot: Robot, q: Float[np.ndarray, " joints"]) -> str:
    """Why the calibrated robot does not reach a node, by the joint positions nearest to it that were found."""
    outside = robot.outside_limits(q[None])
    if outside:
        return f"the calibrated robot reaches it outside its limits only: {outside[0][1]}"
    model = ErrorModel(robot)
    if not closes(model, q[None])[0] or conditioning(model, q[None])[0] > SINGULAR:
        return "is out of the calibrated robot's reach in this posture"
    return "lies at a singular posture, where the calibrated robot does not reach it"
