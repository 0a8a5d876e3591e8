"""Motion instructions and their targets: which tool goes where, how fast, and whether it stops."""

import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from typing import Any, Literal

import numpy as np
from jaxtyping import Bool, Float, Int

from robot_programs.core.flow import Ordered
from robot_programs.core.form import MoveLine, Ref, Span, Text
from robot_programs.core.interpreter import FoundMotion
from robot_programs.core.program import Motion, MotionFrames, MotionKind, Target, Unresolved, Zone
from robot_programs.core.robot import Robot, arm_bends
from robot_programs.core.source import Place, Source
from robot_programs.rapid.names import ModuleFile, Scope, Value
from robot_programs.rapid.parse import Argument, arguments_of
from robot_programs.rapid.syntax import AggregateText
from robot_programs.rapid.values import (
    MAX_COORDINATE_MM,
    UNIT_TOLERANCE,
    PassedArgument,
    TracedOrigin,
    numbers,
    parts,
    pose_of,
    position,
    quaternion,
)
from taskcal_groundwork import se3
from taskcal_groundwork.errors import FileError

# Configuration data of a RAPID target: quadrants of axes 1, 4 and 6, and which of the eight postures is meant.
#
# Sources: RAPID reference manual 3HAC050917, data type confdata; the eight values of cfx also in
# AXIS_CONFIGURATION.md of CEAD-group/py-opw-kinematics. That robots which cannot bend over backwards, those with a
# parallel rod, have no use for cfx: RobotStudio SDK, Mechanism.UsesCfx and Mechanism.GetAllConfigurationsAsync.

QUADRANT_JOINTS = (0, 3, 5)

EDGE_TOLERANCE_RAD = np.radians(1e-6)
"""This near to the edge of a quadrant either of its neighbours is right, radians."""

MAX_QUADRANT_MISS_RAD = np.radians(45.0)
"""How far axes 1, 4 and 6 may be from their quadrants without the controller stopping, radians."""

POSTURE_TOLERANCE_RAD = np.radians(1.0)
"""Postures of one target differ by far more; its programmed numbers are rounded, so that its joints are not exact, radians."""


@dataclass(frozen=True, kw_only=True)
class Confdata:
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
        """Largest deviation at which the controller still takes the nearest posture, radians."""
        return MAX_QUADRANT_MISS_RAD

    def agrees(self, robot: Robot, q: Float[np.ndarray, "n joints"]) -> Bool[np.ndarray, " n"]:
        """Whether each posture is the one meant; any is, of a robot without six turning joints."""
        return self.miss(robot, q) <= POSTURE_TOLERANCE_RAD

    def miss(self, robot: Robot, q: Float[np.ndarray, "n joints"]) -> Float[np.ndarray, " n"]:
        """Deviation of each posture from the one meant, radians: of axes 1, 4 and 6 the angle to their quadrants.

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
            away = np.maximum(away, np.where(wrong < POSTURE_TOLERANCE_RAD, np.maximum(wrong, 0.0), np.pi + wrong))
        return away

    @classmethod
    def of(cls, robot: Robot, q: Float[np.ndarray, " joints"], like: "Confdata | None" = None) -> "Confdata":
        """The configuration of a posture.

        Args:
            robot: a robot with six joints.
            q: joint positions, radians.
            like: what is kept where the posture is on an edge, or the robot has no use for a value.
        """
        stated = None if like is None else np.array([[like.cf1, like.cf4, like.cf6, like.cfx]])
        return configuration(cls.confdata(robot, q[None], stated)[0])

    @staticmethod
    def confdata(
        robot: Robot, q: Float[np.ndarray, "n joints"], like: Int[np.ndarray, "n 4"] | None
    ) -> Int[np.ndarray, "n 4"]:
        """The numbers of the same for several postures."""
        confdata = np.zeros((len(q), 4), dtype=np.int64) if like is None else like.copy()
        if not _has_configuration(robot):
            return confdata
        turned = q[:, QUADRANT_JOINTS]
        low, high = _quadrant(turned - EDGE_TOLERANCE_RAD), _quadrant(turned + EDGE_TOLERANCE_RAD)
        stays = (low <= confdata[:, :3]) & (confdata[:, :3] <= high) & (like is not None)
        confdata[:, :3] = np.where(stays, confdata[:, :3], high)
        sides = _sides(robot, q)
        if sides is not None:
            bits = np.array([4, 2, 1])
            on_edge = np.abs(sides) < EDGE_TOLERANCE_RAD
            confdata[:, 3] = np.where(on_edge, confdata[:, 3:] & bits, bits * (sides < 0.0)).sum(axis=1)
        return confdata


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


def target_type(kind: MotionKind) -> TargetType:
    """Type of what motions of a kind go to."""
    return "jointtarget" if kind == "axes" else "robtarget"


JOINTS = 6

NO_AXES = (9e9,) * 6
"""External axes of most targets: none is there."""


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class TargetArgument:
    """A target argument: what it means, and where its numbers stand."""

    argument: Span
    """Where the target is written: in the motion, or in the call by which the motion's routine is given it."""
    type: TargetType
    origin: TracedOrigin | None
    """Declaration of its numbers; None where they stand in the argument, or are computed."""
    literal: AggregateText | None
    """What holds its numbers, all of them written out; None where some are computed."""
    file: ModuleFile
    """File of the numbers."""
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
    def shifted(self) -> bool:
        """Whether Offs or RelTool is around it, or it is computed or assigned: its numbers are not those of the literal."""
        return self.base is not None or (self.passed is None and self.origin is None and self.literal is None)

    @property
    def root(self) -> "TargetArgument":
        """Target that is shifted in the end; itself where nothing is."""
        return self if self.base is None else self.base.root

    def carried(self, T_base: Float[np.ndarray, "4 4"]) -> Float[np.ndarray, "4 4"]:
        """Pose that it would have if the target that it shifts were somewhere else."""
        assert self.base is not None
        if not self.along_part:
            return T_base @ se3.inverse(self.base.T) @ self.T
        T = T_base.copy()
        T[:3, 3] += self.T[:3, 3] - self.base.T[:3, 3]
        return T

    def uncarried(self, T: Float[np.ndarray, "4 4"]) -> Float[np.ndarray, "4 4"]:
        """Pose of the target that it shifts for a pose of its own: the inverse of `carried`."""
        assert self.base is not None
        if not self.along_part:
            return T @ se3.inverse(self.T) @ self.base.T
        T_base = T.copy()
        T_base[:3, 3] -= self.T[:3, 3] - self.base.T[:3, 3]
        return T_base

    def target(
        self, T: Float[np.ndarray, "4 4"] | None, near: Place, posture_counts: bool, posture_binds: bool = True
    ) -> Target:
        """Target of a motion, without its posture where the controller is told to ignore that and it is not needed.

        Args:
            T: the pose that is meant; None for joint positions.
            near: place of the motion, in whose line its numbers may stand.
            posture_counts: whether the posture is needed.
            posture_binds: as in `Target`.
        """
        name, source, at = self.origin.name if self.origin else "", self.file.source, self._written
        place = near if near.line == source.line(at) and near.path is source.path else source.place(at)
        if self.type == "jointtarget":
            return Target(name=name, T=None, q=np.radians(self.meant), posture=None, place=place)
        posture = configuration(self.meant[7:]) if posture_counts else None
        return Target(name=name, T=T, q=None, posture=posture, place=place, posture_binds=posture_binds)

    @property
    def _written(self) -> int:
        if self.origin is None or self.origin.symbol.declaration is None:
            return self.argument[1] if self.literal is None else self.literal.start
        return self.origin.symbol.declaration.start if self.literal is None else self.literal.start


def configuration(cf: Iterable[float]) -> Confdata:
    """The configuration that four numbers of confdata state."""
    return _configuration(*map(int, cf))


@lru_cache(maxsize=1024)
def _configuration(cf1: int, cf4: int, cf6: int, cfx: int) -> Confdata:
    return Confdata(cf1=cf1, cf4=cf4, cf6=cf6, cfx=cfx)


def poses_of(targets: Sequence[TargetArgument | None]) -> Iterator[Float[np.ndarray, "4 4"] | None]:
    """The poses that targets mean; None for joint positions, and where there is no target."""
    meant = [t.meant[:7] for t in targets if t is not None and t.type == "robtarget"]
    own = np.array(meant).reshape(-1, 7)
    T = iter(se3.pose(se3.from_quaternion(own[:, [4, 5, 6, 3]]), own[:, :3] / 1e3))
    return (next(T) if t is not None and t.type == "robtarget" else None for t in targets)


def literal_poses(rows: Float[np.ndarray, "n 7"], like: Motion) -> Float[np.ndarray, "n 4 4"] | None:
    """The poses of positions, mm, and quaternions, scalar first; see `LiteralForm.poses`."""
    off = np.abs(np.sqrt((rows[:, 3:] ** 2).sum(axis=1)) - 1.0)
    if not (np.abs(rows[:, :3]).max() <= MAX_COORDINATE_MM and off.max() <= 0.9 * UNIT_TOLERANCE):
        return None
    return se3.pose(se3.from_quaternion(rows[:, [4, 5, 6, 3]]), rows[:, :3] / 1e3)


def target_numbers(value: Value, type_: TargetType, what: str) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """What a target means, and positions of external axes.

    Raises:
        Unresolved: it is no target.
    """
    if type_ == "jointtarget":
        robax, extax = parts(value, 2, what)
        angles = numbers(robax, JOINTS, f"the robot's axes of {what}")
        if not all(abs(a) < 1e5 for a in angles):
            raise Unresolved(f"{what} does not say the position of every axis of the robot")
        return angles, numbers(extax, 6, f"the external axes of {what}")
    trans, rot, conf, extax = parts(value, 4, what)
    cf = numbers(conf, 4, f"the configuration of {what}")
    if not max(map(abs, cf)) < 100:
        raise Unresolved(f"the configuration of {what} is out of any range")
    external = numbers(extax, 6, f"the external axes of {what}")
    meant = (*position(trans, what), *quaternion(rot, what), *cf)
    return meant, NO_AXES if external == NO_AXES else external


# The instructions of RAPID that move the robot to a target, and in which order they are given what they need.
#
# Source: Technical reference manual, RAPID instructions, functions and data types (MoveL, TriggL, SearchL, MoveLDO,
# MoveLSync …); Application manual, Arc and Arc Sensor, and its predecessor (ArcL, ArcC). Seam, weld and weave data
# stand between speed and zone.

_EVERY = frozenset({"conc", "v", "z", "inpos", "wobj", "tload", "noeoffs", "id"})


@dataclass(frozen=True, kw_only=True)
class MotionForm:
    """Form of a motion instruction."""

    kind: MotionKind
    before: int = 0
    """Required arguments before the target."""
    between: tuple[int, ...] = (0,)
    """How many may stand between speed and zone."""
    behind: tuple[int, ...] = (0,)
    """How many may stand behind the tool."""
    has_zone: bool = True
    repeats: bool = True
    """Written several times in a row it does the same as once, but for what the last one does at its end."""
    speed_counts: bool = True
    """The speed is the one given."""
    ends_there: bool = True
    """It ends in its target; a search ends where it finds something."""
    options: frozenset[str] = _EVERY

    @cached_property
    def target(self) -> TargetType:
        """Type of its targets."""
        return target_type(self.kind)

    @cached_property
    def counts(self) -> tuple[int, ...]:
        """Numbers of required arguments that it may have."""
        own = self.before + (self.kind == "circular") + 3 + self.has_zone
        return tuple(own + between + behind for between in self.between for behind in self.behind)


def _family(names: Mapping[str, MotionKind], *, options: str = "", **form: Any) -> dict[str, MotionForm]:
    """Instructions that do something once along the way, with what else is said of their form."""
    own = _EVERY | frozenset(options.split())
    return {name: MotionForm(kind=kind, repeats=False, options=own, **form) for name, kind in names.items()}


_ARC_OPTIONS = _EVERY | {"on", "off", "weave", "seamname", "advanced", *(f"t{k}" for k in range(1, 8))}
_ARC_KINDS: Mapping[str, MotionKind] = {"l": "linear", "c": "circular"}


def _arc_welding() -> dict[str, MotionForm]:
    forms: dict[str, MotionForm] = {}
    for letter, kind in _ARC_KINDS.items():
        for system in ("", "1", "2"):
            for phase in ("", "start", "end"):
                forms[f"arc{letter}{system if not phase else ''}{phase}{system if phase else ''}"] = MotionForm(
                    kind=kind, between=(2, 3), speed_counts=phase == "start", repeats=not phase, options=_ARC_OPTIONS,
                )  # fmt: skip
    return forms


_SPLIT: Mapping[str, MotionKind] = {"movej": "joint", "movel": "linear", "movec": "circular"}

MOTION_FORMS: Mapping[str, MotionForm] = {
    **{name: MotionForm(kind=kind) for name, kind in _SPLIT.items()},
    "moveabsj": MotionForm(kind="axes"),
    **_family(
        {"triggj": "joint", "triggl": "linear", "triggc": "circular"},
        between=(1,), options=" ".join(f"t{k}" for k in range(2, 9)),
    ),
    **_family({f"{name}do": kind for name, kind in _SPLIT.items()}, behind=(2,)),
    **_family({f"{name}ao": kind for name, kind in _SPLIT.items()}, behind=(2,)),
    **_family({f"{name}go": kind for name, kind in _SPLIT.items()}, behind=(1,), options="value dvalue"),
    **_family({f"{name}sync": kind for name, kind in _SPLIT.items()}, behind=(1,)),
    **_family(
        {"searchl": "linear", "searchc": "circular"},
        before=2, options="stop pstop sstop sup flanks posflank negflank highlevel lowlevel", has_zone=False, ends_there=False,
    ),
    **_arc_welding(),
}  # fmt: skip
"""By the keys of their names."""

CHANGED_BY = ("searchl", "searchc")
"""Those that change data they are given: where they found something."""

ONLY_EXTERNAL = "moveextj"
"""Moves external axes alone; the robot stays where it is."""


NAMES: Mapping[MotionKind, str] = {"joint": "MoveJ", "linear": "MoveL", "circular": "MoveC", "axes": "MoveAbsJ"}

MAX_AXIS_POSITION = 1e8
"""Positions of external axes beyond this, usually 9E9, are of axes that are not there."""

_REJECTED_OPTIONS = {
    "t": "\\T gives it a time, which a changed way would not keep",
    "corr": "\\Corr corrects its path at run time",
    "track": "\\Track corrects its path at run time",
    "sync": "\\Sync synchronises it with other motions",
}


@dataclass(frozen=True, eq=False, kw_only=True)
class MotionArguments:
    """The arguments of a motion by their meaning."""

    via: Argument | None
    to: Argument
    speed: Argument
    zone: Argument | None
    """None of a motion that always stops."""
    tool: Argument
    options: Mapping[str, Argument]
    """By name, in lower case."""

    @property
    def behind_to(self) -> int:
        """Position after the target with its options."""
        return self.options["noeoffs"].end if "noeoffs" in self.options else self.to.end

    @property
    def behind_zone(self) -> int:
        """Position after the zone with its options."""
        own = self.tool.start if self.zone is None else self.zone.end
        return max([own, *(self.options[name].end for name in ("z", "inpos") if name in self.options)])


@dataclass(frozen=True, eq=False, kw_only=True)
class MoveInstruction(MoveLine):
    """A motion instruction."""

    name: str
    """The instruction, as it is written."""
    options: frozenset[str]
    """Names of its optional arguments, in lower case."""
    routine: str
    """Name of the one in which it stands."""
    scope: Scope
    """What names mean in it."""
    compact: bool = False
    """It is all that an IF without THEN governs."""
    shared: bool = False
    """On what it depends beside its targets is said where another line says the same."""
    finds: Ref | None = None
    """Data that hold where a search found something."""

    @property
    def key(self) -> str:
        """The instruction, in lower case."""
        return self.name.lower()


@dataclass(frozen=True, eq=False, kw_only=True)
class Settings:
    """Settings that hold throughout a program."""

    postures_off: frozenset[str]
    """Kinds of motion for which the controller is told to take the nearest posture (ConfJ and ConfL)."""
    shift: str
    """Why poses may be shifted; empty if they are not."""
    external_offset: str = ""
    """What shifts external axes, and where; empty if nothing does."""
    soft: str = ""
    """What lets servos give way, and where; empty if nothing does."""
    T_world_base: Float[np.ndarray, "4 4"] | None = None
    """Where the robot stands; None where it stands in the world's origin, as far as the files tell."""
    frames: dict[MotionFrames, MotionFrames] = field(default_factory=dict[MotionFrames, MotionFrames])
    """Frames as the program states them, and counted in the robot's base: made once, so that one frame is one object."""
    notes: dict[str, tuple[ModuleFile, int]] = field(default_factory=dict[str, tuple[ModuleFile, int]])
    """Warnings that came up, each with the file and character where it did first."""
    meanings: dict[tuple[object, ...], int] = field(default_factory=dict[tuple[object, ...], int])
    """As in `Manner`."""
    manners: dict[tuple[object, ...], tuple["Manner", object]] = field(
        default_factory=dict[tuple[object, ...], tuple["Manner", object]]
    )
    """How motions move, by their settings and what these are: those of most lines are alike."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Manner:
    """How a motion moves, wherever it leads."""

    frames: MotionFrames
    stops: bool
    zone: Zone | None
    speed: float | None
    turn_speed: float | None
    divisible: bool
    external_offset: str
    meanings: dict[tuple[object, ...], int]
    """Numbers of all that motions of the program do."""

    @cached_property
    def meaning(self) -> object:
        """Equal for those that do the same."""
        tool, part = self.frames.tool, self.frames.part
        own = (
            tool.name, tool.T.tobytes(), part.name, part.T.tobytes(), self.frames.part_in_hand, self.frames.carrier, self.speed,
            self.turn_speed, self.stops, self.zone,
        )  # fmt: skip
        return self.meanings.setdefault(own, len(self.meanings))


@dataclass(frozen=True, eq=False, kw_only=True, slots=True)
class RapidSite:
    """What the text of a motion means; what comes before it is said by the others."""

    line: MoveInstruction
    file: ModuleFile
    end: TargetArgument
    via: TargetArgument | None
    manner: Manner

    @property
    def text(self) -> Text:
        """Number of the file, and first character."""
        return self.line.at[:2]

    @property
    def layout(self) -> MotionArguments:
        """The arguments by their meaning."""
        return layout(self.line.key, arguments_of(self.file.source, self.line.at[1]))


def layout(key: str, arguments: Sequence[Argument]) -> MotionArguments:
    """The arguments of a motion by their meaning.

    Args:
        key: the instruction, in lower case.
        arguments: what it is given.

    Raises:
        Unresolved: some are missing, or there is one that is not provided for.
    """
    form = MOTION_FORMS[key]
    required = [a for a in arguments if not a.option]
    options: dict[str, Argument] = {}
    for argument in arguments:
        if not argument.option:
            continue
        if argument.option in _REJECTED_OPTIONS:
            raise Unresolved(_REJECTED_OPTIONS[argument.option])
        if argument.option not in form.options or argument.conditional or argument.option in options:
            raise Unresolved(f"its option \\{argument.option} is not provided for")
        options[argument.option] = argument
    if len(required) not in form.counts:
        raise Unresolved(
            f"it has {len(required)} arguments instead of {' or '.join(str(n) for n in sorted(set(form.counts)))}"
        )
    # from the front up to the speed, and from the back to the zone
    behind = max(form.behind)
    own = required[form.before : len(required) - behind] if behind else required[form.before :]
    via = own.pop(0) if form.kind == "circular" else None
    to, speed, tool = own[0], own[1], own[-1]
    zone = own[-2] if form.has_zone else None
    return MotionArguments(via=via, to=to, speed=speed, zone=zone, tool=tool, options=options)


def motion_of(
    one: Ordered[FoundMotion],
    end: Float[np.ndarray, "4 4"] | None,
    via: Float[np.ndarray, "4 4"] | None,
    settings: Settings,
    texts_motions: int,
) -> Motion:
    """A motion whose place among the others is known.

    Args:
        one: as it was found; what is written is its `RapidSite`.
        end: pose of its target; None for joint positions.
        via: pose of its via point; None where it has none.
        settings: of the program.
        texts_motions: how many motions its text stands for.
    """
    found: RapidSite = one.motion.written
    manner, kind = found.manner, MOTION_FORMS[found.line.key].kind
    # where the motion before is not known, the configuration is the best there is even if the controller does not check it
    binds = kind not in settings.postures_off
    counts = binds or one.follows is None
    frames, place = manner.frames, found.file.source.place(found.line.at[1])
    return Motion(
        kind=kind, end=found.end.target(end, place, counts, binds),
        via=found.via.target(via, place, counts) if found.via else None,
        tool=frames.tool, part=frames.part, part_in_hand=frames.part_in_hand, speed=manner.speed,
        turn_speed=manner.turn_speed, divisible=manner.divisible and texts_motions == 1, stops=manner.stops,
        zone=manner.zone, follows=one.follows, begins_at_motion=one.begins_at_motion, texts_motions=texts_motions,
        routine=found.line.routine, place=place, carrier=frames.carrier, external=axes_of(found.end.external),
        external_offset=manner.external_offset,
    )  # fmt: skip


@lru_cache(maxsize=1024)
def axes_of(external: tuple[float, ...]) -> tuple[float, ...]:
    """Positions of external axes; NaN for those that are not there."""
    return tuple([axis if abs(axis) < MAX_AXIS_POSITION else math.nan for axis in external])


def in_base(frames: MotionFrames, settings: Settings) -> MotionFrames:
    """Frames counted in the robot's base: RAPID counts what stands still in the world."""
    if settings.T_world_base is None or (frames.carrier and not frames.part_in_hand):
        return frames
    if frames not in settings.frames:
        T_base_world = se3.inverse(settings.T_world_base)
        if frames.part_in_hand:
            found = replace(frames, tool=replace(frames.tool, T=T_base_world @ frames.tool.T))
        else:
            found = replace(frames, part=replace(frames.part, T=T_base_world @ frames.part.T))
        settings.frames[frames] = found
    return settings.frames[frames]


def speeds(data: Value | None, own: Value | None, *, stated: bool) -> tuple[float | None, float | None]:
    r"""Metres per second, and radians per second of the reorientation (v_ori of the speeddata).

    None where the text does not say, or it is a limit of the robot (vmax).

    Args:
        data: the speeddata; None where it is not known.
        own: value of ``\V``, likewise.
        stated: whether there is a ``\V``.
    """
    speed, degrees, *_ = (*data, None, None) if isinstance(data, tuple) else (None, None)
    speed = own if stated else speed
    return (
        speed / 1e3 if isinstance(speed, float) and 0.0 < speed < 1e8 else None,
        math.radians(degrees) if isinstance(degrees, float) and 0.0 < degrees < 1e8 else None,
    )


def zone_of(data: Value, own: Value | None, *, stated: bool) -> tuple[bool, Zone | None]:
    r"""Whether a motion stops, and how near it passes by its target otherwise.

    The size of the zone for the TCP is also given by ``\Z``. Zones of the reorientation that are smaller are as large
    as that one (Technical reference manual, RAPID, data type zonedata).

    Args:
        data: the zonedata.
        own: value of ``\Z``; None where it is not known.
        stated: whether there is one.

    Raises:
        Unresolved: it is no zonedata.
    """
    stops, *sizes = data if isinstance(data, tuple) and data else (None,)
    if not isinstance(stops, bool):
        raise Unresolved("its zone is not zonedata")
    path = own if stated else sizes[0] if sizes else None
    turn, angle = (sizes[1], sizes[3]) if len(sizes) > 3 else (path, 0.0)
    if not (isinstance(path, float) and isinstance(turn, float) and isinstance(angle, float)):
        return stops, None
    if not (math.isfinite(path) and path >= 0.0 and math.isfinite(turn) and math.isfinite(angle)):
        return stops, None
    return stops, Zone(distance=path / 1e3, turn_distance=max(path, turn) / 1e3, angle=math.radians(max(angle, 0.0)))


# Where the robot of a RAPID program stands: the base frame in ``MOC.cfg``, the motion parameters of a backup.
#
# A section of such a file begins with its name and a colon, ``ROBOT:``; each of its records begins with ``-name``
# and goes on in the next line behind a backslash. ``base_frame_pos_x`` … are metres, ``base_frame_orient_u0`` … a
# quaternion, its scalar first; what is not written keeps its value of zero displacement (Technical reference
# manual, System parameters, type Robot).

SUFFIX = ".cfg"

_DOMAIN = re.compile(r"\ufeff?\s*(\w+):CFG_")
_SECTION = re.compile(r"^(\w+):\s*$", re.MULTILINE)
_NAME = re.compile(r'-name\s+"([^"]*)"')
_NUMBER = re.compile(r"-base_frame_(pos_[xyz]|orient_u[0-3])\s+([^\s\\]+)")
_MOVED_BY = re.compile(r'-base_frame_\w+\s+"([^"]+)"')


def base_frame(source: Source) -> Float[np.ndarray, "4 4"]:
    """Pose of the robot's base in the world.

    Raises:
        FileError: the file holds other parameters, no robot, several that stand in different places, or one that a track
            moves; or a number is not one.
    """
    domain = _DOMAIN.match(source.text)
    if domain is None or domain[1].upper() != "MOC":
        raise FileError(source.path, "holds no motion parameters; of a controller's .cfg files pass MOC.cfg only")
    frames = {name: _frame(record, name, source) for name, record in _robots(source.text)}
    if not frames:
        raise FileError(source.path, "has no robot in its section ROBOT")
    first, *others = frames.values()
    if any(np.abs(other - first).max() > 0.0 for other in others):
        raise FileError(
            source.path,
            f"has robots in different places ({', '.join(frames)}); leave it out and state base in [robot] of the cell file",
        )
    return first


def _robots(text: str) -> list[tuple[str, str]]:
    """Name and text of each record of the section ROBOT."""
    sections = list(_SECTION.finditer(text))
    ends = [*(section.start() for section in sections[1:]), len(text)]
    robots: list[tuple[str, str]] = []
    for section, end in zip(sections, ends, strict=False):  # without a section there is an end all the same
        if section[1].upper() != "ROBOT":
            continue
        body = text[section.end() : end]
        names = list(_NAME.finditer(body))
        behind = [*(name.start() for name in names[1:]), len(body)]
        robots += [(name[1], body[name.start() : at]) for name, at in zip(names, behind, strict=False)]
    return robots


def _frame(record: str, name: str, source: Source) -> Float[np.ndarray, "4 4"]:
    moved_by = _MOVED_BY.search(record)
    if moved_by:
        raise FileError(
            source.path,
            f"says that {moved_by[1]} moves the base of {name}; leave it out and state [robot] base and the [[axis]] that "
            "carries the robot in the cell file",
        )
    values = {"orient_u0": 1.0}
    for key, text in _NUMBER.findall(record):
        try:
            values[key] = float(text)
        except ValueError:
            raise FileError(source.path, f"base_frame_{key} of {name} is '{text}', which is not a number") from None
    xyz = np.array([values.get(f"pos_{axis}", 0.0) for axis in "xyz"])
    wxyz = np.array([values.get(f"orient_u{i}", 0.0) for i in range(4)])
    length = np.linalg.norm(wxyz)
    if not (np.isfinite(xyz).all() and abs(length - 1.0) <= UNIT_TOLERANCE):
        raise FileError(source.path, f"the base frame of {name} is not a pose: its quaternion has length {length:.4g}")
    return se3.pose(se3.from_quaternion(np.array([*wxyz[1:], wxyz[0]]) / length), xyz)
