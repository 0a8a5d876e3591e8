"""Drives that yield under what they carry."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from jaxtyping import Float

from taskcal.errors import TaskcalError
from taskcal.kernels import walk
from taskcal.kernels.chain import Chain, Fixed, Joint, Step
from taskcal.robot.effects.base import DEFLECTION, Effect, LinearTerm, frozen
from taskcal.robot.effects.load_path import LoadPath, at_motors, sample_poses
from taskcal.robot.parameter import ShownUnit
from taskcal.robot.robot import Robot
from taskcal.robot.statics import STANDARD_GRAVITY, Body, CoilSpring, Load

# Drives that yield under weights that nobody knows: one parameter for each lever of each motor.

OWN_SHARE = 1e-6
"""Share of a column under which what is left of it is nothing of its own."""


def yield_under_lumped_weights(robot: Robot, motors: Sequence[int], tolerance: float) -> LinearTerm:
    """Parameters ``J2.sag_J4`` (weight at the origin of joint 4) … ``J2.sag_tool``, radians per metre of lever.

    Columns that a motor's others already span are left out.

    Args:
        robot: the robot.
        motors: those that yield.
        tolerance: of each parameter.
    """
    steps = robot.steps()
    ends = [k for k, step in enumerate(steps) if isinstance(step, Joint)] + [len(steps)]
    chains = [Chain.of(steps[:k]) for k in ends]
    sample = _levers(robot, chains, LoadPath.at(robot, sample_poses(robot)))
    kept: list[tuple[int, int]] = []
    for motor in motors:
        own: list[np.ndarray] = []
        for point in range(len(chains)):
            column = sample[:, point, motor]
            if _is_new(column, own):
                own.append(column)
                kept.append((motor, point))
    labels = [*robot.joint_names, "tool"]
    point = np.array([p for _, p in kept], dtype=np.int64)
    motor = np.array([m for m, _ in kept], dtype=np.int64)
    return at_motors(
        robot,
        [f"{robot.joint_names[m]}.sag_{labels[p]}" for m, p in kept],
        [m for m, _ in kept],
        [tolerance] * len(kept),
        lambda path: _levers(robot, chains, path)[:, point, motor],
        lambda path: np.stack([path.torque_by_joint(chain, robot.statics.gravity) for chain in chains], axis=1)[
            :, point, motor
        ],
        per="m",
    )


def _levers(robot: Robot, chains: Sequence[Chain], path: LoadPath) -> Float[np.ndarray, "n points motors"]:
    """How far the end of each chain goes down for a turn of each motor, metres per radian."""
    return np.stack([path.torque(chain, robot.statics.gravity) for chain in chains], axis=1)


def _is_new(column: Float[np.ndarray, " n"], others: list[Float[np.ndarray, " n"]]) -> bool:
    """Whether a column says something that a combination of the others does not."""
    size = float(np.linalg.norm(column))
    if size < OWN_SHARE * np.sqrt(len(column)):
        return False
    if not others:
        return True
    basis = np.stack(others, axis=1)
    rest = column - basis @ np.linalg.lstsq(basis, column, rcond=None)[0]
    return float(np.linalg.norm(rest)) > OWN_SHARE * size


# Torques that known loads put on the motors, by virtual work.

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


STATED_ERROR_SHARE = 0.3
"""Share by which a stated stiffness is expected to be wrong (1σ): it is rarely measured, and drives differ."""

MIN_STATED_SHARE = 0.1
"""A drive is taken to be built for this share of the largest torque among all drives at least, where it carries less."""

CERTAIN_SIGMAS = 3.0
"""Standard errors below zero from which on a compliance is called negative."""


@dataclass(frozen=True, kw_only=True)
class Compliance(Effect):
    """Drives that yield under the weight of what they carry, and under forces at the tool.

    Torques come by virtual work through the true load path: through a parallelogram's rod the forearm's moment goes to the
    motor of its crank, whose absolute angle yields, and the lower arm's motor carries its weight but not its moment. A
    coupling without a four-bar is the controller's way of counting, and each drive yields about its own axis.

    Where the robot file states the masses, each joint has one compliance, which acts on the torque of all known loads
    together. Where it does not, each motor has a parameter for a weight at each later joint and at the tool point: the
    product of compliance and weight, so that neither must be known.
    """

    key = "compliance"
    label = "compliance"
    summary = "drives that yield under the weight of what they carry, and under forces at the tool"

    load: Load | None = None
    """Payload, force and moment; by default the robot file's payload, and no force. It needs masses in the robot file."""

    @property
    def details(self) -> str:
        """Its tolerance, where that is another than usual."""
        return "" if self.tolerance == DEFLECTION else f" (±{self.tolerance * 1e3:g} mrad)"

    def under(self, load: Load) -> "Compliance":
        """The same drives under another load."""
        return replace(self, load=load)

    def remarks(self, robot: Robot, estimates: Mapping[str, tuple[float, float]]) -> list[str]:
        """Drives that would yield against their load, beyond doubt."""
        out: list[str] = []
        for joint, stiffness, slides in zip(robot.joint_names, robot.statics.stiffness, robot.prismatic, strict=True):
            if f"{joint}.compliance" not in estimates:
                continue
            unit = ShownUnit.of("m/N" if slides else "rad/Nm")
            deviation, error = estimates[f"{joint}.compliance"]
            total = deviation + (0.0 if stiffness is None else 1.0 / stiffness)
            if total < -CERTAIN_SIGMAS * error:
                out.append(
                    f"the compliance of {joint} is {total * unit.factor:.3g} ± {error * unit.factor:.2g} {unit.name}, but no "
                    "drive yields against its load: something else there has the shape of gravity; do not predict other "
                    "loads with it"
                )
        return out

    @classmethod
    def from_json(cls, options: Mapping[str, Any]) -> "Compliance":
        """The effect of these options, as `to_json` gives them."""
        load = options.get("load")
        others = frozen({name: value for name, value in options.items() if name != "load"})
        return cls(**others, load=None if load is None else Load(**frozen(load)))

    def term(self, robot: Robot) -> LinearTerm:
        """Parameters ``J2.compliance``, radians per newton metre, or ``J2.sag_J4`` …, radians per metre of lever.

        Raises:
            TaskcalError: there is a load, but no masses of the links.
        """
        if robot.statics.links is not None:
            return self._of_known_loads(robot)
        if self.load is not None:
            raise TaskcalError(
                f"{robot.name}: a load deflects drives whose compliance is known by itself, which takes masses; state mass_kg "
                "and centre_mm of every joint in the robot file"
            )
        return yield_under_lumped_weights(robot, self.chosen(robot), self.tolerance)

    def _of_known_loads(self, robot: Robot) -> LinearTerm:
        """One compliance for each joint, about the stated stiffness where there is one.

        The tolerances do not depend on the load, so that it may change between calibration and use.
        """
        motors = self.chosen(robot)
        own = motor_torque(robot, Load())(LoadPath.at(robot, sample_poses(robot)))
        largest = np.abs(own).max(axis=0)
        # a robot without weight gives no scale; 1 Nm keeps its tolerances finite
        built_for = np.maximum(largest, MIN_STATED_SHARE * max(float(largest.max()), 1.0))
        stiffness = [robot.statics.stiffness[m] for m in motors]
        load = self.load or Load()
        torque, slope = motor_torque(robot, load), motor_torque_by_joint(robot, load)
        return at_motors(
            robot,
            [f"{robot.joint_names[m]}.compliance" for m in motors],
            motors,
            [
                self.tolerance / built_for[m] if k is None else STATED_ERROR_SHARE / k
                for m, k in zip(motors, stiffness, strict=True)
            ],
            lambda path: torque(path)[:, motors],
            lambda path: slope(path)[:, motors],
            nominal=[0.0 if k is None else 1.0 / k for k in stiffness],
            per="Nm",
        )


SOFT = Compliance(tolerance=3e-3)
"""Drives of 10⁶ Nm/rad under some hundred kilograms, or of 10⁴ under some kilograms: milliradians per metre of lever."""


# A spring beside an axis, and how its drive yields to it.


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
