"""Configuration data of a RAPID target: quadrants of axes 1, 4 and 6, and which of the eight postures is meant.

Sources: RAPID reference manual 3HAC050917, data type confdata; the eight values of cfx also in AXIS_CONFIGURATION.md of
CEAD-group/py-opw-kinematics. That robots which cannot bend over backwards, those with a parallel rod, have no use for cfx:
RobotStudio SDK, Mechanism.UsesCfx and Mechanism.GetAllConfigurationsAsync.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from jaxtyping import Bool, Float, Int

from taskcal.geometry import se3
from taskcal.robot.robot import Robot

QUADRANT_JOINTS = (0, 3, 5)

EDGE = np.radians(1e-6)
"""This near to the edge of a quadrant either of its neighbours is right, radians."""

SLACK = np.radians(1.0)
"""Postures of one target differ by far more; its programmed numbers are rounded, so that its joints are not exact, radians."""

SPHERICAL = 1e-6
"""The last three axes meet within this, metres."""


@dataclass(frozen=True, kw_only=True)
class Configuration:
    """The confdata of a target."""

    cf1: int
    """Quadrant of axis 1: 0 from 0° to 90°, −1 from −90° to 0°, …"""
    cf4: int
    cf6: int
    cfx: int
    """4·(wrist centre behind axis 1) + 2·(wrist centre behind the lower arm) + (axis 5 negative)."""

    def __str__(self) -> str:
        return f"[{self.cf1},{self.cf4},{self.cf6},{self.cfx}]"

    def agrees(self, robot: Robot, q: Float[np.ndarray, "n joints"]) -> Bool[np.ndarray, " n"]:
        """Whether each posture is the one meant; any is, of a robot without six turning joints."""
        if not _has_configuration(robot):
            return np.ones(len(q), dtype=bool)
        stated = np.array([self.cf1, self.cf4, self.cf6])
        turned = q[:, QUADRANT_JOINTS]
        right = ((_quadrant(turned - SLACK) <= stated) & (stated <= _quadrant(turned + SLACK))).all(axis=1)
        sides = _sides(robot, q)
        if sides is not None and 0 <= self.cfx <= 7:
            behind = np.array([bool(self.cfx & 4), bool(self.cfx & 2), bool(self.cfx & 1)])
            right &= np.where(behind, sides < SLACK, sides > -SLACK).all(axis=1)
        return np.asarray(right)

    @classmethod
    def of(cls, robot: Robot, q: Float[np.ndarray, " joints"], like: "Configuration | None" = None) -> "Configuration":
        """The configuration of a posture.

        Args:
            robot: a robot with six joints.
            q: joint positions, radians.
            like: what is kept where the posture is on an edge, or the robot has no use for a value.
        """
        if not _has_configuration(robot):
            return like or cls(cf1=0, cf4=0, cf6=0, cfx=0)
        turned = q[list(QUADRANT_JOINTS)]
        low, high = _quadrant(turned - EDGE), _quadrant(turned + EDGE)
        if like is None:
            quadrants = high
        else:
            stated = np.array([like.cf1, like.cf4, like.cf6])
            quadrants = np.where((low <= stated) & (stated <= high), stated, high)
        sides = _sides(robot, q[None])
        if sides is None:
            cfx = like.cfx if like else 0
        else:
            old_bits = (like.cfx & 4, like.cfx & 2, like.cfx & 1) if like else (0, 0, 0)
            bits = zip(sides[0], (4, 2, 1), old_bits, strict=True)
            cfx = sum(old if abs(side) < EDGE else bit * (side < 0.0) for side, bit, old in bits)
        return cls(cf1=int(quadrants[0]), cf4=int(quadrants[1]), cf6=int(quadrants[2]), cfx=int(cfx))


def _quadrant(angle: Float[np.ndarray, "*n"]) -> Int[np.ndarray, "*n"]:
    return np.floor(angle / (np.pi / 2)).astype(np.int64)


def _has_configuration(robot: Robot) -> bool:
    return len(robot.joints) == 6 and not any(robot.prismatic)


@dataclass(frozen=True, eq=False, kw_only=True)
class _Arm:
    """What cfx is told by, of a robot with the usual arm and a spherical wrist."""

    fixed: Float[np.ndarray, "6 4 4"]
    """From each joint's frame, turned, to the next one's at zero."""
    forward: Float[np.ndarray, " 3"]
    """The base's x in the first joint's frame, where all joints are at zero: with axis 1 it turns."""
    wrist: Float[np.ndarray, " 3"]
    """Where the last three axes meet, in the fourth joint's frame, metres."""


def _sides(robot: Robot, q: Float[np.ndarray, "n 6"]) -> Float[np.ndarray, "n 3"] | None:
    """Angles by which the wrist centre is in front of axis 1 and of the lower arm, and the angle of axis 5, radians.

    None for a robot without a use for cfx: one with a parallel rod, or without the usual arm and wrist.
    """
    arm = _arm(robot)
    if arm is None:
        return None
    frames = _joint_frames(arm.fixed[:4], robot.joint_map(q))
    axis_1 = frames[:, 0, :3, 2]
    forward = frames[:, 0, :3, :3] @ arm.forward
    across = np.cross(axis_1, forward)
    centre = se3.apply(frames[:, 3], arm.wrist)
    elbow = frames[:, 2, :3, 3]
    lower, beyond = (v - _dot(v, across)[:, None] * across for v in (elbow - frames[:, 1, :3, 3], centre - elbow))
    from_axis = centre - frames[:, 0, :3, 3]
    before_axis = np.arctan2(_dot(from_axis, forward), np.abs(_dot(from_axis, axis_1)))
    before_arm = np.arctan2(_dot(np.cross(lower, beyond), across), _dot(lower, beyond))
    return np.stack([before_axis, before_arm, q[:, 4]], axis=1)


def _dot(a: Float[np.ndarray, "n 3"], b: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, " n"]:
    return (a * b).sum(axis=1)


@lru_cache(maxsize=16)
def _arm(robot: Robot) -> _Arm | None:
    if robot.four_bar is not None or robot.driven:
        return None
    fixed: list[np.ndarray] = []
    behind = np.eye(4)
    for joint in robot.joints:
        for part in joint.before:
            behind = behind @ part.transform
        fixed.append(behind)
        behind = np.eye(4)
        for part in joint.after:
            behind = behind @ part.transform
    zero = _joint_frames(np.array(fixed), robot.joint_map(np.zeros((1, 6))))[0]
    z = zero[:, :3, 2]
    wrist = _meeting_point(zero[3:])
    if wrist is None or abs(z[1] @ z[2]) < 1.0 - 1e-9 or abs(z[0] @ z[1]) > 1e-9:
        return None
    return _Arm(fixed=np.array(fixed), forward=zero[0, 0, :3], wrist=se3.apply(se3.inverse(zero[3]), wrist))


def _joint_frames(
    fixed: Float[np.ndarray, "joints 4 4"], s: Float[np.ndarray, "n coordinates"]
) -> Float[np.ndarray, "n joints 4 4"]:
    """Frames of the joints in the base, each turned about its z by its coordinate."""
    T = np.broadcast_to(np.eye(4), (len(s), 4, 4))
    frames: list[np.ndarray] = []
    for k in range(len(fixed)):
        turn = np.zeros((len(s), 3, 3))
        c, si = np.cos(s[:, k]), np.sin(s[:, k])
        turn[:, 0, 0], turn[:, 0, 1], turn[:, 1, 0], turn[:, 1, 1], turn[:, 2, 2] = c, -si, si, c, 1.0
        T = T @ fixed[k] @ se3.pose(turn, np.zeros((len(s), 3)))
        frames.append(T)
    return np.stack(frames, axis=1)


def _meeting_point(frames: Float[np.ndarray, "axes 4 4"]) -> Float[np.ndarray, " 3"] | None:
    """Where the z axes of some frames meet; None where they do not."""
    across = np.eye(3) - frames[:, :3, 2, None] * frames[:, None, :3, 2]
    offsets = (across @ frames[:, :3, 3, None])[:, :, 0]
    point = np.linalg.lstsq(across.sum(axis=0), offsets.sum(axis=0), rcond=1e-9)[0]
    distance = np.linalg.norm((across @ point) - offsets, axis=1)
    return point if distance.max() < SPHERICAL else None
