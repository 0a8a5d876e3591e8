"""The poses of a task, as several commands need them."""

from pathlib import Path
from typing import TYPE_CHECKING

from taskcal.cli.output import info

if TYPE_CHECKING:
    from taskcal.robot.error_model import ErrorModel
    from taskcal.task.task import TaskPoses


def read_and_reach(model: "ErrorModel", path: Path, count: int, seed: int) -> "TaskPoses":
    """Read a task and find the joints that reach it; what the robot does not reach is said on standard error."""
    from taskcal.task.task import load_task, reach_task

    poses = reach_task(model, load_task(path), count, seed)
    missing = int(poses.unreachable.sum())
    if missing:
        info(f"{missing} of {len(poses.unreachable)} poses of the task are out of the robot's reach and left out")
    return poses
