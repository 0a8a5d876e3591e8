"""Joint-side terms of how each drive came to a pose: lost motion, and rests of the last move."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from jaxtyping import Shaped

from taskcal.geometry.expressions import of_largest
from taskcal.robot.conditions import MAX_REST_MOTION, Conditions, joint_sign
from taskcal.robot.effects.base import Effect, LinearTerm
from taskcal.robot.effects.load_path import motor_matrix
from taskcal.robot.robot import Robot


@dataclass(frozen=True, kw_only=True)
class DriveRest(Effect, abstract=True):
    """A turn of each drive by a multiple of how it came to the pose; zero where that is not known."""

    is_share: ClassVar[bool] = False
    """Whether its parameters are shares of a motion, radians per radian."""

    def motion(self, conditions: Conditions) -> Shaped[np.ndarray, "n joints"] | None:
        """Motion of each drive of which the parameters are multiples; None where it is not known."""
        raise NotImplementedError

    def term(self, robot: Robot) -> LinearTerm:
        """Parameters ``J2.backlash`` …, by the effect's key: beyond the pose if positive, short of it if negative."""
        joints = np.array(self.chosen(robot), dtype=np.int64)
        units = ["m" if robot.prismatic[j] else "rad" for j in joints]
        turned = motor_matrix(robot) if robot.four_bar is not None else np.diag(joint_sign(robot))
        parameter, coordinate = np.nonzero(turned[:, joints].T)
        gear = turned[coordinate, joints[parameter]]

        def unknown(q: Shaped[np.ndarray, "n joints"]) -> Shaped[np.ndarray, "n pairs"]:
            return np.zeros((len(q), len(gear)))

        def given(q: Shaped[np.ndarray, "n joints"], conditions: Conditions) -> Shaped[np.ndarray, "n pairs"]:
            motion = self.motion(conditions)
            return unknown(q) if motion is None else motion[:, joints[parameter]] * gear

        return LinearTerm(
            names=tuple(f"{robot.joint_names[j]}.{self.key}" for j in joints),
            units=tuple(f"{unit}/{unit}" if self.is_share else unit for unit in units),
            tolerances=(self.tolerance,) * len(joints),
            pairs=np.stack([coordinate, parameter], axis=1),
            coordinates=len(robot.joints),
            basis=unknown,
            by_joint=lambda q: np.zeros((len(q), len(gear), q.shape[1])),
            given=given,
        )


@dataclass(frozen=True, kw_only=True)
class Backlash(DriveRest):
    """Lost motion: a joint stops elsewhere when its drive turned up to the pose than when it turned down to it.

    Its parameters are half the lost motion. Where the direction of approach is not known, a pose is taken for the middle.
    """

    key = "backlash"
    label = "backlash"
    summary = "lost motion, which depends on the approach direction"
    uses = ("approach",)

    def motion(self, conditions: Conditions) -> Shaped[np.ndarray, "n joints"] | None:
        """Direction in which each drive turned last."""
        return conditions.approach


@dataclass(frozen=True, kw_only=True)
class Overshoot(DriveRest):
    """A rest of the last move in proportion to the speed at which the joint came to its end.

    The drives of a synchronised move start and stop together, so that their speeds are to each other as their moves. The
    one that turns farthest sets the pace, whatever the length of its move; for it the parameter is the rest in radians.
    Without the moves that led to the poses, they are taken for settled.
    """

    key = "overshoot"
    label = "overshoot"
    summary = "residual joint error proportional to the speed at the end of the last move"
    uses = ("move",)

    def motion(self, conditions: Conditions) -> Shaped[np.ndarray, "n joints"] | None:
        """Each drive's move as a share of the largest, with its sign; radians and metres count alike."""
        if conditions.move is None:
            return None
        if conditions.move.dtype == object:
            return of_largest(conditions.move, MAX_REST_MOTION)
        farthest = np.abs(conditions.move).max(axis=1, keepdims=True)
        return np.divide(
            conditions.move, farthest, out=np.zeros_like(conditions.move), where=farthest > MAX_REST_MOTION
        )


@dataclass(frozen=True, kw_only=True)
class Settling(DriveRest):
    """A rest of the last move, in proportion to it: a joint that creeps, or that is read before it has come to rest.

    Without the moves that led to the poses, they are taken for settled.
    """

    key = "settling"
    label = "settling"
    summary = "residual joint error proportional to the length of the last move"
    uses = ("move",)
    is_share: ClassVar[bool] = True

    def motion(self, conditions: Conditions) -> Shaped[np.ndarray, "n joints"] | None:
        """The last move of each drive."""
        return conditions.move
