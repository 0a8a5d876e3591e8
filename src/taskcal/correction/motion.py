"""How a program moves the joints: speed and acceleration against their limits, and the distance to singular postures."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from robot_programs.core.program import Move
from taskcal.correction.controller import ControllerTrajectory
from taskcal.correction.path import RoundedPath
from taskcal.kinematics.inverse import conditioning
from taskcal.robot.approach import MAX_REST_MOTION, drive_motion
from taskcal.robot.conditions import Conditions
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot import Robot
from taskcal.short_repr import short_repr

MIN_STEP_S = 1e-9
"""Samples nearer together in time than this are one, seconds."""

TURN_SPEED = float(np.radians(500.0))
"""Reorientation speed where a program states none, radians per second: that of all of ABB's predefined speeddata
(Technical reference manual, RAPID, data type speeddata)."""


@short_repr
@dataclass(frozen=True, eq=False, kw_only=True)
class JointMotion:
    """Largest joint speeds and accelerations along lines and arcs of known speed, and the posture nearest to singular.

    Finite differences over the samples of the path. Accelerations in corners are left out: there the controller slows down as
    its drives need it.
    """

    robot: Robot
    speed: Float[np.ndarray, " joints"]
    """Radians or metres per second; NaN where no speed is known."""
    acceleration: Float[np.ndarray, " joints"]
    """Radians or metres per second squared."""
    conditioning: float
    """Smallest ratio of the smallest to the largest singular value of the Jacobian, a metre counting as two radians."""
    nearest_singular: int | None
    """Motion where that is."""
    turn_speed_assumed: int | None = None
    """First motion that states no reorientation speed and turns faster than `TURN_SPEED` at its path speed."""

    def summary(self) -> dict[str, Any]:
        """In degrees and millimetres, with shares of the limits where the robot file states them."""
        scale = np.where(self.robot.prismatic, 1e3, 180.0 / np.pi)
        return {
            "joint_speed": _against(self.robot, self.speed, self.robot.speed_limits, scale),
            "joint_acceleration": _against(self.robot, self.acceleration, self.robot.acceleration_limits, scale),
            "smallest_singular_ratio": self.conditioning if np.isfinite(self.conditioning) else None,
        }


def _against(
    robot: Robot, value: Float[np.ndarray, " joints"], limit: Float[np.ndarray, " joints"], scale: np.ndarray
) -> dict[str, Any]:
    return {
        name: {
            "largest": float(value[j] * scale[j]),
            "limit": float(limit[j] * scale[j]) if np.isfinite(limit[j]) else None,
        }
        for j, name in enumerate(robot.joint_names)
        if np.isfinite(value[j])
    }


def joint_motion(robot: Robot, moves: Sequence[Move], trajectory: ControllerTrajectory) -> JointMotion:
    """How the joints move along a program's lines and arcs.

    Args:
        robot: the robot.
        moves: the motions of the program.
        trajectory: where a controller moves the joints in them.
    """
    joints = len(robot.joints)
    speed, acceleration = np.full(joints, np.nan), np.full(joints, np.nan)
    assumed: int | None = None
    i = trajectory.move
    if len(i):
        starts = np.flatnonzero(np.diff(i, prepend=-1))
        before = np.concatenate([[0.0], trajectory.share[:-1]])
        before[starts] = 0.0
        q0 = np.concatenate([trajectory.q[:1], trajectory.q[:-1]])
        corners = trajectory.corners
        joined = corners.before[i[starts]]
        q0[starts] = np.where((joined >= 0)[:, None], trajectory.passes[joined], trajectory.start[i[starts]])
        time, assumed = _durations(moves, trajectory, trajectory.share - before)
        with np.errstate(invalid="ignore", divide="ignore"):
            rate = (trajectory.q - q0) / time[:, None]
            change = np.diff(rate, axis=0) / (0.5 * (time[1:] + time[:-1]))[:, None]
            turning = RoundedPath(segments=trajectory.segments, corners=corners).inside(i, trajectory.share)
            change[(np.diff(i) != 0) | turning[1:] | turning[:-1]] = np.nan
        speed, acceleration = _largest(rate, speed), _largest(change, acceleration)
    ends = np.isfinite(trajectory.end[:, 0])
    move = np.concatenate([i, np.flatnonzero(ends)])
    q = np.concatenate([trajectory.q, trajectory.passes[ends]])
    if not len(q):
        return JointMotion(
            robot=robot, speed=speed, acceleration=acceleration, conditioning=np.inf, nearest_singular=None
        )
    ratio = conditioning(ErrorModel(robot), q)
    nearest = int(np.argmin(ratio))
    return JointMotion(
        robot=robot,
        speed=speed,
        acceleration=acceleration,
        conditioning=float(ratio[nearest]),
        nearest_singular=int(move[nearest]),
        turn_speed_assumed=assumed,
    )


def _durations(
    moves: Sequence[Move], trajectory: ControllerTrajectory, step: Float[np.ndarray, " k"]
) -> tuple[Float[np.ndarray, " k"], int | None]:
    """Time between the samples of the path, seconds, and the first motion where an assumed reorientation speed sets it.

    A controller keeps to the path speed and to the reorientation speed, whichever takes longer.

    Args:
        moves: the motions of the program.
        trajectory: their samples.
        step: share of its motion's length that each sample is behind the one before.
    """
    speed = np.array([move.speed or np.nan for move in moves])[trajectory.move]
    stated = np.array([move.turn_speed or np.nan for move in moves])[trajectory.move]
    unstated = np.isnan(stated)
    along = trajectory.segments.length[trajectory.move] * step / speed
    about = (
        np.linalg.norm(trajectory.segments.turn, axis=1)[trajectory.move]
        * step
        / np.where(unstated, TURN_SPEED, stated)
    )
    time = np.maximum(along, about)
    rows = np.flatnonzero(unstated & (about > along))
    return np.where(time > MIN_STEP_S, time, np.nan), int(trajectory.move[rows[0]]) if len(rows) else None


def _largest(values: Float[np.ndarray, "k joints"], otherwise: Float[np.ndarray, " joints"]) -> np.ndarray:
    complete = np.isfinite(values).all(axis=1)
    return np.abs(values[complete]).max(axis=0) if complete.any() else otherwise


# In which direction each drive turns along a program: it decides on which side of its lost motion the drive stands.

BEFORE_END = 1e-9
"""Share of a motion before its end, which is its own place and not the start of the next motion."""


@dataclass(frozen=True, eq=False, kw_only=True)
class DriveDirections:
    """In which direction each drive turned last, along the motions of a program."""

    place: Float[np.ndarray, " k"]
    """Of each sample, in order: number of its motion plus the share of that motion's length."""
    approach: Float[np.ndarray, "k joints"]
    """As in `Conditions`: 1 where the joint's value grew, −1 where it fell, 0 where unknown, between them at a reversal."""

    def at(self, move: Int[np.ndarray, " n"], share: Float[np.ndarray, " n"]) -> Conditions:
        """The conditions at shares of the lengths of some motions; from one sample to the next a drive turns over evenly."""
        place = move + np.clip(share, 0.0, 1.0 - BEFORE_END)
        if not len(self.place):
            return Conditions(approach=np.zeros((len(place), self.approach.shape[1])))
        columns = [np.interp(place, self.place, column) for column in self.approach.T]
        return Conditions(approach=np.stack(columns, axis=1))


def uses_directions(model: ErrorModel) -> bool:
    """Whether an effect of the model depends on the direction in which a drive turned last."""
    return any("approach" in (*effect.needs, *effect.uses) for effect in model.effects)


def drive_directions(robot: Robot, moves: Sequence[Move], trajectory: ControllerTrajectory) -> DriveDirections:
    """Follow the drives through a program.

    A drive has turned over when it has gone back by twice `MAX_REST_MOTION`; less is what a controller reports of a joint
    at rest. Where it is not known from where a motion begins, directions are unknown until the drives turn.

    Args:
        robot: as its controller knows it.
        moves: the motions.
        trajectory: of the controller in them.
    """
    number = np.arange(len(moves))
    started = np.flatnonzero(np.isfinite(trajectory.start[:, 0]))
    alone = np.flatnonzero(np.isfinite(trajectory.end[:, 0]) & ~np.isin(number, trajectory.move))
    along = trajectory.move + np.minimum(trajectory.share, 1.0 - BEFORE_END)
    place = np.concatenate([started, along, alone + 1.0 - BEFORE_END])
    q = np.concatenate([trajectory.start[started], trajectory.q, trajectory.passes[alone]])
    order = np.argsort(place, kind="stable")
    place, turned = place[order], q[order] @ drive_motion(robot).T
    of_move = place.astype(np.int64)
    continues = np.array(
        [move.follows is not None and move.follows == i - 1 for i, move in enumerate(moves)], dtype=bool
    )
    first = np.diff(of_move, prepend=-1) > 0
    gap = first & ~continues[of_move]
    step = np.diff(turned, axis=0, prepend=turned[:1])
    approach = np.zeros_like(turned)
    for i in range(len(turned)):
        if not gap[i] and i:
            approach[i] = np.clip(approach[i - 1] + step[i] / MAX_REST_MOTION, -1.0, 1.0)
    return DriveDirections(place=place, approach=approach)
