"""Conditions of poses beside their joint positions: how each drive came to them, temperature and time."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from taskcal.arguments import checked_with_gaps
from taskcal.errors import TaskcalError
from taskcal.robot.robot import Robot
from taskcal.short_repr import short_repr


@checked_with_gaps
@short_repr
@dataclass(frozen=True, eq=False, kw_only=True)
class Conditions:
    """Known conditions of each pose: approach direction, last move, temperature, time."""

    approach: Float[np.ndarray, "n joints"] | None = None
    """Way in which each joint's drive turned last: 1 where the joint's value grew, −1 where it fell, 0 where unknown."""
    move: Float[np.ndarray, "n joints"] | None = None
    """How far each joint's drive turned on the last way to the pose, radians (metres where it slides); 0 where unknown."""
    temperature: Float[np.ndarray, " n"] | None = None
    """Of the robot, °C; NaN where unknown, which counts as the reference of a `Thermal` effect."""
    time: Float[np.ndarray, " n"] | None = None
    """Since the robot began to work, seconds; NaN where unknown, which counts as the reference of a `WarmUp` effect."""

    def __post_init__(self) -> None:
        for name, array in (("approach", self.approach), ("move", self.move)):
            if array is not None and not np.isfinite(array).all():
                row = int(np.flatnonzero(~np.isfinite(array).all(axis=1))[0])
                raise TaskcalError(f"{name} of pose {row} is not a number; give 0 where the way to it is not known")

    @property
    def mean_temperature(self) -> float:
        """Mean over the poses whose temperature is known, to a tenth of a degree, °C.

        Raises:
            TaskcalError: none is.
        """
        if self.temperature is None or not np.isfinite(self.temperature).any():
            raise TaskcalError("no pose has a temperature, so that there is no mean of them")
        return round(float(np.nanmean(self.temperature)), 1)

    def take(self, rows: Int[np.ndarray, " k"] | slice) -> "Conditions":
        """The conditions of some of the poses."""
        return Conditions(
            approach=None if self.approach is None else self.approach[rows],
            move=None if self.move is None else self.move[rows],
            temperature=None if self.temperature is None else self.temperature[rows],
            time=None if self.time is None else self.time[rows],
        )


# How each drive came to a pose, where poses were reached one after another.

MAX_REST_MOTION = 1e-4
"""Largest motion of a drive that leaves it as it is, radians or metres: what a controller reports of a joint at rest."""


def joint_sign(robot: Robot) -> Float[np.ndarray, " joints"]:
    """Whether the chain coordinate of each joint grows (1) or falls (−1) with the joint's own value."""
    return np.where(np.diag(robot.joint_map.matrix) < 0.0, -1.0, 1.0)


def drive_motion(robot: Robot) -> Float[np.ndarray, "joints joints"]:
    """Turn of each joint's drive, in the joint's own sense, per change of the controller's positions.

    Behind a four-bar the controller counts motors. A coupling without one is the controller's way of counting, and each
    drive stands at its own axis.
    """
    if robot.four_bar is not None:
        return np.eye(len(robot.joints))
    return robot.joint_map.matrix[: len(robot.joints)] * joint_sign(robot)[:, None]


def conditions_in_order(
    robot: Robot, q: Float[np.ndarray, "n joints"], follows: Bool[np.ndarray, " n"] | None = None
) -> Conditions:
    """The last move of each drive, and its way; a drive that stood still keeps its way.

    Args:
        robot: the robot.
        q: joint positions in the order in which they were reached, radians.
        follows: whether a pose was reached from the one before it; all but the first by default. After a gap nothing is
            known of a drive until it moves.
    """
    reached = np.arange(len(q)) > 0 if follows is None else follows & (np.arange(len(q)) > 0)
    move = np.where(reached[:, None], np.diff(q, axis=0, prepend=q[:1]) @ drive_motion(robot).T, 0.0)
    approach = np.where(np.abs(move) > MAX_REST_MOTION, np.sign(move), 0.0)
    for i in np.flatnonzero(reached):
        approach[i] = np.where(approach[i] == 0.0, approach[i - 1], approach[i])
    return Conditions(approach=approach, move=move)
