"""A milling program in RAPID to try a correction on: a pocket with rounded corners, and a surface cut row by row."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from jaxtyping import Float

from robot_programs.core.source import Source
from robot_programs.rapid.resolve import Confdata
from robot_programs.rapid.values import quaternion_texts, real
from taskcal.geometry import se3
from taskcal.kinematics.inverse import find_posture
from taskcal.kinematics.tracing import trace
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot import Robot
from taskcal.task.task import Task

SHORTER = 0.045
"""The finishing cutter ends so far before the roughing one, metres."""

CLEARANCE_M = 0.03
"""Height of the approach paths over the part, metres. A convention."""

ROWS, COLUMNS = 46, 45
"""Rows that the surface is cut in, and targets of each."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Milling:
    """The program with what it is told of tools and parts."""

    source: Source
    tools: dict[str, Float[np.ndarray, "4 4"]]
    """Pose of every tool in the flange, metres."""
    parts: dict[str, Float[np.ndarray, "4 4"]]
    """Pose of every part in the base, metres."""


@dataclass(frozen=True, eq=False)
class _Cut:
    """One motion."""

    instruction: str
    T: Float[np.ndarray, "4 4"]
    via: Float[np.ndarray, "4 4"] | None = None
    speed: str = "v50"
    zone: str = "z0"


def milling_program(robot: Robot, task: Task, rows: int = ROWS) -> Milling:
    """A program in the middle of a task's workspace.

    Args:
        robot: whose own tool is the roughing cutter, its z along the cutter's axis into the part.
        task: with a workspace, in whose first orientation is cut.
        rows: that the surface is cut in.

    Raises:
        ReachError: the robot does not reach the workspace.
    """
    workspace = task.workspace
    if workspace is None:
        raise ValueError("the task has no workspace to mill in")
    R = workspace.orientations[0].rotation
    upright = R @ se3.rotation("x", np.pi)[:3, :3]
    middle = se3.apply(workspace.T_base_frame, workspace.center)
    tools = {
        "tMill10": robot.T_flange_tool,
        "tBall6": robot.T_flange_tool @ se3.translation(z=-SHORTER),
    }
    parts = {
        "wobjPocket": se3.pose(upright, middle + upright @ np.array([0.0, -0.16, -0.05])),
        "wobjForm": se3.pose(upright, middle + upright @ np.array([-0.05, 0.17, 0.02])) @ se3.rotation("y", 0.12),
    }
    writer = _Writer(robot, tools, parts, R)
    pocket = writer.routine("MillPocket", _pocket(), "tMill10", "wobjPocket")
    form = writer.routine("MillForm", _form(rows), "tBall6", "wobjForm")
    lines = [
        "MODULE Milling",
        "  ! Roughing of a pocket and finishing of a surface",
        f"  CONST jointtarget jHome:=[[{','.join(real(float(v), 4) for v in np.degrees(writer.home))}],[9E9,9E9,9E9,9E9,9E9,9E9]];",
        *(f"  PERS tooldata {name}:=[TRUE,{_frame(T)},[18,[120,0,60],[1,0,0,0],0,0,0]];" for name, T in tools.items()),
        *(_part_text(name, T) for name, T in parts.items()),
        "",
        "  PROC main()",
        "    MoveAbsJ jHome,v500,fine,tMill10;",
        "    MillPocket;",
        "    MillForm;",
        "    MoveAbsJ jHome,v500,fine,tMill10;",
        "  ENDPROC",
        "",
        *pocket,
        "",
        *form,
        "ENDMODULE",
    ]
    text = "\r\n".join(lines) + "\r\n"
    return Milling(source=Source(path=Path("Milling.mod"), text=text, encoding="utf-8"), tools=tools, parts=parts)


def with_part_frames(milling: Milling, frames: Mapping[str, Float[np.ndarray, "4 4"]]) -> Milling:
    """The program with other values of some parts' frames in the base, metres; its targets keep their text."""
    text = milling.source.text
    for name, T in frames.items():
        text = text.replace(_part_text(name, milling.parts[name]), _part_text(name, T))
    return replace(milling, source=replace(milling.source, text=text), parts={**milling.parts, **frames})


def _part_text(name: str, T: Float[np.ndarray, "4 4"]) -> str:
    return f'  TASK PERS wobjdata {name}:=[FALSE,TRUE,"",{_frame(T)},[[0,0,0],[1,0,0,0]]];'


def _frame(T: Float[np.ndarray, "4 4"]) -> str:
    x, y, z = (real(float(v), 5) for v in T[:3, 3] * 1e3)
    qx, qy, qz, qw = se3.to_quaternion(T[:3, :3])
    return f"[[{x},{y},{z}],[{','.join(quaternion_texts((qw, qx, qy, qz)))}]]"


def _down(x: float, y: float, z: float) -> Float[np.ndarray, "4 4"]:
    """The cutter upright over the part, at millimetres in the part's frame."""
    return se3.translation(x * 1e-3, y * 1e-3, z * 1e-3) @ se3.rotation("x", np.pi)


def _pocket() -> list[_Cut]:
    """A pocket of 160 × 100 mm, 24 mm deep, its corners rounded; four levels of four rounds from within."""
    cuts = [_Cut("MoveJ", _down(0, 0, CLEARANCE_M * 1e3), speed="v200", zone="z5")]
    for depth in (-6.0, -12.0, -18.0, -24.0):
        for k in range(4):
            a, b, r = 20.0 + 20.0 * k, 8.0 + 14.0 * k, 6.0 + 3.0 * k
            if k == 0:
                cuts.append(_Cut("MoveL", _down(a, 0, depth), speed="v20", zone="fine"))
            else:
                cuts.append(_Cut("MoveL", _down(a, 0, depth), speed="v30"))
            bow = r * (1.0 - np.sqrt(0.5))
            for sx, sy in ((1, 1), (-1, 1), (-1, -1), (1, -1)):
                corner = (sx * (a - bow), sy * (b - bow))
                along, across = (sx * (a - r), sy * b), (sx * a, sy * (b - r))
                begin, end = (across, along) if sx * sy > 0 else (along, across)
                cuts.append(_Cut("MoveL", _down(*begin, depth)))
                cuts.append(_Cut("MoveC", _down(*end, depth), via=_down(*corner, depth)))
            cuts.append(_Cut("MoveL", _down(a, 0, depth)))
        cuts.append(_Cut("MoveL", _down(0, 0, depth + 8.0), speed="v50", zone="z1"))
    cuts.append(_Cut("MoveL", _down(0, 0, CLEARANCE_M * 1e3), speed="v200", zone="fine"))
    return cuts


def _form(rows: int) -> list[_Cut]:
    """A waved surface of 180 × 140 mm, cut row by row with the cutter along its normal."""
    x, y = np.linspace(-90.0, 90.0, COLUMNS), np.linspace(-70.0, 70.0, rows)

    def at(u: float, v: float) -> Float[np.ndarray, "4 4"]:
        a, b = u / 70.0, v / 55.0
        height = 14.0 * np.sin(a) * np.cos(b)
        slope = np.array([14.0 / 70.0 * np.cos(a) * np.cos(b), -14.0 / 55.0 * np.sin(a) * np.sin(b)])
        tilt = se3.pose(se3.exp(np.array([slope[1], -slope[0], 0.0])), np.zeros(3))
        return se3.translation(u * 1e-3, v * 1e-3, height * 1e-3) @ tilt @ se3.rotation("x", np.pi)

    over = se3.translation(z=CLEARANCE_M)
    cuts = [_Cut("MoveJ", over @ at(x[0], y[0]), speed="v200", zone="z5")]
    for row, v in enumerate(y):
        cuts += [_Cut("MoveL", at(u, v)) for u in (x if row % 2 == 0 else x[::-1])]
    cuts.append(_Cut("MoveL", over @ cuts[-1].T, speed="v200", zone="fine"))
    return cuts


class _Writer:
    """Writes routines with the configuration data of the nominal robot."""

    def __init__(
        self,
        robot: Robot,
        tools: dict[str, Float[np.ndarray, "4 4"]],
        parts: dict[str, Float[np.ndarray, "4 4"]],
        R: Float[np.ndarray, "3 3"],
    ):
        self.robot, self.tools, self.parts, self.model = robot, tools, parts, ErrorModel(robot)
        middle = np.mean([T[:3, 3] for T in parts.values()], axis=0)
        self.home = find_posture(self.model, se3.pose(R, middle - 0.08 * R[:, 2]))

    def routine(self, name: str, cuts: Sequence[_Cut], tool: str, part: str) -> list[str]:
        """The lines of a routine."""
        points = [(cut, T) for cut in cuts for T in (cut.via, cut.T) if T is not None]
        inward = se3.inverse(self.tools[tool]) @ self.robot.T_flange_tool
        poses = np.array([self.parts[part] @ T @ inward for _, T in points])
        traced = trace(self.model, poses, self.home)
        if not traced.reached.all():
            raise ValueError(f"the robot does not reach all of {name}; move the workspace")
        texts: dict[int, list[str]] = {}
        for (cut, T), q in zip(points, traced.q, strict=True):
            x, y, z = (real(float(v), 5) for v in T[:3, 3] * 1e3)
            qx, qy, qz, qw = se3.to_quaternion(T[:3, :3])
            rotation = ",".join(quaternion_texts((qw, qx, qy, qz)))
            configuration = Confdata.of(self.robot, q)
            text = f"[[{x},{y},{z}],[{rotation}],{configuration},[9E9,9E9,9E9,9E9,9E9,9E9]]"
            texts.setdefault(id(cut), []).append(text)
        lines = [
            f"    {cut.instruction} {','.join(texts[id(cut)])},{cut.speed},{cut.zone},{tool}\\WObj:={part};"
            for cut in cuts
        ]
        return [f"  PROC {name}()", *lines, "  ENDPROC"]
