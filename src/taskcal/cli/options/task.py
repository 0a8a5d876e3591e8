"""The poses of a task, as several commands need them."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from taskcal.cli.output import info

if TYPE_CHECKING:
    from taskcal.robot.error_model import ErrorModel
    from taskcal.task.task import TaskPoses


REACHING = "joints that reach the task's poses"
"""What is being done."""


def read_and_reach(model: "ErrorModel", path: Path, count: int, seed: int, begin: Callable[[str], None]) -> "TaskPoses":
    """Read a task and find the joints that reach it, which is said as it begins; what is out of reach is told on standard error."""
    from taskcal.task.task import load_task, reach_task

    task = load_task(path)
    begin(REACHING)
    poses = reach_task(model, task, count, seed)
    missing = int(poses.unreachable.sum())
    if missing:
        info(f"{missing} of {len(poses.unreachable)} poses of the task are out of the robot's reach and left out")
    return poses
