"""Configuration data of a RAPID target: quadrants of axes 1, 4 and 6, and which of the eight postures is meant.

Sources: RAPID reference manual 3HAC050917, data type confdata; the eight values of cfx also in AXIS_CONFIGURATION.md of
CEAD-group/py-opw-kinematics. That robots which cannot bend over backwards, those with a parallel rod, have no use for cfx:
RobotStudio SDK, Mechanism.UsesCfx and Mechanism.GetAllConfigurationsAsync.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from taskcal.programs.arm_bends import arm_bends
from taskcal.robot.robot import Robot

QUADRANT_JOINTS = (0, 3, 5)

EDGE = np.radians(1e-6)
"""This near to the edge of a quadrant either of its neighbours is right, radians."""

TOLERATED = np.radians(45.0)
"""How far axes 1, 4 and 6 may be from their quadrants without the controller stopping, radians."""

SLACK = np.radians(1.0)
"""Postures of one target differ by far more; its programmed numbers are rounded, so that its joints are not exact, radians."""


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

    @property
    def tolerated(self) -> float:
        """How far off the controller still takes the nearest posture, radians."""
        return TOLERATED

    def agrees(self, robot: Robot, q: Float[np.ndarray, "n joints"]) -> Bool[np.ndarray, " n"]:
        """Whether each posture is the one meant; any is, of a robot without six turning joints."""
        return self.miss(robot, q) <= SLACK

    def miss(self, robot: Robot, q: Float[np.ndarray, "n joints"]) -> Float[np.ndarray, " n"]:
        """How far each posture is from the one meant, radians: of axes 1, 4 and 6 the angle to their quadrants.

        On the wrong side of what cfx tells it is half a turn and more.
        """
        if not _has_configuration(robot):
            return np.zeros(len(q))
        edge = np.array([self.cf1, self.cf4, self.cf6]) * (np.pi / 2)
        turned = q[:, QUADRANT_JOINTS]
        away = np.maximum(np.maximum(edge - turned, turned - (edge + np.pi / 2)), 0.0).max(axis=1)
        sides = _sides(robot, q)
        if sides is not None and 0 <= self.cfx <= 7:
            behind = np.array([bool(self.cfx & 4), bool(self.cfx & 2), bool(self.cfx & 1)])
            wrong = np.where(behind, sides, -sides).max(axis=1)
            away = np.maximum(away, np.where(wrong < SLACK, np.maximum(wrong, 0.0), np.pi + wrong))
        return away

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


def _sides(robot: Robot, q: Float[np.ndarray, "n 6"]) -> Float[np.ndarray, "n 3"] | None:
    """Angles by which the wrist centre is in front of axis 1 and of the lower arm, and the angle of axis 5, radians.

    None for a robot without a use for cfx: one with a parallel rod, or without the usual arm and wrist.
    """
    bends = arm_bends(robot, q)
    return None if bends is None else np.column_stack([bends, q[:, 4]])
