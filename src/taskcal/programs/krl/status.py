"""Status and turn, by which KRL tells apart the axis positions that reach one pose.

KUKA System Software, Operating and Programming Instructions for System Integrators, section "Status and Turn":

- T, bit i − 1: axis i stands below 0°.
- S, bit 0: the centre of the wrist lies behind axis 1, that is at negative x of a frame that turns with axis 1 (overhead area).
- S, bit 1: axis 3 stands at or beyond the angle at which the wrist's centre, axis 3 and axis 2 are in line; that angle is zero
  where axis 4 meets axis 3, and follows from their offset otherwise.
- S, bit 2: axis 5 lies in −180° … 0° or beyond 180°.
- S, bit 4: the point was taught by a robot whose controller corrects its own geometry.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from jaxtyping import Bool, Float

from taskcal.geometry import walk
from taskcal.geometry.chain import Chain, Fixed, Joint, Step
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot import Robot

JOINTS = 6
ACCURATE_BIT = 0b10000
"""Of S, where the controller's own correction was on."""

BORDER = 1e-6
"""Nearer to the border between two values of a bit than this, radians or metres, either value is right."""


@dataclass(frozen=True, kw_only=True)
class Status:
    """S and T of a position; either may be missing."""

    S: int | None
    T: int | None

    def agrees(self, robot: Robot, q: Float[np.ndarray, "n joints"]) -> Bool[np.ndarray, " n"]:
        """Whether each posture has this status and turn.

        S does not count on a robot without a wrist of three axes through one point, where it cannot be told.

        Args:
            robot: the robot.
            q: joint positions, radians.
        """
        return self.miss(robot, q) < BORDER

    @property
    def tolerated(self) -> float:
        """How far off the controller still takes the nearest posture, radians: not at all."""
        return 0.0

    def miss(self, robot: Robot, q: Float[np.ndarray, "n joints"]) -> Float[np.ndarray, " n"]:
        """How far each posture is from the one meant, radians: the angle of joints to the sign that T states.

        On the wrong side of what S tells it is half a turn and more.
        """
        away = np.zeros(len(q))
        if self.T is not None:
            away = _bits_miss(self.T, -q[:, :JOINTS]).max(axis=1)
        beyond = _beyond(robot, q)
        if self.S is not None and beyond is not None:
            wrong = _bits_miss(self.S, beyond)
            away = np.maximum(away, np.where(wrong < BORDER, wrong, np.pi + wrong).max(axis=1))
        return away

    def of(self, robot: Robot, q: Float[np.ndarray, " joints"]) -> "Status":
        """Status and turn of a posture.

        What the posture does not decide stays as it is here: what is missing, bits of other meaning, bits on the border, and S
        on a robot without a wrist of three axes through one point.

        Args:
            robot: the robot.
            q: joint positions, radians.
        """
        beyond = _beyond(robot, q[None])
        S = self.S if self.S is None or beyond is None else _with_bits(self.S, beyond[0])
        T = None if self.T is None else _with_bits(self.T, -q[:JOINTS])
        return Status(S=S, T=T)


def _bits_miss(value: int, positive: Float[np.ndarray, "n bits"]) -> Float[np.ndarray, "n bits"]:
    """How far each amount is on the wrong side, zero on the right one."""
    stated = (value >> np.arange(positive.shape[1])) & 1 == 1
    return np.maximum(np.where(stated, -positive, positive), 0.0)


def _with_bits(value: int, positive: Float[np.ndarray, " bits"]) -> int:
    for bit, amount in enumerate(positive):
        if abs(amount) >= BORDER:
            value = value | 1 << bit if amount > 0 else value & ~(1 << bit)
    return value


def _beyond(robot: Robot, q: Float[np.ndarray, "n joints"]) -> Float[np.ndarray, "n 3"] | None:
    """What is positive where bits 0, 1 and 2 of S are set; None for a robot without such a wrist."""
    geometry = _geometry(robot)
    if geometry is None:
        return None
    ahead = q.copy()
    ahead[:, 0] = 0.0  # seen from a frame that turns with axis 1
    overhead = -geometry.wrist(ahead)[:, 0]
    second, third = geometry.frames(q, 1), geometry.frames(q, 2)
    arm, forearm = third[:, :3, 3] - second[:, :3, 3], geometry.wrist(q) - third[:, :3, 3]
    elbow = np.einsum("ni,ni->n", third[:, :3, 2], np.cross(arm, forearm)) * geometry.elbow_sign
    return np.stack([overhead, elbow, -np.sin(q[:, 4])], axis=1)


@dataclass(frozen=True, eq=False, kw_only=True)
class _Geometry:
    model: ErrorModel
    chains: tuple[Chain, ...]
    """From the base to behind each joint."""
    centre: Float[np.ndarray, " 3"]
    """Of the wrist, in the frame behind joint 4."""
    elbow_sign: float
    """Whether axis 3 counts about its z axis or against it."""

    def frames(self, q: Float[np.ndarray, "n joints"], joint: int) -> Float[np.ndarray, "n 4 4"]:
        """Frames behind a joint, counted from 0, in the base."""
        s = self.model.walk(q).s
        return walk.poses(self.chains[joint], np.ascontiguousarray(s[:, : joint + 1]), np.zeros((0, 6)))

    def wrist(self, q: Float[np.ndarray, "n joints"]) -> Float[np.ndarray, "n 3"]:
        """Centres of the wrist in the base."""
        T = self.frames(q, 3)
        return T[:, :3, :3] @ self.centre + T[:, :3, 3]


@lru_cache(maxsize=8)
def _geometry(robot: Robot) -> _Geometry | None:
    """The arm's geometry; None unless axes 2 and 3 are parallel and axes 4, 5 and 6 meet in one point."""
    if len(robot.joints) != JOINTS or any(robot.prismatic):
        return None
    steps: list[Step] = []
    chains: list[Chain] = []
    for joint in robot.joints:
        steps += [Fixed(part.transform) for part in joint.before]
        steps.append(Joint("revolute"))
        chains.append(Chain.of(steps))
        steps += [Fixed(part.transform) for part in joint.after]
    model = ErrorModel(robot)
    geometry = _Geometry(
        model=model,
        chains=tuple(chains),
        centre=np.zeros(3),
        elbow_sign=float(np.sign(robot.joint_map.matrix[2, 2])),
    )
    home = np.mean(np.clip(robot.limits, -np.pi, np.pi), axis=1)[None]
    T = np.stack([geometry.frames(home, joint)[0] for joint in range(JOINTS)])
    centre, distance = _meeting_point(T[3:, :3, 3], T[3:, :3, 2])
    if distance > BORDER or np.linalg.norm(np.cross(T[1, :3, 2], T[2, :3, 2])) > BORDER:
        return None
    return _Geometry(
        model=model,
        chains=geometry.chains,
        centre=T[3, :3, :3].T @ (centre - T[3, :3, 3]),
        elbow_sign=geometry.elbow_sign,
    )


def _meeting_point(
    points: Float[np.ndarray, "lines 3"], directions: Float[np.ndarray, "lines 3"]
) -> tuple[Float[np.ndarray, " 3"], float]:
    """The point nearest to some lines, and the largest of its distances from them."""
    across = np.eye(3) - directions[:, :, None] * directions[:, None, :]
    centre = np.linalg.lstsq(across.sum(axis=0), np.einsum("nij,nj->i", across, points), rcond=None)[0]
    away = np.einsum("nij,nj->ni", across, centre - points)
    return centre, float(np.linalg.norm(away, axis=1).max())
