"""A new path in CSV of given motions."""

import csv
import io
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from taskcal.errors import TaskcalError
from taskcal.geometry import se3
from taskcal.programs.csv_path.rewrite import DEGREES, MM, UNITS
from taskcal.programs.numeral import numeral
from taskcal.programs.program import Move, Target
from taskcal.programs.source import Source
from taskcal.robot.robot import Robot
from taskcal.tabular.column_groups import POSITION, QUATERNION


def compose_csv_path(name: str, robot: Robot, moves: Sequence[Move], *, notes: Sequence[str] = ()) -> Source:
    """A path of its own, ``name.csv``, a row for each motion and for the via point of each arc.

    Args:
        name: of the file.
        robot: the robot.
        moves: its motions, all with one tool and in one part's frame, which the file does not say.
        notes: names of targets that have none.

    Raises:
        TaskcalError: there are several tools or frames.
    """
    for k, move in enumerate(moves):
        if not (_alike(move.tool.T, moves[0].tool.T) and _alike(move.part.T, moves[0].part.T)) or move.part_in_hand:
            raise TaskcalError(f"motion {k} has another tool or frame than the first; a path in CSV has one of each")
    posed = any(move.end.T is not None for move in moves)
    jointed = not posed or any(move.end.q is not None for move in moves)
    units = ["mm" if slides else "deg" for slides in robot.prismatic]
    joints = [f"{joint}_{unit}" for joint, unit in zip(robot.joint_names, units, strict=True)] if jointed else []
    pose = [*POSITION, *QUATERNION] if posed else []
    rows: list[list[str]] = []
    for k, move in enumerate(moves):
        targets = [(move.end, move.kind)] if move.via is None else [(move.via, "via"), (move.end, move.kind)]
        for target, word in targets:
            note = target.name or (notes[k] if notes else "")
            speed = "" if move.speed is None else numeral(move.speed * 1e3, MM)
            cells = _pose(target, len(pose)) + _joints(target, robot, len(joints))
            rows.append([note, word, *cells, speed, "yes" if move.stops else "no"])
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows([["name", "move", *pose, *joints, "speed_mm_s", "stop"], *rows])
    return Source(path=Path(f"{name}.csv"), text=text.getvalue(), encoding="utf-8")


def _alike(a: np.ndarray, b: np.ndarray) -> bool:
    return np.allclose(a, b, rtol=0.0, atol=1e-9)


def _pose(target: Target, columns: int) -> list[str]:
    if target.T is None or not columns:
        return [""] * columns
    position = [numeral(float(v), MM) for v in target.T[:3, 3] * 1e3]
    return position + [numeral(float(v), UNITS) for v in se3.to_quaternion(target.T[:3, :3])]


def _joints(target: Target, robot: Robot, columns: int) -> list[str]:
    if target.q is None or not columns:
        return [""] * columns
    shown = np.where(robot.prismatic, target.q * 1e3, np.degrees(target.q))
    decimals = np.where(robot.prismatic, MM, DEGREES)
    return [numeral(float(v), int(d)) for v, d in zip(shown, decimals, strict=True)]
