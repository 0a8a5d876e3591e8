"""What TP's data and motions mean: positions, registers and frames, and the motion that an instruction makes of them."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, Literal

import numpy as np
from jaxtyping import Float

from robot_programs.core.form import Key
from robot_programs.core.interpreter import FoundMotion, LanguageMeaning
from robot_programs.core.program import (
    Cause,
    Frame,
    MissingKind,
    Motion,
    NearPosture,
    Posture,
    Target,
    Unresolved,
    angled_pose,
)
from robot_programs.core.robot import NO_ROBOT, Robot
from robot_programs.core.source import Place, Source
from robot_programs.core.values import Lost, Origin, Settable, Structure, is_settable, operated
from robot_programs.tp.listing import (
    JOINTS,
    POSE,
    ROBOT_GROUP,
    Configuration,
    Listing,
    Position,
    Register,
    Variables,
)
from robot_programs.tp.lower import ACTIVE, KINDS, RUN_TIME, SET, MotionInstruction, NamedPosition, spelled
from robot_programs.tp.rewrite import Shifts, TpSite, WrittenPosition
from taskcal_groundwork import se3
from taskcal_groundwork.errors import InputError

# User frames and tools by number: from a backup's variables, given with the program, or set by it.

MIN_SINE = 1e-6
"""Sine of the angle between two axes below which they are parallel."""


def world_in_base(robot: Robot) -> Float[np.ndarray, "4 4"]:
    """FANUC's world frame in the robot's base: on axis 1, at the height of axis 2, turned like the base.

    That is the frame from which ROS-Industrial's descriptions of FANUC's robots count the manufacturer's coordinates, too.

    Raises:
        InputError: axes 1 and 2 do not cross, so that there is no such place.
    """
    if len(robot.joint_names) < 2 or any(robot.prismatic[:2]):
        raise InputError(f"{robot.name} has no two turning axes at its base, where FANUC's world frame would be")
    first, second = robot.joint_frames(np.zeros((1, len(robot.joint_names))))[0, :2]
    common = np.cross(first[:3, 2], second[:3, 2])
    if np.linalg.norm(common) < MIN_SINE:
        raise InputError(
            f"axes 1 and 2 of {robot.name} are parallel; FANUC's world frame of such an arm is not known here"
        )
    # along axis 1 to the foot of the line that is perpendicular to both axes
    between = second[:3, 3] - first[:3, 3]
    along = np.linalg.det(np.stack([between, second[:3, 2], common])) / (common @ common)
    return se3.pose(np.eye(3), first[:3, 3] + along * first[:3, 2])


FrameKind = Literal["UFRAME", "UTOOL"]
KINDS_OF_FRAMES: tuple[FrameKind, FrameKind] = ("UTOOL", "UFRAME")
_STATED_AS: Mapping[FrameKind, tuple[str, MissingKind]] = {"UTOOL": ("--tool", "tool"), "UFRAME": ("--part", "part")}
"""Option and section of the cell file by which one is given."""
Literals = tuple[float, float, float, float, float, float]
"""X Y Z W P R to which a program has set a frame, millimetres and degrees."""


@dataclass(frozen=True, eq=False, kw_only=True)
class GivenFrames:
    """Frames that are given beside the files."""

    named: Mapping[str, Frame] = field(default_factory=dict[str, Frame])
    """By name: ``UFRAME 1``, ``UTOOL 2``; others are of no number."""
    alone: Frame | None = None
    """For the one number that nothing states; None where there are several."""

    def of(self, kind: FrameKind, number: int) -> Frame | None:
        """The frame with a number by its name, if there is one."""
        return next((frame for name, frame in self.named.items() if _numbered(name) == (kind, number)), None)


def _numbered(name: str) -> tuple[str, int] | None:
    """Kind and number by which a frame is named; None where it has a name of its own."""
    match = _NUMBERED.fullmatch(name)
    return None if match is None else (match["kind"].upper(), int(match["number"]))


_NUMBERED = re.compile(r"(?P<kind>UFRAME|UTOOL)[ _]?\[?(?P<number>\d{1,3})\]?", re.IGNORECASE)


@dataclass(frozen=True, eq=False, kw_only=True)
class ProgramFrames:
    """Frames of a program; each is made once, so that one frame is one object."""

    variables: Variables
    T_base_world: Float[np.ndarray, "4 4"]
    tools: GivenFrames
    """Tools that the variables do not state."""
    parts: GivenFrames
    """User frames that the variables do not state; in the world."""
    made: dict[tuple[str, int, Literals | Lost | None], Frame] = field(
        default_factory=dict[tuple[str, int, "Literals | Lost | None"], Frame]
    )
    alone: dict[FrameKind, set[int]] = field(default_factory=lambda: {"UFRAME": set[int](), "UTOOL": set[int]()})
    """Numbers for which the frame for one number was taken."""

    def user_frame(self, number: int, own: Literals | Lost | None = None) -> Frame:
        """A user frame, in the base.

        Args:
            number: its number.
            own: what the program has set it to; None where it has not.

        Raises:
            Unresolved: it is not known.
        """
        if ("UFRAME", number, own) not in self.made:
            frame = self._stated("UFRAME", number, own, self.variables.frames, self.parts)
            self.made["UFRAME", number, own] = replace(frame, T=self.T_base_world @ frame.T)
        return self.made["UFRAME", number, own]

    def tool_frame(self, number: int, own: Literals | Lost | None = None) -> Frame:
        """A tool, in the flange; see `user_frame`.

        Raises:
            Unresolved: it is not known.
        """
        if ("UTOOL", number, own) not in self.made:
            self.made["UTOOL", number, own] = self._stated("UTOOL", number, own, self.variables.tools, self.tools)
        return self.made["UTOOL", number, own]

    def _stated(
        self,
        kind: FrameKind,
        number: int,
        own: Literals | Lost | None,
        stated: Mapping[int, Float[np.ndarray, "4 4"]],
        given: GivenFrames,
    ) -> Frame:
        if isinstance(own, Lost):
            raise Unresolved(Cause(f"{kind}[{number}] {own.reason}", of=[own.reason]))
        if own is not None:
            x, y, z, w, p, r = own
            return Frame(name=f"{kind} {number}", T=angled_pose(x, y, z, r, p, w))
        T = np.eye(4) if number == 0 else stated.get(number)
        if T is not None:
            return Frame(name=f"{kind} {number}", T=T)
        named = given.of(kind, number)
        if named is not None:
            return named
        self.alone[kind].add(number)
        if given.alone is not None:
            return given.alone
        option, section = _STATED_AS[kind]
        text = (
            f"{kind} {number} is not known; pass the backup's sysframe.va with the program, or state it in the cell file: "
            f'[[{section}]] name = "{kind} {number}", controller = …, or name one of the cell file where the files have no other '
            f"such number ({option})"
        )
        raise Unresolved(Cause(text, (f"{kind} {number}", section)))


def frames_by_number(named: Mapping[str, Frame], alone: Frame | None) -> GivenFrames:
    """Frames by name, and one that stands for one number: for that in its name, where it has one."""
    if alone is None or _numbered(alone.name) is None:
        return GivenFrames(named=named, alone=alone)
    return GivenFrames(named={**named, alone.name: alone})


SAME_FRAME = 1e-5
"""Two statements of a frame agree if they differ by no more, metres and entries of the rotation."""


def check_given(frames: ProgramFrames) -> None:
    """See that no frame is given otherwise than the files of variables state it.

    Raises:
        InputError: one is.
    """
    kinds = zip(
        KINDS_OF_FRAMES, (frames.tools, frames.parts), (frames.variables.tools, frames.variables.frames), strict=True
    )
    for kind, given, stated in kinds:
        numbers = [numbered for name in given.named if (numbered := _numbered(name)) is not None]
        if len(set(numbers)) < len(numbers):
            twice = max(numbers, key=numbers.count)
            raise InputError(f"{twice[0]} {twice[1]} is given twice, by different names; keep one of them")
        for name, frame in given.named.items():
            numbered = _numbered(name)
            T = None if numbered is None or numbered[0] != kind else {0: np.eye(4), **stated}.get(numbered[1])
            if T is not None and np.abs(T - frame.T).max() > SAME_FRAME:
                off = np.linalg.norm(T[:3, 3] - frame.T[:3, 3]) * 1e3
                raise InputError(
                    f"the files have {kind} {numbered[1] if numbered else ''} {off:.3f} mm from where '{name}' is given, "
                    "or turned otherwise; leave it out (controller of the cell file), as the files declare it"
                )


# Data and motions.

TURN_TOLERANCE = 1e-9
"""Entries of the rotation of a register that only shifts."""

_UNTOUCHED = "as the controller has it"
"""Value of frames that a program does not set."""
_SET_OTHERWISE = Lost(reason=SET)
_NO_POSITION = Lost(reason="has no position of group 1 in /POS")
_NO_REGISTER = Lost(reason="is not known; pass the backup's posreg.va with the program")

# Kinds of structures: "array", elements by number; "P", a position; "PR", a register; "components", components by number of a
# register, of which it is not known whether they are of a pose or of joints.


def _array(elements: Mapping[Any, Any], rest: Any) -> Structure:
    return Structure(kind="array", parts=elements, rest=rest)


def literals_of(register: Any) -> Literals | None:
    """X Y Z W P R of a register, millimetres and degrees; None where they are not known, or it has joints."""
    if not isinstance(register, Structure):
        return None
    names = range(1, 7) if register.kind == "components" else POSE
    values = [register.parts.get(name) for name in names]
    if not all(isinstance(value, float) for value in values):
        return None
    x, y, z, w, p, r = (float(value) for value in values if value is not None)
    return x, y, z, w, p, r


@dataclass(eq=False, kw_only=True)
class TpMeaning(LanguageMeaning):
    """Data and motions of the listings of a program."""

    PASSES: ClassVar = 20
    SET: ClassVar = SET
    kept = ("PR",)

    sources: Sequence[Source]
    listings: Mapping[int, Listing]
    """By numbers of the files."""
    frames: ProgramFrames
    robot: Robot
    known: dict[Key, Any] = field(default_factory=dict[Key, Any])
    """What is declared, made once."""

    # Data.

    def declared(self, key: Key) -> Any:
        """Positions of a listing, registers and frames of the backup; nothing else is declared."""
        if key not in self.known:
            self.known[key] = self._declared(key)
        return self.known[key]

    def _declared(self, key: Key) -> Any:
        match key:
            case ("P", int() as file):
                positions = self.listings[file].positions
                return _array({n: self._position(file, one) for n, one in positions.items()}, _NO_POSITION)
            case "PR":
                registers = self.frames.variables.registers
                return _array({number: _backed_up(register) for number, register in registers.items()}, _NO_REGISTER)
            case "R":
                return _array({}, Lost(reason=RUN_TIME))
            case "UFRAME" | "UTOOL":
                return _array({}, _UNTOUCHED)
            case "UFRAME_NUM" | "UTOOL_NUM":
                return Lost(reason="is not known where the program begins")
            case _:
                return Lost(reason="is given where the program is called")

    def _position(self, file: int, position: Position) -> Structure | Lost:
        group = position.groups.get(ROBOT_GROUP)
        if group is None:
            return _NO_POSITION
        try:
            group.check()
        except Unresolved as reason:
            return Lost(reason=f"in line {self.sources[file].line(position.start)} {reason}")
        parts: dict[Any, Any] = {"CONFIG": group.configuration}
        for name, component in group.components.items():
            unusable = component.value is None or (component.millimetres and name in JOINTS)
            parts[name] = Lost(reason=f"does not state {name}") if unusable else component.value
        if position.external:
            parts["EXT"] = 0.0
        origin = Origin(at=(file, position.start, position.end), owner=("P", file), path=(position.number,))
        return Structure(kind="P", parts=parts, origin=origin)

    def part_names(self, value: Structure, indices: Sequence[float]) -> Sequence[Any]:
        """The number of an element, and the name of a component of it."""
        if not all(index.is_integer() for index in indices):
            raise Unresolved(f"an index is {indices[0]:g}, which is no whole number")
        number, *component = (int(index) for index in indices)
        if not component:
            return (number,)
        element = value.part(number)
        names = next(
            (names for names in (POSE, JOINTS) if isinstance(element, Structure) and names[0] in element.parts), None
        )
        if names is None:
            return number, component[0]
        if not 1 <= component[0] <= len(names):
            raise Unresolved(f"the component {component[0]} of a position is not followed")
        return number, names[component[0] - 1]

    def blank(self, key: Key, names: Sequence[Any], lost: Lost) -> Any:
        """A register of which nothing is known, by its components."""
        return Structure(kind="components", parts={}, rest=lost) if key == "PR" else lost

    def coerced(self, key: Key, value: Any) -> Any:
        """A register keeps the numbers of a position, not its frames; positions that are set are not followed."""
        match key:
            case "PR" if isinstance(value, Structure) and value.kind == "P":
                return replace(value, kind="PR", origin=None)
            case "PR" if isinstance(value, float) or (isinstance(value, Structure) and value.kind != "array"):
                return value
            case "R" if isinstance(value, float):
                return value
            case "UFRAME" | "UTOOL" if literals_of(value) is not None:
                return value
            case "UFRAME_NUM" | "UTOOL_NUM" if isinstance(value, float) and value.is_integer():
                return value
            case _:
                return _SET_OTHERWISE

    def operate(self, sign: str, values: Sequence[Any]) -> Any:
        """Value of an operator; DIV and MOD are those of natural numbers."""
        if sign in ("div", "mod") and all(isinstance(v, float) and v >= 0.0 and v.is_integer() for v in values):
            own = {("div", 2): lambda a, b: a // b, ("mod", 2): lambda a, b: a % b}
            return operated(sign, values, own)
        return operated(sign, values)

    def computed_index(self, name: str, why: Unresolved) -> Unresolved:
        """What is said where the number of a position is not known."""
        return Unresolved(f"the {name} index is computed at run time; use a constant index")

    # Motions.

    def motion(self, line: Any, points: Sequence[Any], settings: Mapping[str, Any]) -> FoundMotion:
        """The motion of an instruction, with its positions as they are written."""
        assert isinstance(line, MotionInstruction)
        file, source = line.at[0], self.sources[line.at[0]]
        active = {name: int(v) if isinstance(v := settings[name], float) else None for name in ACTIVE}
        offset = self._offset(line, settings)
        # of a computed index, the motion is known only if that is
        operands = [
            operand if operand.number is not None else replace(operand, number=int(settings[f"index {k}"]))
            for k, operand in enumerate(line.operands)
        ]
        written = tuple(
            self._written(file, operand, point, active, offset) for operand, point in zip(operands, points, strict=True)
        )
        if len({one.numbers for one in written}) > 1:
            raise Unresolved("its two positions count from different frames")
        frame, tool = self._frames(written[-1].numbers, settings)
        targets = [self._target(one, line, tool, frame, source) for one in written]
        end, kind = targets[-1], KINDS[line.keyword]
        stated = settings.get("speed")
        along = stated * line.speed_unit if isinstance(stated, float) and line.speed_unit is not None else 0.0
        position = written[-1].position
        motion = Motion(
            kind="axes" if kind == "joint" and end.T is None else kind,
            end=end,
            via=targets[0] if len(targets) > 1 else None,
            tool=tool,
            part=frame,
            speed=along if along > 0.0 else None,
            turn_speed=line.turn_speed,
            stops=line.stops,
            zone=line.zone,
            routine=self.listings[file].name,
            place=source.place(line.keyword_at),
            external=() if position is None else position.external_positions(),
        )
        numbers = [bits.tobytes() for one in targets for bits in (one.T, one.q) if bits is not None]
        stands = [one.start if one.position is not None else (one.numbers, one.stated.configuration) for one in written]
        set_frames = [settings[key].part(n) for key, n in zip(("UFRAME", "UTOOL"), written[-1].numbers, strict=True)]
        shifts = [settings[setting] for _, setting in line.offsets]
        site = TpSite(
            file=file,
            listing=self.listings[file],
            motion=line,
            written=written,
            from_memory=any(map(is_settable, (*points, *shifts, *set_frames))),
        )
        return FoundMotion(motion=motion, written=site, meaning=(*numbers, *stands, frame, tool, motion.speed))

    def _offset(self, line: MotionInstruction, settings: Mapping[str, Any]) -> Shifts:
        """Shifts in the user frame and in the tool.

        Raises:
            Unresolved: one is not known, or turns.
        """
        shifts = {"Offset": np.eye(4), "Tool_Offset": np.eye(4)}
        for kind, setting in line.offsets:
            if not setting:
                raise Unresolved(f"the register of its {kind} is not stated in the motion")
            held = settings[setting]
            what = f"its {kind}, {spelled(line.settings[setting])},"
            literals = literals_of(held)
            if literals is None or (isinstance(held, Structure) and held.kind == "components"):
                lost = held if isinstance(held, Lost) else _first_lost(held)
                raise Unresolved(f"{what} {_NO_REGISTER.reason if lost is None else lost.reason}")
            x, y, z, w, p, r = literals
            T = angled_pose(x, y, z, r, p, w)
            if np.abs(T[:3, :3] - np.eye(3)).max() > TURN_TOLERANCE:
                raise Unresolved(f"{what} turns the position, which is not provided for")
            shifts[kind] = T
        return shifts["Offset"], shifts["Tool_Offset"]

    def _written(
        self, file: int, operand: NamedPosition, value: Any, active: Mapping[str, int | None], offset: Shifts
    ) -> WrittenPosition:
        """A position as it is written, with the frames that it counts from.

        Raises:
            Unresolved: it, or one of them, is not known.
        """
        if operand.register:
            origin = position = None
            stated, own = _register(operand.name, value), (None, None)
        else:
            origin = value.origin if isinstance(value, Structure) else None
            if origin is None or (origin.owner, origin.path) != (("P", file), (operand.number,)):
                raise Unresolved(f"{operand.name} is no position of the listing")
            assert operand.number is not None
            position = self.listings[file].positions[operand.number]
            stated = position.groups[ROBOT_GROUP]
            own = (stated.frame, stated.tool)
        numbers: list[int] = []
        for what, states, name in zip(("UFRAME", "UTOOL"), own, ACTIVE, strict=True):
            number = active[name] if states is None else states
            if number is None:
                raise Unresolved(f"{operand.name} counts from the active {what}, and which one that is is not known")
            if active[name] is not None and number != active[name] and stated.is_pose:
                raise Unresolved(
                    f"{operand.name} counts from {what} {number}, and {what} {active[name]} is active, with which the "
                    "controller stops"
                )
            numbers.append(number)
        return WrittenPosition(
            operand=operand,
            position=position,
            origin=origin,
            stated=stated,
            numbers=(numbers[0], numbers[1]),
            offset=offset,
        )

    def _frames(self, numbers: tuple[int, int], settings: Mapping[str, Any]) -> tuple[Frame, Frame]:
        found: list[Frame] = []
        unknown: list[str] = []
        kinds: tuple[tuple[FrameKind, Any], ...] = (
            ("UFRAME", self.frames.user_frame),
            ("UTOOL", self.frames.tool_frame),
        )
        for (kind, known), number in zip(kinds, numbers, strict=True):
            own = settings[kind].part(number)
            try:
                untouched = isinstance(own, str)
                found.append(
                    known(number, None if untouched else literals_of(own) or _first_lost(own) or _SET_OTHERWISE)
                )
            except Unresolved as reason:
                unknown.append(str(reason))
        if unknown:
            raise Unresolved(Cause("; ".join(unknown), of=unknown))
        frame, tool = found
        return frame, tool

    def _target(
        self, written: WrittenPosition, line: MotionInstruction, tool: Frame, frame: Frame, source: Source
    ) -> Target:
        place, name, stated = source.place(written.start), written.operand.name, written.stated
        if not stated.is_pose:
            return self._to_joints(stated.joints(len(self.robot.joint_names)), line, tool, frame, name, place)
        shift, tool_shift = written.offset
        posture: Posture = Configuration.parse(stated.configuration)
        return Target(name=name, T=shift @ stated.pose() @ tool_shift, q=None, posture=posture, place=place)

    def _to_joints(
        self, q: np.ndarray, line: MotionInstruction, tool: Frame, frame: Frame, name: str, place: Place
    ) -> Target:
        if line.offsets:
            raise Unresolved("offset of a joint position is not supported; program the position in Cartesian form")
        if line.keyword == "J":
            return Target(name=name, T=None, q=q, posture=None, place=place)
        if self.robot is NO_ROBOT:
            raise Unresolved(
                "its position is joint positions, whose pose follows from the robot's kinematics; give the robot"
            )
        flange = self.robot.tool_poses(q[None])[0] @ se3.inverse(self.robot.T_flange_tool)
        T = se3.inverse(frame.T) @ flange @ tool.T
        return Target(name=name, T=T, q=None, posture=NearPosture(q=q), place=place)


def _backed_up(register: Register) -> Structure:
    """A register as a backup has it."""
    numbers = {**register.values, **({"EXT": 0.0} if register.extended else {})}
    parts = {name: Settable(value) for name, value in numbers.items()}
    return Structure(kind="PR", parts={"CONFIG": register.configuration, **parts})


def _first_lost(value: Any) -> Lost | None:
    """What is lost of a value, the first part of it."""
    parts = value.parts.values() if isinstance(value, Structure) else (value,)
    return next((part for part in parts if isinstance(part, Lost)), None)


def _register(name: str, value: Any) -> Register:
    """What a register holds.

    Raises:
        Unresolved: it is no position, or not all of it is known.
    """
    if not isinstance(value, Structure) or value.kind == "array":
        raise Unresolved(f"{name} is no position")
    lost = _first_lost(value)
    if lost is not None:
        raise Unresolved(f"{name} {lost.reason}")
    if value.kind == "components":
        raise Unresolved(
            f"{name} is set in the program by its components, and whether of a pose or of joints is not known"
        )
    if "EXT" in value.parts:
        raise Unresolved(f"{name} moves extended axes, which is not provided for")
    configuration = str(value.part("CONFIG"))
    literals = literals_of(value)
    if literals is not None:
        x, y, z, w, p, r = literals
        return Register(T=angled_pose(x, y, z, r, p, w), configuration=configuration)
    return Register(q=np.radians([float(value.parts[joint]) for joint in JOINTS if joint in value.parts]))
