"""Motion instructions: which tool goes where, how fast, and whether it stops."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from jaxtyping import Float

from taskcal.programs.program import Move, MoveKind
from taskcal.programs.rapid.frames import Frames, frames_of
from taskcal.programs.rapid.motion_forms import MOTION_FORMS
from taskcal.programs.rapid.names import File, Scope
from taskcal.programs.rapid.predefined import DATA, Value
from taskcal.programs.rapid.syntax import Argument, Call, Expression, Instruction, Reference
from taskcal.programs.rapid.target_argument import TargetArgument, resolve_target
from taskcal.programs.rapid.values import Values
from taskcal.programs.unresolved import Unresolved
from taskcal.programs.zone import THROUGH_TARGET, Zone

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
            declared = found.origin is not None and found.handed is None
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
