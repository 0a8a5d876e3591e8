"""Drives: those of a wrist that run through each other, and those that yield to weights, forces and springs."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from jaxtyping import Int, Shaped

from taskcal.errors import TaskcalError, UnknownName
from taskcal.geometry import se3
from taskcal.kernels.chain import Chain, Fixed, Joint, Step
from taskcal.robot.effects.base import DEFLECTION, Basis, Effect, LinearTerm, at_joints, frozen
from taskcal.robot.effects.load_path import LoadPath, at_motors, sample_poses
from taskcal.robot.parameter import ShownUnit
from taskcal.robot.robot import Robot
from taskcal.robot.statics import STANDARD_GRAVITY, Body, CoilSpring, Load
from taskcal_groundwork.said import Said

# Joints that move a little with others.

MAX_AXIS_DISTANCE_M = 1e-6
"""Distance under which axes meet, metres."""


@dataclass(frozen=True, kw_only=True)
class Coupling(Effect):
    """A share of one joint's motion that another makes too: wrists whose drives run through each other.

    By default the robot's last three joints: the middle one by the first, the last one by both. Of a shaft that slides and turns,
    as at the end of a SCARA, the slide by the turn: the nut of its screw stands still while the shaft turns in it.
    """

    key = "coupling"
    label = "coupling"
    asks_for = Said("the last three axes do not meet in a point, and the last joints are not of one shaft")
    summary = "coupling of the wrist: each joint moves a little with another"

    pairs: tuple[tuple[str, str], ...] | None = None
    """Names of the joint that drives and of the joint that it moves; those of the wrist by default."""

    def suits(self, robot: Robot) -> bool:
        """Whether its last three axes meet in a point, or its last joints are of one shaft: such drives run through each other."""
        if _shaft(robot) is not None:
            return True
        return len(robot.joints) > 2 and not any(robot.prismatic[-3:]) and _meet(robot)

    def term(self, robot: Robot) -> LinearTerm:
        """Parameters ``J5.by_J4`` …, a share of the motion that drives, with `tolerance` as standard deviation.

        Raises:
            UnknownName: a joint that the robot does not have.
            TaskcalError: a joint moved by itself, or a robot without a wrist.
        """
        names, moved = robot.joint_names, self.chosen(robot)
        pairs = [(drives, moves) for drives, moves in self._pairs(robot) if moves in moved]
        for i, j in pairs:
            if i == j:
                raise TaskcalError(f"{names[j]} cannot be coupled to itself: name two different joints")
        by = np.array([i for i, _ in pairs], dtype=np.int64)
        turn, turn_by_joint = turn_of(robot, by)
        return at_joints(
            [f"{names[j]}.by_{names[i]}" for i, j in pairs],
            robot,
            np.array([j for _, j in pairs], dtype=np.int64),
            [self.tolerance] * len(pairs),
            turn,
            by_joint=turn_by_joint,
            share=by,
        )

    def _pairs(self, robot: Robot) -> list[tuple[int, int]]:
        names = robot.joint_names
        if self.pairs is None:
            last, shaft = len(names) - 1, _shaft(robot)
            if shaft is not None:
                return [shaft]
            if last < 2:
                raise TaskcalError(
                    f"{robot.name} has no wrist of three joints; name the pairs of joints that are coupled"
                )
            return [(last - 2, last - 1), (last - 2, last), (last - 1, last)]
        for name in (name for pair in self.pairs for name in pair):
            if name not in names:
                raise UnknownName("joint", name, names, f"of {robot.name}")
        return [(names.index(drives), names.index(moves)) for drives, moves in self.pairs]


def _shaft(robot: Robot) -> tuple[int, int] | None:
    """The turn and the slide of the last two joints, where they lie along each other; None where they do not."""
    last = len(robot.joints) - 1
    if last < 1 or robot.prismatic[last] == robot.prismatic[last - 1]:
        return None
    between = np.eye(4)
    for part in (*robot.joints[last - 1].after, *robot.joints[last].before):
        between = between @ part.transform
    if abs(between[2, 2]) < 1.0 - MAX_AXIS_DISTANCE_M:
        return None
    return (last - 1, last) if robot.prismatic[last] else (last, last - 1)


def _meet(robot: Robot) -> bool:
    """Whether a point lies on the last three axes; by least squares over their lines."""
    pose, normal, right = np.eye(4), np.zeros((3, 3)), np.zeros(3)
    left: list[tuple[np.ndarray, np.ndarray]] = []
    for i, joint in enumerate(robot.joints):
        for part in joint.before:
            pose = pose @ part.transform
        if i >= len(robot.joints) - 3:
            across = np.eye(3) - np.outer(pose[:3, 2], pose[:3, 2])
            left.append((across, pose[:3, 3]))
            normal += across
            right += across @ pose[:3, 3]
        pose = pose @ se3.rotation("z", 0.7)  # away from where axes line up
        for part in joint.after:
            pose = pose @ part.transform
    point = np.linalg.lstsq(normal, right, rcond=None)[0]
    return all(float(np.linalg.norm(across @ (point - origin))) < MAX_AXIS_DISTANCE_M for across, origin in left)


def turn_of(robot: Robot, joints: Int[np.ndarray, " p"]) -> tuple[Basis, Basis]:
    """Turn of some joints from zero, and its derivative by the joint positions."""
    matrix, middle = robot.joint_map.matrix[joints], robot.joint_map(np.zeros((1, len(robot.joints))))[0]
    return (
        lambda q: (robot.joint_map(q) - middle)[:, joints],
        lambda q: np.broadcast_to(matrix, (len(q), *matrix.shape)),
    )


# Drives that yield under unknown weights: one parameter for each lever of each motor.

MIN_OWN_SHARE = 1e-6
"""Share of a column under which its residual against the others counts as rounding."""


def yield_under_lumped_weights(robot: Robot, motors: Sequence[int], tolerance: float) -> LinearTerm:
    """Parameters ``J2.sag_J4`` (weight at the origin of joint 4) … ``J2.sag_tool``, radians per metre of lever.

    Columns that a motor's others already span are left out.
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


def _levers(robot: Robot, chains: Sequence[Chain], path: LoadPath) -> Shaped[np.ndarray, "n points motors"]:
    """Descent of each chain's end for a turn of each motor, metres per radian."""
    return np.stack([path.torque(chain, robot.statics.gravity) for chain in chains], axis=1)


def _is_new(column: Shaped[np.ndarray, " n"], others: list[Shaped[np.ndarray, " n"]]) -> bool:
    """Whether a column says something that a combination of the others does not."""
    size = float(np.linalg.norm(column))
    if size < MIN_OWN_SHARE * np.sqrt(len(column)):
        return False
    if not others:
        return True
    basis = np.stack(others, axis=1)
    rest = column - basis @ np.linalg.lstsq(basis, column, rcond=None)[0]
    return float(np.linalg.norm(rest)) > MIN_OWN_SHARE * size


# Torques that known loads put on the motors, by virtual work.


@dataclass(frozen=True, eq=False, kw_only=True)
class MotorTorque:
    """Torque of all known loads on every motor, newton metres (newtons where it slides), in the nominal geometry.

    The weights of links and payload, the force and moment at the TCP, and the torque of the robot's spring: a force
    f and a moment m at a point put on motor j the torque Jv_jᵀ f + Jw_jᵀ m, with J the point's columns.
    """

    weights: list[tuple[Chain, Shaped[np.ndarray, " 3"], Shaped[np.ndarray, " 3"]]]
    """Chains that carry a body, its weight in base axes, newtons, and its centre in the frame of the chain's end, metres."""
    tool: Chain
    wrench: Shaped[np.ndarray, " 6"]
    """At the TCP, newtons and newton metres."""
    turning: bool
    """Whether force and moment turn with the tool."""
    robot: Robot

    @classmethod
    def of(cls, robot: Robot, load: Load) -> "MotorTorque":
        """The torque of payload, force and moment on a robot whose links' masses are known."""
        down = STANDARD_GRAVITY * robot.statics.gravity
        return cls(
            weights=[(chain, body.mass * down, np.array(body.centre)) for chain, body in _weights(robot, load)],
            tool=Chain.of(robot.steps()),
            wrench=np.array([*load.force, *load.moment]),
            turning=load.axes == "tool",
            robot=robot,
        )

    def at(self, path: LoadPath) -> Shaped[np.ndarray, "n motors"]:
        """The torques where the load path stands."""
        out = np.zeros_like(path.motors)
        for chain, weight, centre in self.weights:
            out += path.torque(chain, weight, centre)
        if self.wrench.any():
            out += path.torque(self.tool, self._in_base(path))
        if self.robot.statics.spring is not None:
            out += spring_torque(self.robot, self.robot.statics.spring, path)
        return out

    def by_joint(self, path: LoadPath) -> Shaped[np.ndarray, "n motors joints"]:
        """Derivative of the torques by the controller's joints, newton metres per radian."""
        out = np.zeros((*path.motors.shape, path.by_joint.shape[2]))
        for chain, weight, centre in self.weights:
            out += path.torque_by_joint(chain, weight, centre)
        if self.wrench.any():
            out += path.torque_by_joint(self.tool, self._in_base(path), turning=self.turning)
        if self.robot.statics.spring is not None:
            out += spring_torque_by_joint(self.robot, self.robot.statics.spring, path)
        return out

    def _in_base(self, path: LoadPath) -> Shaped[np.ndarray, "*n 6"]:
        """Force and moment in the base's axes."""
        if not self.turning:
            return self.wrench
        R = path.rotations(self.tool)
        return np.concatenate([R @ self.wrench[:3], R @ self.wrench[3:]], axis=1)


def spring_torque(robot: Robot, spring: CoilSpring, path: LoadPath) -> Shaped[np.ndarray, "n motors"]:
    """Torque of a spring on every motor, newton metres."""
    j = spring.joint
    turn = path.coordinates[:, j] - robot.joint_map.offset[j]
    return spring.torque(turn)[:, None] * path.by_motor[:, j]


def spring_torque_by_joint(robot: Robot, spring: CoilSpring, path: LoadPath) -> Shaped[np.ndarray, "n motors joints"]:
    """Derivative of `spring_torque` by the controller's joints, newton metres per radian."""
    j = spring.joint
    turn = path.coordinates[:, j] - robot.joint_map.offset[j]
    stiffening = spring.torque_by_turn(turn)[:, None] * path.by_joint[:, j]
    return (
        stiffening[:, None] * path.by_motor[:, j, :, None] + spring.torque(turn)[:, None, None] * path.curvature[:, j]
    )


def _weights(robot: Robot, load: Load) -> list[tuple[Chain, Body]]:
    """Bodies that move with each joint, and the payload, with the chains that carry them; those without mass left out."""
    payload = load.payload(robot.statics.payload)
    out: list[tuple[Chain, Body]] = []
    steps: list[Step] = []
    for joint, link in zip(robot.joints, robot.statics.links or (), strict=True):
        steps += [Fixed(part.transform) for part in joint.before]
        steps.append(Joint(joint.kind))
        steps += [Fixed(part.transform) for part in joint.after]
        out.append((Chain.of(steps), link))
    steps += [Fixed(part.transform) for part in robot.flange]
    out.append((Chain.of(steps), payload))
    return [(chain, body) for chain, body in out if body.mass]


STATED_ERROR_SHARE = 0.3
"""Share by which a stated stiffness is expected to be wrong (1σ): it is rarely measured, and drives differ."""

MIN_STATED_SHARE = 0.1
"""A drive is taken to be built for this share of the largest torque among all drives at least, where it carries less."""

CERTAIN_SIGMAS = 3.0
"""Standard errors below zero from which on a compliance is called negative."""


@dataclass(frozen=True, kw_only=True)
class Compliance(Effect):
    """Compliance of the drives under gravity, and under forces at the tool.

    Torques come by virtual work through the true load path: through a parallelogram's rod the forearm's moment goes to the
    motor of its crank, whose absolute angle yields, and the lower arm's motor carries its weight but not its moment. A
    coupling without a four-bar is the controller's way of counting, and each drive yields about its own axis.

    Where the robot file states the masses, each joint has one compliance, which acts on the torque of all known loads
    together. Where it does not, each motor has a parameter for a weight at each later joint and at the TCP: the
    product of compliance and weight, so that neither must be known.
    """

    key = "compliance"
    label = "compliance"
    summary = "joint deflection under gravity and process forces"

    load: Load | None = None
    """Payload, force and moment; by default the robot file's payload, and no force. It needs masses in the robot file."""

    @property
    def details(self) -> str:
        """The tolerance, where it is not the default."""
        return "" if self.tolerance == DEFLECTION else f" (expected σ {self.tolerance * 1e3:g} mrad)"

    def under(self, load: Load) -> "Compliance":
        """Return the effect for another load."""
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
                    Said(
                        "the compliance of {joint} is {total:.3g} {unit} (standard error {error:.2g}), but no drive yields against "
                        "its load: something else there has the shape of gravity; do not predict other loads with it",
                        joint=joint,
                        total=total * unit.factor,
                        unit=unit.name,
                        error=error * unit.factor,
                    )
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
        own = MotorTorque.of(robot, Load()).at(LoadPath.at(robot, sample_poses(robot)))
        largest = np.abs(own).max(axis=0)
        # a robot without weight gives no scale; 1 Nm keeps its tolerances finite
        built_for = np.maximum(largest, MIN_STATED_SHARE * max(float(largest.max()), 1.0))
        stiffness = [robot.statics.stiffness[m] for m in motors]
        torque = MotorTorque.of(robot, self.load or Load())
        return at_motors(
            robot,
            [f"{robot.joint_names[m]}.compliance" for m in motors],
            motors,
            [
                self.tolerance / built_for[m] if k is None else STATED_ERROR_SHARE / k
                for m, k in zip(motors, stiffness, strict=True)
            ],
            lambda path: torque.at(path)[:, motors],
            lambda path: torque.by_joint(path)[:, motors],
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
    asks_for = Said("the robot file states no spring")
    summary = "deflection of the drive of axis 2 by a spring: the robot file's, or one of unknown size"

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
        own = [stated.joint]
        largest = float(np.abs(spring_torque(robot, stated, LoadPath.at(robot, sample_poses(robot)))[:, own]).max())
        return at_motors(
            robot,
            [f"{name}.spring"],
            own,
            [self.tolerance / largest],
            lambda path: spring_torque(robot, stated, path)[:, own],
            lambda path: spring_torque_by_joint(robot, stated, path)[:, own],
            per="Nm",
        )

    def _of_unknown_geometry(self, robot: Robot) -> LinearTerm:
        if self.joints is None and len(robot.joints) < 2:
            raise TaskcalError(f"{robot.name} has no second axis; name the joint that has the spring")
        motors = [1] if self.joints is None else self.chosen(robot)
        for motor in motors:
            if robot.prismatic[motor]:
                raise TaskcalError(f"{robot.joint_names[motor]} of {robot.name} slides; a spring turns its axis")

        def turns(path: LoadPath) -> Shaped[np.ndarray, "n p"]:
            angle = path.coordinates[:, motors]
            return np.stack([np.cos(angle), np.sin(angle)], axis=2).reshape(len(angle), -1)

        def turns_by_joint(path: LoadPath) -> Shaped[np.ndarray, "n p joints"]:
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
