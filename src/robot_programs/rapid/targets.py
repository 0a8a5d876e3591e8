"""Targets as instructions write them: a name, an inline aggregate, or either with Offs or RelTool around it."""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from jaxtyping import Bool, Float, Int

from robot_programs.core import se3
from robot_programs.core.arm_bends import arm_bends
from robot_programs.core.program import Target, Unresolved
from robot_programs.core.robot import Robot
from robot_programs.rapid.names import File, Scope, Value
from robot_programs.rapid.syntax import Aggregate, Argument, Call, Expression, Number, Reference
from robot_programs.rapid.values import (
    Origin,
    PassedArgument,
    Values,
    numbers,
    parts,
    pose_numbers,
    pose_of,
    position,
    quaternion,
    shifted,
)

# Configuration data of a RAPID target: quadrants of axes 1, 4 and 6, and which of the eight postures is meant.
#
# Sources: RAPID reference manual 3HAC050917, data type confdata; the eight values of cfx also in
# AXIS_CONFIGURATION.md of CEAD-group/py-opw-kinematics. That robots which cannot bend over backwards, those with a
# parallel rod, have no use for cfx: RobotStudio SDK, Mechanism.UsesCfx and Mechanism.GetAllConfigurationsAsync.

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
    return len(robot.joint_names) == 6 and not any(robot.prismatic)


def _sides(robot: Robot, q: Float[np.ndarray, "n 6"]) -> Float[np.ndarray, "n 3"] | None:
    """Angles by which the wrist centre is in front of axis 1 and of the lower arm, and the angle of axis 5, radians.

    None for a robot without a use for cfx: one with a parallel rod, or without the usual arm and wrist.
    """
    bends = arm_bends(robot, q)
    return None if bends is None else np.column_stack([bends, q[:, 4]])


TargetType = Literal["robtarget", "jointtarget"]

JOINTS = 6


@dataclass(frozen=True, eq=False, kw_only=True)
class TargetArgument:
    """A target argument: what it means, and where its numbers stand."""

    argument: Argument
    """Where the target is written: of the motion, or of the call by which the motion's routine is given it."""
    argument_file: File
    type: TargetType
    origin: Origin | None
    """Declaration of its numbers; None where they stand in the argument, or are computed."""
    literal: Aggregate | None
    """What holds its numbers, all of them written out; None where some are computed."""
    file: File
    """File of the numbers."""
    shifted: bool
    """Offs or RelTool is around it, or it is computed or assigned: its numbers are not those of the literal."""
    passed: PassedArgument | None = None
    """How a routine is given it by the call in which the argument stands; None where that is the motion's own."""
    read_at: int = 0
    """First character of what the motion reads of a parameter."""
    base: "TargetArgument | None" = None
    """What Offs or RelTool shifts."""
    along_part: bool = True
    """It is shifted along the axes of the work object (Offs), so that it does not turn with what it shifts."""
    whole: bool = True
    """The argument names all of the target and nothing more, so that another name can take its place."""
    meant: tuple[float, ...]
    """Position in mm, unit quaternion with scalar first, and confdata; or joint positions in degrees: after any shift."""
    external: tuple[float, ...]
    """Positions of external axes, as the program gives them."""

    @property
    def T(self) -> Float[np.ndarray, "4 4"]:
        """The pose that is meant."""
        return pose_of(self.meant[:3], self.meant[3:7])

    @property
    def root(self) -> "TargetArgument":
        """What is shifted in the end; itself where nothing is."""
        return self if self.base is None else self.base.root

    def carried(self, T_base: Float[np.ndarray, "4 4"]) -> Float[np.ndarray, "4 4"]:
        """Where it would be if what it shifts were somewhere else.

        Raises:
            ValueError: it shifts nothing.
        """
        if self.base is None:
            raise ValueError("only a target under Offs or RelTool goes with another one")
        if not self.along_part:
            return T_base @ se3.inverse(self.base.T) @ self.T
        T = T_base.copy()
        T[:3, 3] += self.T[:3, 3] - self.base.T[:3, 3]
        return T

    def target(self, posture_counts: bool, posture_binds: bool = True) -> Target:
        """What a motion goes to; without its posture where the controller is told to ignore that and it is not needed."""
        name, place = self.origin.name if self.origin else "", self.file.source.place(self._written)
        if self.type == "jointtarget":
            return Target(name=name, T=None, q=np.radians(self.meant), posture=None, place=place)
        posture = configuration(self.meant[7:]) if posture_counts else None
        return Target(name=name, T=self.T, q=None, posture=posture, place=place, posture_binds=posture_binds)

    @property
    def _written(self) -> int:
        if self.origin is None or self.origin.symbol.declaration is None:
            return self.argument.start if self.literal is None else self.literal.start
        return self.origin.symbol.declaration.start if self.literal is None else self.literal.start


def configuration(cf: tuple[float, ...]) -> Configuration:
    """The configuration that four numbers of confdata state."""
    cf1, cf4, cf6, cfx = (int(v) for v in cf)
    return Configuration(cf1=cf1, cf4=cf4, cf6=cf6, cfx=cfx)


def resolve_target(argument: Argument, type_: TargetType, scope: Scope, values: Values, file: File) -> TargetArgument:
    """What a target argument means.

    Raises:
        Unresolved: the text does not say.
    """
    if argument.value is None:
        raise Unresolved("the target is missing")
    return _resolve(argument.value, argument, type_, scope, values, file)


def _resolve(
    node: Expression, argument: Argument, type_: TargetType, scope: Scope, values: Values, file: File
) -> TargetArgument:
    match node:
        case Aggregate():
            meant, external = _numbers(values.of(node, scope), type_, "the target")
            return TargetArgument(
                argument=argument, argument_file=file, type=type_, origin=None, literal=_literal(node, type_), file=file,
                shifted=False, meant=meant, external=external,
            )  # fmt: skip
        case Reference():
            return _named(node, argument, type_, scope, values, file)
        case Call() if node.name.key in ("offs", "reltool") and type_ == "robtarget":
            return _shifted(node, argument, scope, values, file)
        case Call():
            raise Unresolved(f"the value of {node.name.text}() is known only at run time")
        case _:
            raise Unresolved(f"the target is not a {type_}")


def _named(
    node: Reference, argument: Argument, type_: TargetType, scope: Scope, values: Values, file: File
) -> TargetArgument:
    """What a name means: declared data, a parameter with the argument that it was given, or what was assigned."""
    found = values.found(node, scope)
    if found.type != type_:
        raise Unresolved(f"'{node.name.text}' is {found.type}, not {type_}")
    meant, external = _numbers(found.value, type_, f"'{found.name}'")
    literal = _literal(found.literal, type_) if isinstance(found.literal, Aggregate) else None
    passed, origin = found.passed, found.origin
    target = TargetArgument(
        argument=argument, argument_file=file, type=type_, origin=origin, literal=literal, file=file,
        shifted=origin is None and literal is None, meant=meant, external=external,
    )  # fmt: skip
    if origin is not None:
        target = replace(target, file=origin.symbol.file or file)
    if passed is None:
        return target
    given = passed.argument.value
    own = len(given.selectors) if isinstance(given, Reference) else 0
    return replace(
        target,
        argument=passed.argument,
        argument_file=passed.file,
        file=passed.file if origin is None else target.file,
        shifted=False,
        passed=passed,
        read_at=node.start,
        whole=not node.selectors and (origin is None or len(origin.selectors) == own),
    )


def _shifted(call: Call, argument: Argument, scope: Scope, values: Values, file: File) -> TargetArgument:
    """What Offs or RelTool makes of a target."""
    required = [a.value for a in call.arguments if not a.option and a.value is not None]
    options = {a.option: a.value for a in call.arguments if a.option and not a.conditional and a.value is not None}
    if len(required) != 4 or len(required) + len(options) != len(call.arguments):
        raise Unresolved(f"{call.name.text}() is not given a target and three distances")
    inner = _resolve(required[0], argument, "robtarget", scope, values, file)
    by = [values.number(node, scope) for node in required[1:]]
    T = shifted(call.name.text, inner.T, by, {name: values.number(node, scope) for name, node in options.items()})
    base = inner
    if (
        inner.passed is not None
    ):  # what the call gives is read for other numbers than these, which the motion has to state
        inner = replace(inner, argument=argument, argument_file=file, origin=None, literal=None, file=file, passed=None)
    meant = (*pose_numbers(T), *inner.meant[7:])
    return replace(
        inner, shifted=True, meant=meant, base=base, along_part=call.name.key == "offs", read_at=required[0].start
    )


def _numbers(value: Value, type_: TargetType, what: str) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Numbers of a target, and of its external axes."""
    if type_ == "jointtarget":
        robax, extax = parts(value, 2, what)
        angles = numbers(robax, JOINTS, f"the robot's axes of {what}")
        if not all(abs(a) < 1e5 for a in angles):
            raise Unresolved(f"{what} does not say the position of every axis of the robot")
        return angles, numbers(extax, 6, f"the external axes of {what}")
    trans, rot, conf, extax = parts(value, 4, what)
    cf = numbers(conf, 4, f"the configuration of {what}")
    if not all(abs(c) < 100 for c in cf):
        raise Unresolved(f"the configuration of {what} is out of any range")
    return (*position(trans, what), *quaternion(rot, what), *cf), numbers(extax, 6, f"the external axes of {what}")


def leaves(literal: Aggregate) -> tuple[Number, ...]:
    """The numbers of a target that is written out, in their order."""
    numbers: list[Number] = []
    for item in literal.items:
        if isinstance(item, Aggregate):
            numbers += leaves(item)
        elif isinstance(item, Number):
            numbers.append(item)
    return tuple(numbers)


def _literal(node: Aggregate, type_: TargetType) -> Aggregate | None:
    shape = (3, 4, 4, 6) if type_ == "robtarget" else (6, 6)
    if len(node.items) != len(shape):
        return None
    for item, count in zip(node.items, shape, strict=True):
        if not isinstance(item, Aggregate):
            return None
        if item.is_plain:
            if len(item.numbers) != count:
                return None
            continue
        if len(item.items) != count or not all(isinstance(leaf, Number) for leaf in item.items):
            return None
    return node
