"""What a reader of programs asks of the robot that it is given, and how an arm with a spherical wrist is bent."""

from dataclasses import dataclass, field
from functools import lru_cache
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float

from taskcal_groundwork import se3

# What a reader of programs asks of the robot that it is given; any object that has it will do.


@runtime_checkable
class Robot(Protocol):
    """A serial robot as it was designed; joint positions are the controller's, in radians or metres."""

    @property
    def name(self) -> str:
        """For messages."""
        ...

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of its joints, in order from the base."""
        ...

    @property
    def prismatic(self) -> tuple[bool, ...]:
        """Which joints slide."""
        ...

    @property
    def limits(self) -> Float[np.ndarray, "joints 2"]:
        """Lower and upper limit of every joint."""
        ...

    @property
    def has_linkage(self) -> bool:
        """Whether a linkage moves joints with others, such as a parallel rod that drives the forearm."""
        ...

    @property
    def T_flange_tool(self) -> Float[np.ndarray, "4 4"]:
        """Pose of its own tool in the flange in which the controller counts tools, metres."""
        ...

    def joint_frames(self, q: Float[np.ndarray, "n joints"]) -> Float[np.ndarray, "n joints 4 4"]:
        """Frames in the base that each joint turns about their z axes, or moves along them; behind the joint, metres."""
        ...

    def tool_poses(self, q: Float[np.ndarray, "n joints"]) -> Float[np.ndarray, "n 4 4"]:
        """Poses of its own tool in the base, metres."""
        ...


@dataclass(frozen=True, eq=False, kw_only=True)
class _NoRobot:
    """Six axes that slide: by none of them does a controller tell postures apart, so that they stay as they are written."""

    name: str = "no robot"
    joint_names: tuple[str, ...] = ("J1", "J2", "J3", "J4", "J5", "J6")
    prismatic: tuple[bool, ...] = (True,) * 6
    limits: Float[np.ndarray, "joints 2"] = field(default_factory=lambda: np.tile([-np.inf, np.inf], (6, 1)))
    has_linkage: bool = False
    T_flange_tool: Float[np.ndarray, "4 4"] = field(default_factory=lambda: np.eye(4))

    def joint_frames(self, q: Float[np.ndarray, "n joints"]) -> Float[np.ndarray, "n joints 4 4"]:
        return np.full((len(q), JOINTS, 4, 4), np.nan)

    def tool_poses(self, q: Float[np.ndarray, "n joints"]) -> Float[np.ndarray, "n 4 4"]:
        return np.full((len(q), 4, 4), np.nan)


NO_ROBOT: Robot = _NoRobot()
"""In place of a robot that is not given."""


# How an arm with a spherical wrist is bent: what controllers tell the postures of one pose apart by.


JOINTS = 6

WRIST_TOLERANCE_M = 1e-6
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
    wrist, distance = meeting_point(zero[3:])
    if distance >= WRIST_TOLERANCE_M or abs(z[1] @ z[2]) < 1.0 - 1e-9 or abs(z[0] @ z[1]) > 1e-9:
        return None
    return _Arm(forward=zero[0, 0, :3], wrist=se3.apply(se3.inverse(zero[3]), wrist))


def meeting_point(frames: Float[np.ndarray, "axes 4 4"]) -> tuple[Float[np.ndarray, " 3"], float]:
    """The point nearest to the z axes of some frames, and the largest of its distances from them, metres."""
    across = np.eye(3) - frames[:, :3, 2, None] * frames[:, None, :3, 2]
    offsets = (across @ frames[:, :3, 3, None])[:, :, 0]
    point = np.linalg.lstsq(across.sum(axis=0), offsets.sum(axis=0), rcond=1e-9)[0]
    return point, float(np.linalg.norm((across @ point) - offsets, axis=1).max())
