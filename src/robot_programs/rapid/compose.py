"""A new RAPID module of given motions."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from jaxtyping import Float

from robot_programs.core.errors import InputError
from robot_programs.core.program import Frame, Move, Target
from robot_programs.core.robot import Robot
from robot_programs.core.source import FreshNames, Source
from robot_programs.rapid.names import DATA
from robot_programs.rapid.parse import RESERVED
from robot_programs.rapid.resolve import NAMES
from robot_programs.rapid.rewrite import LONGEST_NAME
from robot_programs.rapid.targets import JOINTS, Configuration, TargetType, pose_numbers
from robot_programs.rapid.values import DEG_DECIMALS, MM_DECIMALS, quaternion_texts, real

NEWLINE = "\r\n"
"""As ABB's controllers write it."""

LONGEST_LINE = 120
"""Longer lines are broken between the parts of a value."""

RUN = "_run"
"""Behind the module's name: that of its procedure."""

NO_AXES = ("9E+09",) * 6
"""External axes that are not used."""

LOAD = "[1,[0,0,1],[1,0,0,0],0,0,0]"
"""A load that the controller accepts: a mass has to be greater than zero."""


@dataclass(frozen=True, kw_only=True)
class _Declarations:
    """Data that the module declares, by what they are."""

    lines: list[str] = field(default_factory=list[str])
    names: dict[tuple[object, ...], str] = field(default_factory=dict[tuple[object, ...], str])
    fresh: FreshNames

    def name(self, key: tuple[object, ...], storage: str, wanted: str, value: str) -> str:
        """The name of data, which are declared when they are first needed."""
        if key not in self.names:
            name = self.names[key] = self.fresh.nearest(wanted)
            self.lines.extend(_broken(f"  {storage} {name}:={value};"))
        return self.names[key]


def compose_rapid(
    name: str,
    robot: Robot,
    moves: Sequence[Move],
    *,
    q: Float[np.ndarray, "moves joints"] | None = None,
    notes: Sequence[str] = (),
    wait_s: float = 0.0,
    speed: float = 0.25,
    zone: str = "z0",
) -> Source:
    """A module of its own, ``name.mod``, that declares its targets, tools and work objects and a procedure ``name_run``.

    Args:
        name: of the module.
        robot: the robot.
        moves: its motions.
        q: joint positions in which each motion ends, radians; they decide the configuration of motions to a pose that do
            not state it.
        notes: a comment before each motion.
        wait_s: seconds to wait behind each motion that stops and waits.
        speed: of the tool point, for motions that do not say theirs, metres per second.
        zone: of motions that pass by.

    Raises:
        InputError: RAPID cannot say it.
    """
    longest = LONGEST_NAME - len(RUN)
    if not _is_name(name) or len(name) > longest or name.lower() in RESERVED:
        raise InputError(
            f"'{name}' is not a name of a RAPID module; begin with a letter, and use at most {longest} letters, digits and _"
        )
    if len(robot.joint_names) != JOINTS or any(robot.prismatic):
        raise InputError(f"{robot.name} is not a robot of six turning axes, which RAPID's targets describe")
    fresh = FreshNames((name, f"{name}{RUN}"), longest=LONGEST_NAME, usual=LONGEST_NAME, reserved=RESERVED | set(DATA))
    declared = _Declarations(fresh=fresh)
    body: list[str] = []
    for i, move in enumerate(moves):
        if notes:
            body += _comment(notes[i])
        at = None if q is None else q[i]
        # the posture at the via point is that of the end, unless it says its own
        points = [_point(move.via, _posture_at(move.via, at), i, robot, declared)] if move.via is not None else []
        points.append(_point(move.end, at, i, robot, declared))
        stop = "fine" if move.stops else zone
        arguments = [
            *points,
            _speed(speed if move.speed is None else move.speed, declared),
            stop,
            _tool(move, declared),
        ]
        body.append(f"    {NAMES[move.kind]} {','.join(arguments)};")
        if move.stops and move.waits and wait_s:
            body.append(f"    WaitTime {wait_s:g};")
    lines = [f"MODULE {name}", *declared.lines, "", f"  PROC {name}{RUN}()", *body, "  ENDPROC", "ENDMODULE"]
    return Source(path=Path(f"{name}.mod"), text=NEWLINE.join(lines) + NEWLINE, encoding="utf-8")


def _is_name(text: str) -> bool:
    return text.isascii() and text.isidentifier() and not text.startswith("_")


def _comment(note: str) -> Iterator[str]:
    text = " ".join(note.split())
    width = LONGEST_LINE - 6
    for start in range(0, len(text), width):
        yield f"    ! {text[start : start + width]}"


def _broken(line: str) -> Iterator[str]:
    """A declaration in lines that are not too long."""
    while len(line) > LONGEST_LINE:
        at = line.rfind(",[", 0, LONGEST_LINE) + 1
        if at <= 0:
            break
        yield line[:at]
        line = f"    {line[at:]}"
    yield line


def _posture_at(via: Target, end: Float[np.ndarray, " joints"] | None) -> Float[np.ndarray, " joints"] | None:
    return None if via.posture is not None else end


def _point(
    target: Target, q: Float[np.ndarray, " joints"] | None, number: int, robot: Robot, declared: _Declarations
) -> str:
    type_: TargetType
    if target.q is not None:
        type_, letter = "jointtarget", "j"
        groups = [[real(float(v), DEG_DECIMALS) for v in np.degrees(target.q)]]
    elif target.T is not None:
        type_, letter = "robtarget", "p"
        pose, cf = pose_numbers(target.T), _configuration(target, q, number, robot)
        groups = [
            [real(v, MM_DECIMALS) for v in pose[:3]],
            list(quaternion_texts(pose[3:])),
            [str(v) for v in (cf.cf1, cf.cf4, cf.cf6, cf.cfx)],
        ]
    else:
        raise InputError(f"motion {number} is given neither a pose nor joint positions")
    value = "[" + ",".join(f"[{','.join(group)}]" for group in [*groups, list(NO_AXES)]) + "]"
    return declared.name((type_, value), f"CONST {type_}", f"{letter}{10 * (number + 1)}", value)


def _configuration(target: Target, q: Float[np.ndarray, " joints"] | None, number: int, robot: Robot) -> Configuration:
    if q is not None:
        return Configuration.of(robot, q)
    if isinstance(target.posture, Configuration):
        return target.posture
    raise InputError(f"motion {number} goes to a pose and does not say in which posture; give its joint positions")


def _speed(speed: float, declared: _Declarations) -> str:
    mm = real(speed * 1e3, MM_DECIMALS)
    if f"v{mm}" in DATA:
        return f"v{mm}"
    return declared.name(("speeddata", mm), "CONST speeddata", "vTool", f"[{mm},500,5000,1000]")


def _tool(move: Move, declared: _Declarations) -> str:
    """The tool with its work object, as arguments of a motion."""
    held, fixed = ("FALSE", "TRUE") if move.part_in_hand else ("TRUE", "FALSE")
    tool, work_object = "tool0", ""
    if move.part_in_hand or _moves(move.tool):
        value = f"[{held},{_frame(move.tool)},{LOAD}]"
        tool = declared.name(("tooldata", value), "PERS tooldata", _wish(move.tool, "tTool"), value)
    if move.part_in_hand or _moves(move.part):
        value = f'[{fixed},TRUE,"",{_frame(move.part)},[[0,0,0],[1,0,0,0]]]'
        name = declared.name(("wobjdata", value), "PERS wobjdata", _wish(move.part, "wPart"), value)
        work_object = f"\\WObj:={name}"
    return f"{tool}{work_object}"


def _moves(frame: Frame) -> bool:
    return not np.allclose(frame.T, np.eye(4), rtol=0.0, atol=1e-9)


def _wish(frame: Frame, otherwise: str) -> str:
    return frame.name if _is_name(frame.name) and len(frame.name) <= LONGEST_NAME else otherwise


def _frame(frame: Frame) -> str:
    pose = pose_numbers(frame.T)
    position = ",".join(real(v, MM_DECIMALS) for v in pose[:3])
    return f"[[{position}],[{','.join(quaternion_texts(pose[3:]))}]]"
