"""What URScript's data and motions mean: what variables hold before they are set, and what motion a call is."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

import numpy as np
from jaxtyping import Float

from robot_programs.core.form import Expression, Key, Op, Ref, Text
from robot_programs.core.interpreter import FoundMotion, LanguageMeaning
from robot_programs.core.program import Frame, Motion, MotionKind, NearPosture, Target, Unresolved, Waypoint, Zone
from robot_programs.core.robot import JOINTS, Robot
from robot_programs.core.source import Source
from robot_programs.core.values import Lost, Origin, Structure
from robot_programs.urscript.lower import FEATURE, MOTIONS, POINTS, LoweredUrscript, MotionCall
from robot_programs.urscript.values import (
    IN_FEATURE,
    INVERSE,
    LIST,
    POSE,
    Six,
    Whole,
    featured,
    is_number,
    matrix,
    numbers,
    of_kind,
    operate,
    posed,
    six_of,
    takes_unknown,
)
from taskcal_groundwork import se3

DEFAULT_SPEED_M_S = 0.25
"""Of movel, movep and movec, metres per second."""

MIN_ARC_SINE = 1e-6
"""Of the angle between an arc's chords, below which they are one line; points have some micrometres."""

DEFAULT_TCP = "TCP"
"""What PolyScope calls the first TCP of an installation; a cell file calls so what set_tcp is given as numbers."""
NO_TOOL = Frame(name="", T=np.eye(4))

_UNSET = Lost(reason="is not known: it is not set before")
_ARGUMENT = Lost(reason="is given where it is called, and not known there")
_TCP = Lost(reason="is not known")


@dataclass(frozen=True, kw_only=True, slots=True)
class Feature:
    """A variable that moved a target, with the pose that it held."""

    name: str
    key: Key
    frame: Six

    @staticmethod
    def of(found: Structure) -> "Feature":
        """The feature of a pose; see `values.featured`."""
        return Feature(**{name: found.part(name) for name in ("name", "key", "frame")})


@dataclass(frozen=True, eq=False, kw_only=True)
class WrittenTarget:
    """A target of a motion as it is written."""

    slot: Expression
    """What stands for it in the motion, inside of ``get_inverse_kin`` and ``pose_trans``."""
    framed: bool
    """The slot counts in the feature, which the motion names."""
    named: bool
    """The feature is what its variable holds where the motion stands."""
    literal: Origin | None
    """The numbers that state it, in the motion or elsewhere, in the feature if it has one; None where it is computed."""
    values: Six
    joints: bool
    feature: Feature | None
    """The variable that is its part's frame, and the pose that this holds."""
    T: Float[np.ndarray, "4 4"]
    """Its part's frame in the base, as it was read."""
    turns: bool = True
    """The tool gets the orientation that the numbers state."""

    def wanted(self, waypoint: Waypoint) -> Six:
        """Numbers for a waypoint, in the feature or in the base."""
        if self.joints:
            return tuple(float(angle) for angle in waypoint.q)
        assert waypoint.T is not None
        return six_of(waypoint.T if self.feature else self.T @ waypoint.T, self.values)


def slot_of(argument: Expression) -> tuple[Expression, bool]:
    """What stands for a target in a motion's argument, and whether it is moved by a feature that is named there."""
    while isinstance(argument, Op) and argument.sign == "get_inverse_kin" and argument.operands:
        argument = argument.operands[0]
    if isinstance(argument, Op) and argument.sign == IN_FEATURE:
        return argument.operands[2], True
    return argument, False


@dataclass(frozen=True, eq=False, kw_only=True)
class UrscriptSite:
    """A motion's place in the text."""

    line: MotionCall
    points: tuple[WrittenTarget, ...]

    @property
    def file(self) -> int:
        """Number of the file."""
        return self.line.at[0]

    @property
    def text(self) -> Text:
        """Number of the file, and first character."""
        return self.line.at[:2]


def _is(value: Structure, frame: Six) -> bool:
    """Whether a pose is one of some numbers."""
    return value.kind == POSE and tuple(value.parts.get(k) for k in range(6)) == frame


@dataclass(eq=False, kw_only=True)
class UrscriptMeaning(LanguageMeaning):
    """Data and motions of a program."""

    PASSES: ClassVar = 30
    SET: ClassVar = "is set in the program, to what is known only at run time"
    UNSEEN: ClassVar = "is set in a thread"

    sources: Sequence[Source]
    program: LoweredUrscript
    robot: Robot | None
    part: Frame
    """Of motions that name no feature."""
    made: dict[tuple[str, Six], Frame] = field(default_factory=dict[tuple[str, Six], Frame])
    shifted: set[MotionCall] = field(default_factory=set[MotionCall])
    """Motions where something may move the tool away from its target."""
    arguments: frozenset[Key] = field(init=False)

    def __post_init__(self) -> None:
        self.arguments = frozenset(key for routine in self.program.routines for key in routine.parameters)

    # Data.

    def declared(self, key: Key) -> Any:
        """Nothing moves the tool away from its targets; nothing else is known before it is set."""
        if any(key == mode.key for mode in self.program.modes):
            return False
        return _TCP if key == "the TCP" else _ARGUMENT if key in self.arguments else _UNSET

    def part_names(self, value: Structure, indices: Sequence[float]) -> Sequence[Any]:
        """The number of an element, from 0."""
        (index,) = indices
        if value.kind not in (LIST, POSE) or not isinstance(index, Whole) or index < 0:
            raise Unresolved("an element of a list is not known")
        return (int(index),)

    def blank(self, key: Key, names: Sequence[Any], lost: Lost) -> Any:
        """What is not known stays so if an element of it is set."""
        return lost

    def coerced(self, key: Key, value: Any) -> Any:
        """Variables hold whatever they are given."""
        return value

    def called(self, ref: Ref, indices: Sequence[float]) -> str:
        """Name of a datum with its indices, for messages."""
        return super().called(ref, indices) if indices else ref.name

    def takes_unknown(self, sign: str) -> bool:
        """Whether what is not known may still decide something."""
        return takes_unknown(sign)

    def operate(self, sign: str, values: Sequence[Any]) -> Any:
        """Value of an operator, or of a function of the language; those of the robot's kinematics are here."""
        match sign, values:
            case "set_tcp", [pose, name]:
                return self._tcp(pose, name)
            case "get_forward_kin", [q, tcp]:
                return self._forward_kin(q, tcp)
            case _:
                return operate(sign, values)

    def _tcp(self, pose: Any, name: Any) -> Frame:
        values = None if isinstance(pose, Lost) else numbers(pose)
        if values is None:
            why = pose.reason if isinstance(pose, Lost) else "it is given no pose"
            raise Unresolved(f"set_tcp before it sets a TCP that is not known: {why}")
        return self.frame(name if isinstance(name, str) else DEFAULT_TCP, values)

    def _forward_kin(self, q: Any, tcp: Any) -> Structure:
        joints = None if isinstance(q, Lost) or not of_kind(q, LIST) else numbers(q)
        if joints is None:
            raise Unresolved(q.reason if isinstance(q, Lost) else "get_forward_kin is not given six joint positions")
        if not isinstance(tcp, Frame):
            raise Unresolved("the TCP of get_forward_kin is not known")
        T = self.forward(joints, tcp)
        if T is None:
            raise Unresolved("get_forward_kin needs the robot's kinematics")
        return posed(six_of(T))

    def frame(self, name: str, values: Six) -> Frame:
        """A frame, made once."""
        key = name, values
        if key not in self.made:
            self.made[key] = Frame(name=name, T=matrix(values))
        return self.made[key]

    def forward(self, q: Six, tool: Frame) -> Float[np.ndarray, "4 4"] | None:
        """Pose of a tool in the base; None without a robot of six joints."""
        if self.robot is None or len(self.robot.joint_names) != JOINTS:
            return None
        return self.robot.tool_poses(np.array([q]))[0] @ se3.inverse(self.robot.T_flange_tool) @ tool.T

    # Motions.

    def incomplete(self, line: Any, why: Unresolved, settings: Mapping[str, Any]) -> Unresolved:
        """What is said of a motion with a point that is not known: first of all that it may lead elsewhere."""
        try:
            self._expect_steady(line, settings)
        except Unresolved as other:
            return other
        return why

    def _expect_steady(self, line: MotionCall, settings: Mapping[str, Any]) -> None:
        for mode in self.program.modes:
            on = settings.get(mode.name, False)
            if on is not False:
                self.shifted.add(line)
                what = f"{mode.name} {'is' if on is True else 'may be'} on"
                raise Unresolved(f"{what}, which moves the tool away from its target")

    def motion(self, line: Any, points: Sequence[Any], settings: Mapping[str, Any]) -> FoundMotion:
        """The motion of a call."""
        self._expect_steady(line, settings)
        assert isinstance(line, MotionCall)
        kind, _ = MOTIONS[line.name]
        mode = settings.get("mode", Whole(0))
        if not isinstance(mode, Whole) or mode not in (0, 1):
            raise Unresolved("its mode is neither 0 nor 1, as far as the text tells")
        tool = settings["tcp"]
        needed = [line.given[name] for name in POINTS[line.name]]
        found = [self._target(line, one, value, settings, kind) for one, value in zip(needed, points, strict=True)]
        (end, point), (via, _) = found[-1], found[0]
        if kind == "circular" and mode == 1:
            end = self._turned(end, via, self._part(point.feature).T, tool, settings["before"])
            point = replace(point, turns=False)
            found[-1] = end, point
        radius, time, speed = (
            float(value) if is_number(value := settings.get(name, default)) else None
            for name, default in (("r", 0.0), ("t", 0.0), ("v", DEFAULT_SPEED_M_S))
        )
        motion = Motion(
            kind="axes" if end.q is not None else kind,
            end=end,
            via=via if kind == "circular" else None,
            tool=tool if isinstance(tool, Frame) else NO_TOOL,
            part=self._part(point.feature),
            part_in_hand=False,
            speed=speed if kind in ("linear", "circular") and end.q is None and time == 0.0 and speed else None,
            stops=radius is not None and radius <= 0.0,
            zone=None if radius is None else Zone(distance=max(radius, 0.0), turn_distance=max(radius, 0.0)),
            follows=None,
            routine=line.scope.unit.name,
            place=self.sources[line.at[0]].place(line.at[1]),
            divisible=time == 0.0,
        )
        own = tuple(one for _, one in found)
        bits = b"" if point.turns or end.T is None else end.T.tobytes()
        meaning = (
            *((one.literal, one.values, one.feature) for one in own), motion.tool, motion.speed, motion.zone, motion.divisible,
            str(end.posture), bits,
        )  # fmt: skip
        return FoundMotion(motion=motion, written=UrscriptSite(line=line, points=own), meaning=meaning)

    def _part(self, feature: Feature | None) -> Frame:
        return self.part if feature is None else self.frame(feature.name, feature.frame)

    def _target(
        self, line: MotionCall, written: Any, value: Any, settings: Mapping[str, Any], kind: MotionKind
    ) -> tuple[Target, WrittenTarget]:
        """Target of a motion, and where the text states it."""
        tool, (slot, framed) = settings["tcp"], slot_of(written)
        name = slot.name if isinstance(slot, Ref) and not any(isinstance(step, tuple) for step in slot.path) else ""
        place = self.sources[line.at[0]].place(written.at[1])
        posture = None
        if of_kind(value, INVERSE):
            near, value = value.part("near"), value.part("pose")
            # a line keeps the posture in which it begins
            posture = NearPosture(q=np.array(near)) if isinstance(near, tuple) and kind == "joint" else None
        values = numbers(value)
        if values is None:
            raise Unresolved("its target is neither a pose nor six joint positions")
        moved = featured(value) if value.kind == POSE else None
        feature = None if moved is None else Feature.of(moved)
        held = settings.get("" if feature is None else FEATURE.format(feature.name))
        point = WrittenTarget(
            slot=slot, framed=framed and value.kind == POSE, literal=value.origin, joints=value.kind == LIST,
            named=framed or (feature is not None and isinstance(held, Structure) and _is(held, feature.frame)),
            values=values if moved is None else moved.part("stated"), feature=feature, T=self._part(feature).T,
        )  # fmt: skip
        if point.joints and kind == "joint":
            return Target(name=name, T=None, q=np.array(values), posture=None, place=place), point
        if not isinstance(tool, Frame):
            assert isinstance(tool, Lost)
            raise Unresolved(tool.reason if tool.told else f"the TCP {tool.reason}")
        T = self.forward(values, tool) if point.joints else matrix(point.values)
        if T is None:
            raise Unresolved("its target is joint positions, whose pose follows from the robot's kinematics")
        posture = NearPosture(q=np.array(values)) if point.joints else posture
        T = T if feature is not None else se3.inverse(self.part.T) @ T
        return Target(name=name, T=T, q=None, posture=posture, posture_binds=False, place=place), point

    def _turned(self, end: Target, via: Target, T_base_part: np.ndarray, tool: Frame, found: Any) -> Target:
        """End of an arc along which the tool keeps its angle to the path (Script manual, movec: mode 1).

        Raises:
            Unresolved: it is not known in which pose it begins, or its points lie on a line.
        """
        before = found.motion if isinstance(found, FoundMotion) else None
        assert end.T is not None
        assert via.T is not None
        if before is None or before.end.T is None or before.tool is not tool:
            raise Unresolved(
                "its mode is 1, by which the tool turns with the arc, and the pose in which it begins is not known"
            )
        start, (last, middle) = before.part.T @ before.end.T, T_base_part @ np.stack([end.T, via.T])
        u, w = middle[:3, 3] - start[:3, 3], last[:3, 3] - middle[:3, 3]
        normal = np.cross(u, w)
        size = float(np.linalg.norm(normal))
        if size < MIN_ARC_SINE * np.linalg.norm(u) * np.linalg.norm(w) or not size:
            raise Unresolved("its mode is 1, by which the tool turns with the arc, and its points lie on a line")
        # the arc is twice the angle by which its chords turn (inscribed angle)
        last[:3, :3] = se3.exp(normal / size * 2.0 * np.arctan2(size, u @ w)) @ start[:3, :3]
        return replace(end, T=se3.inverse(T_base_part) @ last)
