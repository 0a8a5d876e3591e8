"""A new KRL program of given motions."""

import re
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from jaxtyping import Float

from robot_programs.core.errors import InputError
from robot_programs.core.program import Move, Target
from robot_programs.core.robot import Robot
from robot_programs.core.source import Source, numeral
from robot_programs.krl.data import AXES, DECIMALS, axis_values, pose_values
from robot_programs.krl.rewrite import KEYWORDS, LONGEST_NAME, Status

NEWLINE = "\r\n"
"""As KUKA's controllers write it."""


NEAREST_MM, NEAREST_PERCENT = 0.3, 1
"""How near motions that do not stop pass by their targets, along paths and by the joints."""


def compose_krl(
    name: str,
    robot: Robot,
    moves: Sequence[Move],
    *,
    q: Float[np.ndarray, "moves joints"] | None = None,
    notes: Sequence[str] = (),
    wait_s: float = 0.0,
    joint_speed_percent: float = 10.0,
) -> Source:
    """A program of its own, ``name.src``, with all points in its motions.

    Args:
        name: of the program.
        robot: the robot.
        moves: its motions.
        q: joint positions in which each motion ends, radians; they decide status and turn of motions of all joints to a
            pose, where the motions do not state them.
        notes: a comment before each motion.
        wait_s: seconds to wait behind each motion that stops and waits.
        joint_speed_percent: speed of motions of all joints, of the axes' largest speeds.

    Raises:
        InputError: KRL cannot say it.
    """
    if not re.fullmatch(f"[A-Za-z_][A-Za-z0-9_]{{0,{LONGEST_NAME - 1}}}", name):
        raise InputError(
            f"'{name}' is not a name of a KRL program; begin with a letter, and use at most {LONGEST_NAME} letters, digits and _"
        )
    if len(robot.joint_names) > len(AXES) or any(robot.prismatic):
        raise InputError(f"{robot.name} is not a robot of up to six turning axes, which KRL's positions describe")
    lines = [
        "&ACCESS RVP",
        f"DEF {name} ( )",
        "EXT BAS (BAS_COMMAND :IN,REAL :IN )",
        "GLOBAL INTERRUPT DECL 3 WHEN $STOPMESS==TRUE DO IR_STOPM ( )",
        "INTERRUPT ON 3",
        "BAS (#INITMOV,0 )",
        f"BAS (#VEL_PTP,{joint_speed_percent:g} )",
        *([f"$APO.CDIS = {NEAREST_MM:g}", f"$APO.CPTP = {NEAREST_PERCENT}"] if any(not m.stops for m in moves) else []),
        *_motions(robot, moves, q, notes, wait_s),
        "END",
    ]
    return Source(path=Path(f"{name}.src"), text=NEWLINE.join(lines) + NEWLINE, encoding="utf-8")


def _motions(
    robot: Robot,
    moves: Sequence[Move],
    q: Float[np.ndarray, "moves joints"] | None,
    notes: Sequence[str],
    wait_s: float,
) -> Iterator[str]:
    before: dict[str, str] = {}
    for i, move in enumerate(moves):
        if notes:
            yield f"; {' '.join(notes[i].split())}"
        for name, text in _settings(i, move).items():
            if before.get(name) != text:
                before[name] = text
                yield f"{name} = {text}"
        status = _status(robot, i, move, None if q is None else q[i]) if move.kind == "joint" else None
        points = [_point(move.end, status)]
        if move.via is not None:
            points.insert(0, _point(move.via, None))
        along_path = move.kind in ("linear", "circular")
        passing = "" if move.stops else " C_DIS" if along_path else " C_PTP"
        yield f"{KEYWORDS[move.kind]} {','.join(points)}{passing}"
        if move.stops and move.waits and wait_s:
            yield f"WAIT SEC {wait_s:g}"


def _settings(number: int, move: Move) -> dict[str, str]:
    """System variables that must hold for a motion, and their values."""
    if move.kind == "axes":
        return {}
    if move.part_in_hand:
        raise InputError(
            f"motion {number} has its part in the robot's hand; in KRL that needs frames of TOOL_DATA and BASE_DATA by number"
        )
    out = {
        "$TOOL": _braces(pose_values(move.tool.T)),
        "$BASE": _braces(pose_values(move.part.T)),
    }
    if move.speed is not None:
        out["$VEL.CP"] = f"{move.speed:g}"
    return out


def _status(robot: Robot, number: int, move: Move, q: Float[np.ndarray, " joints"] | None) -> Status:
    if q is not None:
        return Status(S=0, T=0).of(robot, q)
    if isinstance(move.end.posture, Status):
        return move.end.posture
    raise InputError(
        f"motion {number} drives all joints to a pose and does not say in which posture; give its joint positions"
    )


def _point(target: Target, status: Status | None) -> str:
    if target.q is not None:
        return _braces(axis_values(target.q))
    if target.T is None:
        raise InputError("a target is given neither a pose nor joint positions")
    values = pose_values(target.T)
    if status is None:
        return _braces(values)
    stated = {name: value for name, value in (("S", status.S), ("T", status.T)) if value is not None}
    return _braces(values, stated)


def _braces(values: dict[str, float], status: dict[str, int] | None = None) -> str:
    parts = [f"{name} {numeral(value, DECIMALS[name])}" for name, value in values.items()]
    parts += [f"{name} {value}" for name, value in (status or {}).items()]
    return f"{{{','.join(parts)}}}"
