"""Reading TP programs: which position, tool and user frame each motion has, by the listing and the registers of a backup."""

import re
from collections.abc import Iterable, Mapping, Sequence, Set
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np
from jaxtyping import Float

from robot_programs.core import se3
from robot_programs.core.errors import FileError, InputError
from robot_programs.core.flow import Effects
from robot_programs.core.program import (
    Diagnostic,
    Frame,
    Motion,
    MotionKind,
    NearPosture,
    Posture,
    Target,
    Unresolved,
    Visit,
)
from robot_programs.core.robot import NO_ROBOT, Robot
from robot_programs.core.source import Place, Source
from robot_programs.tp.listing import (
    ROBOT_GROUP,
    Configuration,
    Instruction,
    Listing,
    MotionLine,
    Offset,
    Operand,
    Variables,
    is_variables,
    parse_motion,
    read_variables,
)
from robot_programs.tp.rewrite import Shifts, Site, TpProgram, Written

# User frames and tools by number: from a backup's variables, or given with the program.

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


@dataclass(frozen=True, eq=False, kw_only=True)
class Frames:
    """Frames of a program; each is made once, so that one frame is one object."""

    variables: Variables
    T_base_world: Float[np.ndarray, "4 4"]
    changed_frames: Set[int | None]
    """User frames that the program sets itself; None for any."""
    changed_tools: Set[int | None]
    tool: Frame | None
    """For all tools that the variables do not state."""
    part: Frame | None
    """For all user frames that the variables do not state; in the world."""
    made: dict[tuple[str, int], Frame] = field(default_factory=dict[tuple[str, int], Frame])

    def user_frame(self, number: int) -> Frame:
        """A user frame, in the base.

        Raises:
            Unresolved: it is not known.
        """
        frame = self._stated("UFRAME", number, self.variables.frames, self.part, self.changed_frames)
        return self.made.setdefault(("UFRAME", number), replace(frame, T=self.T_base_world @ frame.T))

    def tool_frame(self, number: int) -> Frame:
        """A tool, in the flange.

        Raises:
            Unresolved: it is not known.
        """
        frame = self._stated("UTOOL", number, self.variables.tools, self.tool, self.changed_tools)
        return self.made.setdefault(("UTOOL", number), frame)

    def _stated(
        self,
        kind: str,
        number: int,
        stated: Mapping[int, Float[np.ndarray, "4 4"]],
        given: Frame | None,
        changed: Set[int | None],
    ) -> Frame:
        if {number, None} & changed:
            raise Unresolved(f"{kind}[{number}] is set in the program, to what is known only at run time")
        T = np.eye(4) if number == 0 else stated.get(number)
        frame = given if T is None else Frame(name=f"{kind} {number}", T=T)
        if frame is None:
            option = "--part" if kind == "UFRAME" else "--tool"
            raise Unresolved(
                f"{kind} {number} is not known; pass the backup's sysframe.va with the program, or name one of the cell "
                f"file ({option})"
            )
        return frame


KINDS: dict[str, MotionKind] = {"J": "joint", "L": "linear", "C": "circular", "A": "linear"}

_SETTING = re.compile(r"\s*(?P<name>UFRAME_NUM|UTOOL_NUM)\s*(?:\[\s*GP1\s*\]\s*)?=\s*(?P<value>[^;]*)", re.IGNORECASE)
_JOIN = re.compile(r"\s*(LBL\s*\[|ELSE\b|ENDIF\b|ENDFOR\b|FOR\b|WHILE\b|ENDWHILE\b|SELECT\b|CASE\b)", re.IGNORECASE)
_CALL = re.compile(r"\s*(CALL|RUN)\b|\bTHEN\s+CALL\b|[=,]\s*CALL\b", re.IGNORECASE)
_MACRO = re.compile(r"\s*[A-Z_][A-Z0-9_ -]*(\(|;|$)")
_CALLED = re.compile(r"\b(?:CALL|RUN)\s+(?P<name>[^\s;(,]+)", re.IGNORECASE)
_BUILT_IN = re.compile(
    r"\s*(END|PAUSE|ABORT|RETURN|(UN)?LOCK|COL|SOFTFLOAT|INDEPENDENT|SIMULTANEOUS|WEAVE|TRACK|ARC|SEARCH|TOUCH|MPASS|STOP|CLEAR|"
    r"RESET|WAIT)\b",
    re.IGNORECASE,
)
"""Instructions of the system that look like macros."""
_REPEATS = re.compile(r"\s*(LBL\s*\[|FOR\b|WHILE\b)", re.IGNORECASE)
"""Where control may come from further down."""
_LEAVES = re.compile(r"\s*(JMP|END|ABORT)\b", re.IGNORECASE)
_INSIDE = r"\s*\[(?P<inside>(?:[^\[\]]|\[[^\[\]]*\])*)\]\s*=(?!=)"
_ASSIGNED = re.compile(r"\b(?P<kind>PR|P|UFRAME|UTOOL)" + _INSIDE, re.IGNORECASE)
_ASSIGNED_VARIABLE = re.compile(r"\$MNU(?P<kind>FRAME|TOOL)\s*\[[^=]*=(?!=)", re.IGNORECASE)
_STATED = re.compile(r"\s*(?:GP\d\s*:)?\s*(\d{1,5})\s*(?:[:,].*)?", re.IGNORECASE | re.DOTALL)
"""What is not a number is computed: then any may be meant."""

TURN_TOLERANCE = 1e-9
"""Entries of the rotation of a register that only shifts."""


@dataclass(kw_only=True)
class State:
    """State at a point of the program."""

    frame: int | None = None
    """Number of the active user frame; None where the text does not tell."""
    tool: int | None = None
    last: int | None = None
    """Number of the motion in whose end the robot is; None where the text does not tell."""
    strange: str = ""
    """A program that was called before and is not in the files, so that it may have set any register; empty where none was."""


Assigned = Mapping[str, Set[int | None]]
"""Numbers of what a program sets itself, by PR, P, UFRAME and UTOOL; None stands for any."""


def assigned(listing: Listing) -> Assigned:
    """Registers, frames and positions that a program sets itself."""
    out: dict[str, set[int | None]] = {kind: set() for kind in ("PR", "P", "UFRAME", "UTOOL")}
    for instruction in listing.instructions:
        text = instruction.text
        if "=" not in text or text.lstrip().startswith(("!", "//", "--")):
            continue
        for match in _ASSIGNED.finditer(text):
            stated = _STATED.fullmatch(match["inside"])
            out[match["kind"].upper()].add(None if stated is None else int(stated[1]))
        for match in _ASSIGNED_VARIABLE.finditer(text):
            out[f"U{match['kind'].upper()}"].add(None)
    return out


def called_by(text: str) -> tuple[str, ...]:
    """Names of programs and macros that an instruction calls, in capitals."""
    outside = re.sub(r"(?<!SR)\[[^\[\]]*\]", "", text)  # CALL SR[1] calls by a name that only the running program knows
    names = tuple(match["name"].upper() for match in _CALLED.finditer(outside))
    macro = not names and _MACRO.match(text) and not _JOIN.match(text) and not _BUILT_IN.match(text)
    return (re.split(r"[(;]", text)[0].strip().upper(),) if macro else names


@dataclass(frozen=True, eq=False, kw_only=True)
class Calls:
    """Which programs call programs that are not in the files."""

    within: Mapping[str, frozenset[str]]
    """Names of these that each program calls, by itself or by others."""
    around: Mapping[str, frozenset[str]]
    """Names of these that are called by what calls each program, and so may have been before it begins."""

    @classmethod
    def of(cls, listings: Iterable[Listing]) -> "Calls":
        """Calls of some programs."""
        called = {
            listing.name.upper(): frozenset(
                name for instruction in listing.instructions if _is_code(instruction.text)
                for name in called_by(instruction.text)
            )
            for listing in listings
        }  # fmt: skip
        own = {name: others.difference(called) for name, others in called.items()}
        effects = Effects(own=own, calls=called)
        around = {name: frozenset[str]().union(*(effects.around[o] for o in effects.callers[name])) for name in called}
        return cls(within=effects.within, around=around)

    def behind(self, called: str) -> str:
        """Name of a program that may have run in a call and is not in the files; empty where nothing."""
        return min(self.within[called], default="") if called in self.within else called


def _is_code(text: str) -> bool:
    return not text.lstrip().startswith(("!", "//", "--", "$"))


@dataclass(frozen=True, eq=False, kw_only=True)
class Findings:
    """Motions read so far."""

    motions: list[Motion] = field(default_factory=list[Motion])
    sites: list[Site] = field(default_factory=list[Site])
    diagnostics: list[Diagnostic] = field(default_factory=list[Diagnostic])
    unresolved: list[Visit] = field(default_factory=list[Visit])
    """Positions of the program to which motions go that could not be resolved."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Resolver:
    """Reading one program."""

    robot: Robot
    frames: Frames
    findings: Findings
    number: int
    """Of the file."""
    source: Source
    listing: Listing
    assigned: Assigned
    changed_elsewhere: Set[int | None]
    """Registers that any of the programs sets."""
    calls: Calls

    def run(self) -> None:
        """Read all instructions."""
        own = self.listing.name.upper()
        state = State(strange=min(self.calls.around[own], default=""))
        for instruction in self.listing.instructions:
            text = instruction.text
            if not _is_code(text):
                continue
            if _REPEATS.match(text):
                state.strange = state.strange or min(self.calls.within[own], default="")
            motion = parse_motion(text, instruction.body)
            if motion is not None:
                self._motion(motion, instruction, state)
            else:
                self._other(text, state)
            for called in called_by(text):
                self._call(called, instruction, state)

    def _call(self, called: str, instruction: Instruction, state: State) -> None:
        state.strange = self.calls.behind(called) or state.strange
        if called not in self.calls.within:
            text = (
                f"{called} is not in the files given; behind it the active frames and all position registers are not known, and "
                "the frames are taken to keep their values; pass its .ls"
            )
            at = instruction.body + len(instruction.text) - len(instruction.text.lstrip())
            self.findings.diagnostics.append(Diagnostic(place=self.source.place(at), text=text))

    def _refuse_strange(self, what: str, state: State) -> None:
        """Let no register be used that a program may have set which is not in the files.

        Raises:
            Unresolved: one may have.
        """
        if state.strange:
            raise Unresolved(
                f"{what} may be set by {state.strange}, which is called before and is not in the files given; pass its .ls"
            )

    def _other(self, text: str, state: State) -> None:
        setting = _SETTING.match(text)
        if setting is not None:
            value = setting["value"].strip()
            number = int(value) if value.isdecimal() and len(value) < 4 else None
            if setting["name"].upper() == "UFRAME_NUM":
                state.frame = number
            else:
                state.tool = number
        elif _JOIN.match(text) or _CALL.search(text) or _MACRO.match(text):
            state.frame = state.tool = state.last = None
        elif _LEAVES.match(text):
            state.last = None

    def _motion(self, motion: MotionLine, instruction: Instruction, state: State) -> None:
        place = self.source.place(motion.keyword_at)
        try:
            move, written = self._resolved(motion, state, place)
        except Unresolved as reason:
            self.findings.diagnostics.append(Diagnostic(place=place, text=str(reason)))
            self.findings.unresolved.extend(
                Visit(number=None, target=(self.number, operand.name), place=place)
                for operand in motion.operands
                if operand.number is not None
            )
            state.last = None
            return
        state.last = None if motion.skips else len(self.findings.motions)
        self.findings.motions.append(move)
        self.findings.sites.append(
            Site(file=self.number, listing=self.listing, instruction=instruction, motion=motion, written=written)
        )

    def _resolved(self, motion: MotionLine, state: State, place: Place) -> tuple[Motion, tuple[Written, ...]]:
        if motion.obstacle:
            raise Unresolved(motion.obstacle)
        offset = self._offset(motion.offsets, motion.keyword_at, state)
        written = tuple(self._written(operand, state, offset) for operand in motion.operands)
        last = written[-1]
        frame, tool = self._one_of(written)
        targets = [self._target(w, motion, tool, frame) for w in written]
        kind = KINDS[motion.keyword]
        if kind == "joint" and targets[-1].T is None:
            kind = "axes"
        follows = state.last
        if motion.keyword == "A" or motion.wrist:
            follows = None
            what = (
                "an arc of A is corrected at its points, not looked at between them"
                if motion.keyword == "A"
                else "with Wjnt it is corrected at its end, not looked at along the way"
            )
            self.findings.diagnostics.append(Diagnostic(place=place, text=what))
        move = Motion(
            kind=kind,
            end=targets[-1],
            via=targets[0] if len(targets) > 1 else None,
            tool=tool,
            part=frame,
            speed=motion.speed,
            turn_speed=motion.turn_speed,
            stops=motion.stops,
            zone=motion.zone,
            follows=follows,
            routine=self.listing.name,
            place=place,
            external=() if last.position is None else last.position.external_positions(),
        )
        return move, written

    def _offset(self, offsets: tuple[Offset, ...], at: int, state: State) -> Shifts:
        """Shifts in the user frame and in the tool.

        Raises:
            Unresolved: one is not known, or turns.
        """
        shifts = {False: np.eye(4), True: np.eye(4)}
        for offset in offsets:
            name = "Tool_Offset" if offset.in_tool else "Offset"
            if offset.register is None:
                raise Unresolved(f"the register of its {name} is not stated in the motion")
            register = self.frames.variables.registers.get(offset.register)
            if {offset.register, None} & self.changed_elsewhere:
                raise Unresolved(f"its {name}, PR[{offset.register}], is set in the program")
            if register is None or register.T is None:
                raise Unresolved(
                    f"its {name}, PR[{offset.register}], is not known; pass the backup's posreg.va with the program"
                )
            if np.abs(register.T[:3, :3] - np.eye(3)).max() > TURN_TOLERANCE:
                raise Unresolved(f"its {name}, PR[{offset.register}], turns the position, which is not provided for")
            self._refuse_strange(f"its {name}, PR[{offset.register}],", state)
            self._say_registers(at)
            shifts[offset.in_tool] = register.T
        return shifts[False], shifts[True]

    def _say_registers(self, at: int) -> None:
        """Say once that registers are taken as the backup has them."""
        text = "position registers are taken as posreg.va states them; programs that are not given may set them"
        if all(diagnostic.text != text for diagnostic in self.findings.diagnostics):
            self.findings.diagnostics.append(Diagnostic(place=self.source.place(at), text=text))

    def _written(self, operand: Operand, state: State, offset: Shifts) -> Written:
        """A position with the frames that it counts from.

        Raises:
            Unresolved: it, or one of them, is not known.
        """
        name = "PR" if operand.register else "P"
        if operand.number is None:
            raise Unresolved(f"the {name} index is computed at run time; use a constant index")
        if operand.register:
            return self._register(operand.number, operand, state, offset)
        if {operand.number, None} & self.assigned["P"]:
            raise Unresolved(f"P[{operand.number}] is set in the program")
        position = self.listing.positions.get(operand.number)
        if position is None or ROBOT_GROUP not in position.groups:
            raise Unresolved(f"P[{operand.number}] has no position of group 1 in /POS")
        group = position.groups[ROBOT_GROUP]
        try:
            group.check()
        except Unresolved as reason:
            line = self.source.line(position.start)
            raise Unresolved(f"P[{operand.number}] in line {line} {reason}") from None
        numbers: list[int] = []
        for what, stated, active in (("UFRAME", group.frame, state.frame), ("UTOOL", group.tool, state.tool)):
            number = active if stated is None else stated
            if number is None:
                raise Unresolved(
                    f"P[{operand.number}] counts from the active {what}, and which one that is is not known"
                )
            if active is not None and number != active and group.is_pose:
                raise Unresolved(
                    f"P[{operand.number}] counts from {what} {number}, and {what} {active} is active, with which the "
                    "controller stops"
                )
            numbers.append(number)
        return Written(
            operand=operand, position=position, stated=group, numbers=(numbers[0], numbers[1]), offset=offset
        )

    def _register(self, number: int, operand: Operand, state: State, offset: Shifts) -> Written:
        if {number, None} & self.changed_elsewhere:
            raise Unresolved(f"PR[{number}] is set in the program, to what is known only at run time")
        register = self.frames.variables.registers.get(number)
        if register is None:
            raise Unresolved(f"PR[{number}] is not known; pass the backup's posreg.va with the program")
        if register.extended:
            raise Unresolved(f"PR[{number}] moves extended axes, which is not provided for")
        for what, active in (("UFRAME", state.frame), ("UTOOL", state.tool)):
            if active is None:
                raise Unresolved(f"PR[{number}] counts from the active {what}, and which one that is is not known")
        self._refuse_strange(f"PR[{number}]", state)
        self._say_registers(operand.start)
        assert state.frame is not None
        assert state.tool is not None
        return Written(
            operand=operand, position=None, stated=register, numbers=(state.frame, state.tool), offset=offset
        )

    def _one_of(self, written: tuple[Written, ...]) -> tuple[Frame, Frame]:
        if len({w.numbers for w in written}) > 1:
            raise Unresolved("its two positions count from different frames")
        frame, tool = written[-1].numbers
        return self.frames.user_frame(frame), self.frames.tool_frame(tool)

    def _target(self, written: Written, motion: MotionLine, tool: Frame, frame: Frame) -> Target:
        place, name, stated = self.source.place(written.start), written.operand.name, written.stated
        if not stated.is_pose:
            q = stated.joints(len(self.robot.joint_names))
            if motion.offsets:
                raise Unresolved("offset of a joint position is not supported; program the position in Cartesian form")
            if motion.keyword == "J":
                return Target(name=name, T=None, q=q, posture=None, place=place)
            if self.robot is NO_ROBOT:
                raise Unresolved(
                    "its position is joint positions, whose pose follows from the robot's kinematics; give the robot"
                )
            flange = self.robot.tool_poses(q[None])[0] @ se3.inverse(self.robot.T_flange_tool)
            T = se3.inverse(frame.T) @ flange @ tool.T
            return Target(name=name, T=T, q=None, posture=NearPosture(q=q), place=place)
        shift, tool_shift = written.offset
        posture: Posture = Configuration.parse(stated.configuration)
        return Target(name=name, T=shift @ stated.pose() @ tool_shift, q=None, posture=posture, place=place)


# Reading TP programs with the frames and registers of a backup.


def read_tp(
    sources: Sequence[Source], *, robot: Robot | None = None, tool: Frame | None = None, part: Frame | None = None
) -> TpProgram:
    """Read TP programs in their text form.

    Args:
        sources: listings (``.ls``), and for user frames, tools and registers the backup's ``sysframe.va`` and ``posreg.va``.
        robot: whose joints positions mean, and above whose base FANUC's world frame lies. Without one frames count from that frame,
            and lines to joint positions are not read.
        tool: in the flange; for tools that the backup does not state.
        part: in the world; for user frames that the backup does not state.

    Raises:
        FileError: a file is no listing, or none is one.
        InputError: FANUC's world frame is not known of such a robot.
    """
    listings = {i: Listing(source.text) for i, source in enumerate(sources) if not is_variables(source)}
    if not listings:
        raise FileError(sources[0].path, "holds variables only; pass the .ls with the motions, too")
    for i, listing in listings.items():
        _check(sources[i], listing)
    T_base_world = np.eye(4) if robot is None else world_in_base(robot)
    own = {i: assigned(listing) for i, listing in listings.items()}
    changed = {kind: {number for a in own.values() for number in a[kind]} for kind in ("PR", "UFRAME", "UTOOL")}
    frames = Frames(
        variables=read_variables(sources),
        T_base_world=T_base_world,
        changed_frames=changed["UFRAME"],
        changed_tools=changed["UTOOL"],
        tool=tool,
        part=part,
    )
    calls = Calls.of(listings.values())
    findings = Findings()
    if robot is None:
        text = "the robot is not given: frames count from FANUC's world frame, at the height of axis 2, in place of its base"
        findings.diagnostics.append(Diagnostic(place=sources[min(listings)].place(0), text=text))
    for i, listing in listings.items():
        Resolver(
            robot=robot or NO_ROBOT,
            frames=frames,
            findings=findings,
            number=i,
            source=sources[i],
            listing=listing,
            assigned=own[i],
            changed_elsewhere=changed["PR"],
            calls=calls,
        ).run()
    return TpProgram(
        sources=tuple(sources),
        motions=tuple(findings.motions),
        diagnostics=tuple(findings.diagnostics),
        T_world_base=None if robot is None else se3.inverse(T_base_world),
        base_from="FANUC's world frame, on axis 1 at the height of axis 2",
        base_missing="FANUC's world frame" if robot is None else "",
        sites=tuple(findings.sites),
        unresolved=tuple(findings.unresolved),
        read=partial(read_tp, robot=robot, tool=tool, part=part),
    )


def _check(source: Source, listing: Listing) -> None:
    """See that a file is a whole listing.

    Raises:
        FileError: it is not.
    """
    for section in ("MN", "POS"):
        if section not in listing.sections:
            hint = (
                "it is binary; save the program as text (.ls)" if "\0" in source.text else f"it has no line /{section}"
            )
            raise FileError(source.path, f"is not a TP listing: {hint}")
    fault = listing.fault()
    if fault is not None:
        raise FileError(source.path, fault[1], line=source.line(fault[0]))
