"""How an arm with a spherical wrist is bent: what controllers tell the postures of one pose apart by."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from jaxtyping import Float

from robot_programs.core import se3
from robot_programs.core.robot import Robot

JOINTS = 6

SPHERICAL = 1e-6
"""The last three axes meet within this, metres."""


def arm_bends(robot: Robot, q: Float[np.ndarray, "n joints"]) -> Float[np.ndarray, "n 2"] | None:
    """Angles by which the wrist centre is in front of axis 1, and in front of the lower arm, radians.

    None for a robot with a parallel rod, or without six turning joints, the usual arm and a wrist whose axes meet.
    """
    arm = _arm(robot)
    if arm is None:
        return None
    frames = robot.joint_frames(q)
    axis_1 = frames[:, 0, :3, 2]
    forward = frames[:, 0, :3, :3] @ arm.forward
    across = np.cross(axis_1, forward)
    centre = se3.apply(frames[:, 3], arm.wrist)
    elbow = frames[:, 2, :3, 3]
    lower, beyond = (v - _dot(v, across)[:, None] * across for v in (elbow - frames[:, 1, :3, 3], centre - elbow))
    from_axis = centre - frames[:, 0, :3, 3]
    before_axis = np.arctan2(_dot(from_axis, forward), np.abs(_dot(from_axis, axis_1)))
    before_arm = np.arctan2(_dot(np.cross(lower, beyond), across), _dot(lower, beyond))
    return np.stack([before_axis, before_arm], axis=1)


@dataclass(frozen=True, eq=False, kw_only=True)
class _Arm:
    """A robot with the usual arm and a spherical wrist."""

    forward: Float[np.ndarray, " 3"]
    """The base's x in the first joint's frame, where all joints are at zero: with axis 1 it turns."""
    wrist: Float[np.ndarray, " 3"]
    """Where the last three axes meet, in the fourth joint's frame, metres."""


def _dot(a: Float[np.ndarray, "n 3"], b: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, " n"]:
    return (a * b).sum(axis=1)


@lru_cache(maxsize=16)
def _arm(robot: Robot) -> _Arm | None:
    if len(robot.joint_names) != JOINTS or any(robot.prismatic) or robot.has_linkage:
        return None
    zero = robot.joint_frames(np.zeros((1, JOINTS)))[0]
    z = zero[:, :3, 2]
    wrist = _meeting_point(zero[3:])
    if wrist is None or abs(z[1] @ z[2]) < 1.0 - 1e-9 or abs(z[0] @ z[1]) > 1e-9:
        return None
    return _Arm(forward=zero[0, 0, :3], wrist=se3.apply(se3.inverse(zero[3]), wrist))


def _meeting_point(frames: Float[np.ndarray, "axes 4 4"]) -> Float[np.ndarray, " 3"] | None:
    """Where the z axes of some frames meet; None where they do not."""
    across = np.eye(3) - frames[:, :3, 2, None] * frames[:, None, :3, 2]
    offsets = (across @ frames[:, :3, 3, None])[:, :, 0]
    point = np.linalg.lstsq(across.sum(axis=0), offsets.sum(axis=0), rcond=1e-9)[0]
    distance = np.linalg.norm((across @ point) - offsets, axis=1)
    return point if distance.max() < SPHERICAL else None
