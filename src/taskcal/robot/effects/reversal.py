"""Joint-side terms of the way on which each drive came to a pose."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from taskcal.robot.approach import MAX_REST_MOTION, joint_sign
from taskcal.robot.conditions import Conditions
from taskcal.robot.effects.base import Effect, LinearTerm
from taskcal.robot.effects.load_path import motor_matrix
from taskcal.robot.robot import Robot

Way = Callable[[Conditions], Float[np.ndarray, "n joints"] | None]


def at_drives(
    names: Sequence[str],
    units: Sequence[str],
    robot: Robot,
    joints: Int[np.ndarray, " p"],
    tolerance: float,
    way: Way,
) -> LinearTerm:
    """A term of which each parameter turns one drive by a multiple of what its way to the pose was.

    Args:
        names: of the parameters.
        units: of the parameters.
        robot: the robot.
        joints: number of the joint whose drive each one turns.
        tolerance: of every parameter.
        way: what counts of the conditions; where they do not have it, the term is zero.
    """
    turned = motor_matrix(robot) if robot.four_bar is not None else np.diag(joint_sign(robot))
    parameter, coordinate = np.nonzero(turned[:, joints].T)
    gear = turned[coordinate, joints[parameter]]

    def unknown(q: Float[np.ndarray, "n joints"]) -> Float[np.ndarray, "n pairs"]:
        return np.zeros((len(q), len(gear)))

    def given(q: Float[np.ndarray, "n joints"], conditions: Conditions) -> Float[np.ndarray, "n pairs"]:
        motion = way(conditions)
        return unknown(q) if motion is None else motion[:, joints[parameter]] * gear

    return LinearTerm(
        names=tuple(names),
        units=tuple(units),
        tolerances=(tolerance,) * len(joints),
        pairs=np.stack([coordinate, parameter], axis=1),
        coordinates=len(robot.joints),
        basis=unknown,
        by_joint=lambda q: np.zeros((len(q), len(gear), q.shape[1])),
        given=given,
    )


# Lost motion of drives.


@dataclass(frozen=True, kw_only=True)
class Backlash(Effect):
    """Lost motion: a joint stops elsewhere when its drive turned up to the pose than when it turned down to it.

    Without the ways in which a pose was approached, it is taken for the middle between both.
    """

    key = "backlash"
    label = "backlash"
    summary = "joints that stop elsewhere when they come from above than from below"
    uses = ("approach",)

    def term(self, robot: Robot) -> LinearTerm:
        """Parameters ``J2.backlash``, half the lost motion, radians: beyond the middle if positive, short of it if negative."""
        joints = np.array(self.chosen(robot), dtype=np.int64)
        names = [f"{robot.joint_names[j]}.backlash" for j in joints]
        units = ["m" if robot.prismatic[j] else "rad" for j in joints]
        return at_drives(names, units, robot, joints, self.tolerance, lambda conditions: conditions.approach)


# What is left of the speed at which each drive came.


@dataclass(frozen=True, kw_only=True)
class Overshoot(Effect):
    """A rest of the last move in proportion to the speed at which the joint came to its end.

    The drives of a synchronised move start and stop together, so that their speeds are to each other as their moves. The
    one that turns farthest sets the pace, whatever the length of its move.
    Without the moves that led to the poses, they are taken for settled.
    """

    key = "overshoot"
    label = "overshoot"
    summary = "joints that keep a small rest of the last move, in proportion to the speed at which they came"
    uses = ("move",)

    def term(self, robot: Robot) -> LinearTerm:
        """Parameters ``J2.overshoot``, radians where the joint sets the pace: beyond the end if positive, short of it if not."""
        joints = np.array(self.chosen(robot), dtype=np.int64)
        names = [f"{robot.joint_names[j]}.overshoot" for j in joints]
        units = ["m" if robot.prismatic[j] else "rad" for j in joints]
        return at_drives(names, units, robot, joints, self.tolerance, _pace)


def _pace(conditions: Conditions) -> Float[np.ndarray, "n joints"] | None:
    """Each drive's move as a share of the largest, with its sign; radians and metres count alike."""
    if conditions.move is None:
        return None
    farthest = np.abs(conditions.move).max(axis=1, keepdims=True)
    return np.divide(conditions.move, farthest, out=np.zeros_like(conditions.move), where=farthest > MAX_REST_MOTION)


# What is left of the last move.


@dataclass(frozen=True, kw_only=True)
class Settling(Effect):
    """A rest of the last move, in proportion to it: a joint that creeps, or that is read before it has come to rest.

    Without the moves that led to the poses, they are taken for settled.
    """

    key = "settling"
    label = "settling"
    summary = "joints that keep a small rest of the last move, in proportion to its length"
    uses = ("move",)

    def term(self, robot: Robot) -> LinearTerm:
        """Parameters ``J2.settling``, radians per radian: beyond the end of the move if positive, short of it if negative."""
        joints = np.array(self.chosen(robot), dtype=np.int64)
        names = [f"{robot.joint_names[j]}.settling" for j in joints]
        units = ["m/m" if robot.prismatic[j] else "rad/rad" for j in joints]
        return at_drives(names, units, robot, joints, self.tolerance, lambda conditions: conditions.move)
