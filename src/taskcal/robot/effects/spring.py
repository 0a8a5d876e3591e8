"""A spring beside an axis, and how its drive yields to it."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from taskcal.errors import TaskcalError
from taskcal.robot.effects.effect import Effect
from taskcal.robot.effects.linear_term import LinearTerm
from taskcal.robot.effects.load_path import LoadPath, at_motors, sample_poses
from taskcal.robot.robot import Robot
from taskcal.robot.statics import CoilSpring


@dataclass(frozen=True, kw_only=True)
class Spring(Effect):
    """A gravity compensator: the drive of its axis yields to the torque of a spring.

    Where the robot file has a ``[spring]``, the shape of its torque is known, and one parameter scales it. Where it has none,
    the torque of an ideal spring of no free length is a cosine and a sine of the axis' angle, of unknown size and phase. On a
    robot without a four-bar these two are those of `Harmonics` of order 1, and data cannot tell them apart.
    """

    key = "spring"
    label = "spring"
    asks_for = "the robot file states no spring"
    summary = "the drive of axis 2 yields to a spring: that of the robot file, or one of unknown size"

    def suits(self, robot: Robot) -> bool:
        """Whether the robot file states a spring."""
        return robot.statics.spring is not None

    def term(self, robot: Robot) -> LinearTerm:
        """Parameter ``J2.spring``, radians per newton metre of spring, or ``J2.spring_cos`` and ``J2.spring_sin``, radians.

        Raises:
            TaskcalError: other joints are named than the one that has the spring, or a joint that slides.
        """
        stated = robot.statics.spring
        if stated is None:
            return self._of_unknown_geometry(robot)
        name = robot.joint_names[stated.joint]
        if self.joints is not None and self.chosen(robot) != [stated.joint]:
            raise TaskcalError(f"{robot.name}: the robot file's spring is on {name}, not on {', '.join(self.joints)}")
        largest = float(np.abs(_torque(robot, stated, LoadPath.at(robot, sample_poses(robot)))).max())
        return at_motors(
            robot,
            [f"{name}.spring"],
            [stated.joint],
            [self.tolerance / largest],
            lambda path: _torque(robot, stated, path)[:, None],
            lambda path: _torque_by_joint(robot, stated, path)[:, None],
            per="Nm",
        )

    def _of_unknown_geometry(self, robot: Robot) -> LinearTerm:
        if self.joints is None and len(robot.joints) < 2:
            raise TaskcalError(f"{robot.name} has no second axis; name the joint that has the spring")
        motors = [1] if self.joints is None else self.chosen(robot)
        for motor in motors:
            if robot.prismatic[motor]:
                raise TaskcalError(f"{robot.joint_names[motor]} of {robot.name} slides; a spring turns its axis")

        def turns(path: LoadPath) -> Float[np.ndarray, "n p"]:
            angle = path.coordinates[:, motors]
            return np.stack([np.cos(angle), np.sin(angle)], axis=2).reshape(len(angle), -1)

        def turns_by_joint(path: LoadPath) -> Float[np.ndarray, "n p joints"]:
            angle = path.coordinates[:, motors]
            shapes = np.stack([-np.sin(angle), np.cos(angle)], axis=2)
            by_joint = shapes[..., None] * path.by_joint[:, motors, None]
            return by_joint.reshape(len(angle), -1, by_joint.shape[-1])

        return at_motors(
            robot,
            [f"{robot.joint_names[m]}.spring_{part}" for m in motors for part in ("cos", "sin")],
            [m for m in motors for _ in range(2)],
            [self.tolerance] * 2 * len(motors),
            turns,
            turns_by_joint,
        )


def _torque(robot: Robot, spring: CoilSpring, path: LoadPath) -> Float[np.ndarray, " n"]:
    """Of the spring on its own motor."""
    j = spring.joint
    turn = path.coordinates[:, j] - robot.joint_map.offset[j]
    return spring.torque(turn) * path.by_motor[:, j, j]


def _torque_by_joint(robot: Robot, spring: CoilSpring, path: LoadPath) -> Float[np.ndarray, "n joints"]:
    """Derivative of `_torque` by the controller's joints."""
    j = spring.joint
    turn = path.coordinates[:, j] - robot.joint_map.offset[j]
    stiffening = spring.torque_by_turn(turn) * path.by_motor[:, j, j]
    return stiffening[:, None] * path.by_joint[:, j] + spring.torque(turn)[:, None] * path.curvature[:, j, j]
