"""Torques that known loads put on the motors, by virtual work."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from taskcal.geometry import walk
from taskcal.geometry.chain import Chain, Fixed, Joint, Step
from taskcal.robot.effects.load_path import LoadPath
from taskcal.robot.load import Load
from taskcal.robot.robot import Robot
from taskcal.robot.statics import STANDARD_GRAVITY, Body

Torque = Callable[[LoadPath], Float[np.ndarray, "n motors"]]


@dataclass(frozen=True, eq=False, kw_only=True)
class _Weight:
    """A body that the end of a chain carries."""

    chain: Chain
    body: Body


def motor_torque(robot: Robot, load: Load) -> Torque:
    """Torque of all known loads on every motor, newton metres (newtons where it slides), in the nominal geometry.

    The weights of links and payload, the force and moment at the tool point, and the torque of the robot's spring: a force
    f and a moment m at a point put on motor j the torque Jv_jᵀ f + Jw_jᵀ m, with J the point's columns.

    Args:
        robot: one whose links' masses are known.
        load: payload, force and moment.
    """
    weights, tool = _weights(robot, load), Chain.of(robot.steps())
    down = STANDARD_GRAVITY * robot.statics.gravity
    wrench = np.array([*load.force, *load.moment])
    spring = robot.statics.spring
    rest = robot.joint_map.offset

    def torque(path: LoadPath) -> Float[np.ndarray, "n motors"]:
        out = np.zeros(path.motors.shape)
        for weight in weights:
            out += path.torque(weight.chain, weight.body.mass * down, np.array(weight.body.centre))
        if wrench.any():
            pushed = wrench
            if load.axes == "tool":
                pushed = _in_base(tool, path, wrench)
            out += path.torque(tool, pushed)
        if spring is not None:
            turn = path.coordinates[:, spring.joint] - rest[spring.joint]
            out += spring.torque(turn)[:, None] * path.by_motor[:, spring.joint]
        return out

    return torque


def motor_torque_by_joint(robot: Robot, load: Load) -> Callable[[LoadPath], Float[np.ndarray, "n motors joints"]]:
    """Derivative of `motor_torque` by the controller's joints, newton metres per radian."""
    weights, tool = _weights(robot, load), Chain.of(robot.steps())
    down = STANDARD_GRAVITY * robot.statics.gravity
    wrench = np.array([*load.force, *load.moment])
    spring = robot.statics.spring

    def slope(path: LoadPath) -> Float[np.ndarray, "n motors joints"]:
        out = np.zeros((*path.motors.shape, path.by_joint.shape[2]))
        for weight in weights:
            out += path.torque_by_joint(weight.chain, weight.body.mass * down, np.array(weight.body.centre))
        if wrench.any():
            turning = load.axes == "tool"
            pushed = _in_base(tool, path, wrench) if turning else wrench
            out += path.torque_by_joint(tool, pushed, turning=turning)
        if spring is not None:
            j = spring.joint
            turn = path.coordinates[:, j] - robot.joint_map.offset[j]
            stiffening = spring.torque_by_turn(turn)[:, None] * path.by_joint[:, j]
            out += stiffening[:, None] * path.by_motor[:, j, :, None]
            out += spring.torque(turn)[:, None, None] * path.curvature[:, j]
        return out

    return slope


def _in_base(tool: Chain, path: LoadPath, wrench: Float[np.ndarray, " 6"]) -> Float[np.ndarray, "n 6"]:
    """A force and a moment of the tool's axes in those of the base."""
    R = walk.poses(tool, path.coordinates, np.zeros((0, 6)))[:, :3, :3]
    return np.concatenate([R @ wrench[:3], R @ wrench[3:]], axis=1)


def _weights(robot: Robot, load: Load) -> list[_Weight]:
    """What moves with each joint, and the payload; bodies without mass left out."""
    payload = load.payload(robot.statics.payload)
    out: list[_Weight] = []
    steps: list[Step] = []
    for joint, link in zip(robot.joints, robot.statics.links or (), strict=True):
        steps += [Fixed(part.transform) for part in joint.before]
        steps.append(Joint(joint.kind))
        steps += [Fixed(part.transform) for part in joint.after]
        out.append(_Weight(chain=Chain.of(steps), body=link))
    steps += [Fixed(part.transform) for part in robot.flange]
    out.append(_Weight(chain=Chain.of(steps), body=payload))
    return [weight for weight in out if weight.body.mass]
