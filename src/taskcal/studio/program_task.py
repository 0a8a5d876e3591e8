"""A task of the poses that a program drives to."""

from pathlib import Path

import numpy as np
import tomli_w
from jaxtyping import Float

from taskcal.errors import TaskcalError
from taskcal.geometry import se3
from taskcal.programs.languages import language_of
from taskcal.programs.program import Program
from taskcal.robot.robot import Robot
from taskcal.studio.project import LAYOUT, Project

ACCURACY_MM = 0.1
"""That such a task begins with."""


def read_together(project: Project, program: str) -> list[str]:
    """The files of a program: those of its name in the same language, and RAPID's system modules."""
    language, stem = language_of(Path(program)), Path(program).stem.casefold()
    others = [
        path
        for path in project.files(LAYOUT.programs, language.suffixes)
        if path != program and (Path(path).stem.casefold() == stem or path.lower().endswith(".sys"))
    ]
    return [program, *others]


def program_poses(program: Program, robot: Robot) -> Float[np.ndarray, "n 4 4"]:
    """Where the robot's own tool is, in the base, while the flange is where the program's targets have it; metres.

    Raises:
        TaskcalError: no motion of it goes to a pose in a frame that stands still.
    """
    flange = [
        move.flange(move.end.T)
        for move in program.moves
        if move.end.T is not None and not move.carrier and not move.part.moved and move.tool.stated
    ]
    if not flange:
        raise TaskcalError(
            "the program has no motions to poses whose tool and frame are known; read it with its cell file"
        )
    return np.stack(flange) @ robot.T_flange_tool


def task_files(poses: Float[np.ndarray, "n 4 4"], name: str) -> tuple[str, str]:
    """A task file that names a table, and the table.

    Args:
        poses: of the tool in the base, metres.
        name: of the task, and of the table without its ending.
    """
    lines = ["x_mm,y_mm,z_mm,qx,qy,qz,qw"]
    quaternions = se3.to_quaternion(poses[:, :3, :3])
    for point, quaternion in zip(poses[:, :3, 3] * 1e3, quaternions, strict=True):
        lines.append(",".join([*(f"{value:.4f}" for value in point), *(f"{value:.9f}" for value in quaternion)]))
    task = {"name": name, "poses": f"{name}.csv", "accuracy": {"position_mm": ACCURACY_MM}}
    return tomli_w.dumps(task), "\n".join(lines) + "\n"
