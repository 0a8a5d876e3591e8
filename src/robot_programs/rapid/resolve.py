"""Motion instructions: which tool goes where, how fast, and whether it stops."""

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from jaxtyping import Float

from robot_programs.core import se3
from robot_programs.core.errors import FileError
from robot_programs.core.program import THROUGH_TARGET, Move, MoveKind, Unresolved, Zone
from robot_programs.core.source import Source
from robot_programs.rapid.names import DATA, File, Scope, Value
from robot_programs.rapid.syntax import Argument, Call, Expression, Instruction, Reference
from robot_programs.rapid.targets import TargetArgument, resolve_target
from robot_programs.rapid.values import Frames, Values, frames_of

# The instructions of RAPID that move the robot to a target, and in which order they are given what they need.
#
# Source: Technical reference manual, RAPID instructions, functions and data types (MoveL, TriggL, SearchL, MoveLDO,
# MoveLSync …); Application manual, Arc and Arc Sensor, and its predecessor (ArcL, ArcC). Seam, weld and weave data
# stand between speed and zone.

_EVERY = frozenset({"conc", "v", "z", "inpos", "wobj", "tload", "noeoffs"})


@dataclass(frozen=True, kw_only=True)
class MotionForm:
    """How a motion instruction is written."""

    kind: MoveKind
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

    def counts(self) -> tuple[int, ...]:
        """How many required arguments it may have."""
        own = self.before + (self.kind == "circular") + 3 + self.has_zone
        return tuple(own + between + behind for between in self.between for behind in self.behind)


def _family(
    names: Mapping[str, MoveKind],
    *,
    before: int = 0,
    between: tuple[int, ...] = (0,),
    behind: tuple[int, ...] = (0,),
    options: str,
    search: bool = False,
) -> dict[str, MotionForm]:
    """Instructions that do something once along the way."""
    return {
        name: MotionForm(
            kind=kind, before=before, between=between, behind=behind, has_zone=not search, ends_there=not search, repeats=False,
            options=_EVERY | frozenset(options.split()),
        )
        for name, kind in names.items()
    }  # fmt: skip


_ARC_OPTIONS = _EVERY | {"on", "off", "weave", "seamname", "advanced", *(f"t{k}" for k in range(1, 8))}
_ARC_KINDS: Mapping[str, MoveKind] = {"l": "linear", "c": "circular"}


def _arc_welding() -> dict[str, MotionForm]:
    forms: dict[str, MotionForm] = {}
    for letter, kind in _ARC_KINDS.items():
        for system in ("", "1", "2"):
            for phase in ("", "start", "end"):
                forms[f"arc{letter}{system if not phase else ''}{phase}{system if phase else ''}"] = MotionForm(
                    kind=kind, between=(2, 3), speed_counts=phase == "start", repeats=not phase, options=_ARC_OPTIONS,
                )  # fmt: skip
    return forms


_SPLIT: Mapping[str, MoveKind] = {"movej": "joint", "movel": "linear", "movec": "circular"}

MOTION_FORMS: Mapping[str, MotionForm] = {
    **{name: MotionForm(kind=kind) for name, kind in _SPLIT.items()},
    "moveabsj": MotionForm(kind="axes"),
    **_family(
        {"triggj": "joint", "triggl": "linear", "triggc": "circular"},
        between=(1,), options=" ".join(f"t{k}" for k in range(2, 9)),
    ),
    **_family({f"{name}do": kind for name, kind in _SPLIT.items()}, behind=(2,), options=""),
    **_family({f"{name}ao": kind for name, kind in _SPLIT.items()}, behind=(2,), options=""),
    **_family({f"{name}go": kind for name, kind in _SPLIT.items()}, behind=(1,), options="value dvalue"),
    **_family({f"{name}sync": kind for name, kind in _SPLIT.items()}, behind=(1,), options=""),
    **_family(
        {"searchl": "linear", "searchc": "circular"},
        before=2, options="stop pstop sstop sup flanks posflank negflank highlevel lowlevel", search=True,
    ),
    **_arc_welding(),
}  # fmt: skip
"""By the keys of their names."""

CHANGED_BY = ("searchl", "searchc")
"""Those that change data they are given: where they found something."""

ONLY_EXTERNAL = "moveextj"
"""Moves external axes alone; the robot stays where it is."""


NAMES: Mapping[MoveKind, str] = {"joint": "MoveJ", "linear": "MoveL", "circular": "MoveC", "axes": "MoveAbsJ"}

NO_AXIS = 1e8
"""Positions of external axes beyond this, usually 9E9, are of axes that are not there."""

_REJECTED_OPTIONS = {
    "t": "\\T gives it a time, which a changed way would not keep",
    "id": "\\ID synchronises it with another robot",
    "corr": "\\Corr corrects its path at run time",
    "track": "\\Track corrects its path at run time",
    "sync": "\\Sync synchronises it with other motions",
}


@dataclass(frozen=True, eq=False, kw_only=True)
class Layout:
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
        """Behind the target with its options."""
        return self.options["noeoffs"].end if "noeoffs" in self.options else self.to.end

    @property
    def behind_zone(self) -> int:
        """Behind the zone with its options."""
        own = self.tool.start if self.zone is None else self.zone.end
        return max([own, *(self.options[name].end for name in ("z", "inpos") if name in self.options)])


@dataclass(frozen=True, eq=False, kw_only=True)
class Motion:
    """A resolved motion with its text."""

    move: Move
    file: File
    instruction: Instruction
    layout: Layout
    end: TargetArgument
    via: TargetArgument | None
    redefined: frozenset[str]
    """Motion instructions whose names the program gives to routines of its own, by key."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Settings:
    """What holds throughout a program."""

    values: Values
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
    frames: dict[Frames, Frames] = field(default_factory=dict[Frames, Frames])
    """Frames as the program states them, and counted in the robot's base: made once, so that one frame is one object."""
    notes: dict[str, tuple[File, int]] = field(default_factory=dict[str, tuple[File, int]])
    """Warnings that came up, each with the file and character where it did first."""


def layout(instruction: Instruction) -> Layout:
    """The arguments of a motion by their meaning.

    Raises:
        Unresolved: some are missing, or there is one that is not provided for.
    """
    arguments = instruction.arguments
    form = MOTION_FORMS[instruction.name.key]
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
    counts = form.counts()
    if len(required) not in counts:
        raise Unresolved(
            f"it has {len(required)} arguments instead of {' or '.join(str(n) for n in sorted(set(counts)))}"
        )
    # from the front up to the speed, and from the back to the zone
    behind = max(form.behind)
    own = required[form.before : len(required) - behind] if behind else required[form.before :]
    via = own.pop(0) if form.kind == "circular" else None
    to, speed, tool = own[0], own[1], own[-1]
    zone = own[-2] if form.has_zone else None
    return Layout(via=via, to=to, speed=speed, zone=zone, tool=tool, options=options)


def resolve(instruction: Instruction, scope: Scope, file: File, settings: Settings, routine: str) -> Motion:
    """A motion with its targets, tool and frame; what comes before it is still to be said.

    Raises:
        Unresolved: the text does not give one of them.
    """
    form = MOTION_FORMS[instruction.name.key]
    kind = form.kind
    values = settings.values
    where = layout(instruction)
    if kind != "axes" and settings.shift:
        raise Unresolved(settings.shift)
    frames = _in_base(_frames(where, scope, file, values), settings)
    type_ = "jointtarget" if kind == "axes" else "robtarget"
    end = resolve_target(where.to, type_, scope, values, file)
    via = resolve_target(where.via, type_, scope, values, file) if where.via else None
    stops, zone = _zone(where, scope, file, settings)
    move = Move(
        kind=kind, end=end.target(True), via=via.target(True) if via else None, tool=frames.tool, part=frames.part,
        part_in_hand=frames.part_in_hand,
        speed=_speed(where, scope, values) if form.speed_counts or "on" in where.options else None,
        turn_speed=_turn_speed(where, scope, values), divisible=form.repeats and not where.options.keys() & {"on", "off"},
        stops=stops, zone=zone, follows=None, routine=routine,
        place=file.source.place(instruction.start), carrier=frames.carrier,
        external=tuple(axis if abs(axis) < NO_AXIS else math.nan for axis in end.external),
        external_offset="" if "noeoffs" in where.options else settings.external_offset,
    )  # fmt: skip
    redefined = frozenset(MOTION_FORMS.keys() & scope.routines.keys())
    return Motion(move=move, file=file, instruction=instruction, layout=where, end=end, via=via, redefined=redefined)


def following(motion: Motion, follows: int | None, settings: Settings, texts_motions: int) -> Motion:
    """A motion whose place among the others is known.

    Args:
        motion: as it was resolved.
        follows: number of the one before; None where that is not known.
        settings: of the program.
        texts_motions: how many motions its text stands for.
    """
    move = motion.move
    # where the motion before is not known, the configuration is the best there is even if the controller does not check it
    binds = move.kind not in settings.postures_off
    counts = binds or follows is None
    move = replace(
        move, end=motion.end.target(counts, binds), via=motion.via.target(counts) if motion.via else None, follows=follows,
        texts_motions=texts_motions, divisible=move.divisible and texts_motions == 1,
    )  # fmt: skip
    return replace(motion, move=move)


def _in_base(frames: Frames, settings: Settings) -> Frames:
    if settings.T_world_base is None:
        return frames
    if frames not in settings.frames:
        settings.frames[frames] = frames.on(settings.T_world_base)
    return settings.frames[frames]


def _frames(where: Layout, scope: Scope, file: File, values: Values) -> Frames:
    tool = _data(where.tool.value, "tool", "tooldata", scope, file, values)
    given = where.options.get("wobj")
    if given is None:
        return frames_of(tool, ("wobj0", DATA["wobj0"][1]))
    return frames_of(tool, _data(given.value, "work object", "wobjdata", scope, file, values))


def _data(
    node: Expression | None, what: str, type_: str, scope: Scope, file: File, values: Values
) -> tuple[str, Value]:
    """Name and value of a tool or a work object."""
    match node:
        case Reference():
            if scope.find(node.name.text) is None:
                raise Unresolved(f"unknown {what} '{node.name.text}'; pass the module that declares it")
            found = values.found(node, scope)
            if found.type != type_:
                raise Unresolved(f"'{node.name.text}' is {found.type}, not {type_}")
            declared = found.origin is not None and found.passed is None
            return file.source.text[node.start : node.end] if declared else found.name, found.value
        case Call():
            raise Unresolved(f"the value of {node.name.text}() is known only at run time")
        case None:
            raise Unresolved(f"the {what} is missing")
        case _:
            return "", values.of(node, scope)


def _speed(where: Layout, scope: Scope, values: Values) -> float | None:
    """Metres per second; None where the text does not say, or it is a limit of the robot (vmax)."""
    given = where.options.get("v")
    try:
        if given is not None and given.value is not None:
            speed = values.number(given.value, scope)
        else:
            data = values.of(where.speed.value, scope) if where.speed.value else None
            speed = data[0] if isinstance(data, tuple) and data else None
    except Unresolved:
        return None
    return speed / 1e3 if isinstance(speed, float) and 0.0 < speed < 1e8 else None


def _turn_speed(where: Layout, scope: Scope, values: Values) -> float | None:
    """Radians per second (v_ori of the speeddata); None where the text does not say."""
    try:
        data = values.of(where.speed.value, scope) if where.speed.value else None
    except Unresolved:
        return None
    degrees = data[1] if isinstance(data, tuple) and len(data) > 1 else None
    return math.radians(degrees) if isinstance(degrees, float) and 0.0 < degrees < 1e8 else None


def _zone(where: Layout, scope: Scope, file: File, settings: Settings) -> tuple[bool, Zone | None]:
    r"""Whether a motion stops, and how near it passes by its target otherwise.

    The size of the zone for the tool point is also given by ``\Z``. Zones of the reorientation that are smaller are as large
    as that one (Technical reference manual, RAPID, data type zonedata).
    """
    if "inpos" in where.options or where.zone is None:
        return True, THROUGH_TARGET
    try:
        data = settings.values.of(where.zone.value, scope) if where.zone.value else None
    except Unresolved as reason:
        note = f"the zone of a motion is not known, which is taken as a stop: {reason}"
        settings.notes.setdefault(note, (file, where.zone.start))
        return True, THROUGH_TARGET
    if not isinstance(data, tuple) or not data or not isinstance(data[0], bool):
        raise Unresolved("its zone is not zonedata")
    try:
        return data[0], _sizes(data, where, scope, settings.values)
    except Unresolved:
        return data[0], None


def _sizes(data: tuple[Value, ...], where: Layout, scope: Scope, values: Values) -> Zone | None:
    r"""Sizes of a zone; None where the text does not tell them.

    Raises:
        Unresolved: ``\Z`` is computed.
    """
    given = where.options.get("z")
    path = data[1] if given is None or given.value is None else values.number(given.value, scope)
    turn, angle = (data[2], data[4]) if len(data) > 4 else (path, 0.0)
    if not (isinstance(path, float) and isinstance(turn, float) and isinstance(angle, float)):
        return None
    if not (math.isfinite(path) and path >= 0.0 and math.isfinite(turn) and math.isfinite(angle)):
        return None
    return Zone(distance=path / 1e3, turn_distance=max(path, turn) / 1e3, angle=math.radians(max(angle, 0.0)))


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

_LENGTH = 0.01
"""How far the length of the quaternion may be from one."""


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
    for section, end in zip(sections, ends, strict=True):
        if section[1].upper() != "ROBOT":
            continue
        body = text[section.end() : end]
        names = list(_NAME.finditer(body))
        behind = [*(name.start() for name in names[1:]), len(body)]
        robots += [(name[1], body[name.start() : at]) for name, at in zip(names, behind, strict=True)]
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
    if not (np.isfinite(xyz).all() and abs(length - 1.0) <= _LENGTH):
        raise FileError(source.path, f"the base frame of {name} is not a pose: its quaternion has length {length:.4g}")
    return se3.pose(se3.from_quaternion(np.array([*wxyz[1:], wxyz[0]]) / length), xyz)
