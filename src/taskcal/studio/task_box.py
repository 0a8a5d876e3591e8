"""A task's box as a person moves it: read from a task file, and written back with everything else that the file says."""

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w
from jaxtyping import Float

from taskcal.files import write_whole
from taskcal.robot.error_model import ErrorModel
from taskcal.task.task import Task, load_task
from taskcal.task.workspace import Workspace

TENTHS = 1
"""Decimals of millimetres that a box is written with."""


@dataclass(frozen=True, eq=False, kw_only=True)
class TaskBox:
    """A box in the robot's base, with the orientations that the tool takes in it."""

    center: Float[np.ndarray, " 3"]
    """Millimetres."""
    size: Float[np.ndarray, " 3"]
    """Edges, millimetres."""
    task: Task
    """The task that the file describes, whose workspace it is."""

    @property
    def moved(self) -> Task:
        """The task with the box where it is now."""
        workspace = self.task.workspace
        assert workspace is not None
        placed = replace(workspace, center=self.center * 1e-3, size=self.size * 1e-3)
        return replace(self.task, workspace=placed)


def box_of(task: Task) -> TaskBox | None:
    """The box of a task; None where its workspace is something else, or counted in another frame than the base."""
    workspace: Workspace | None = task.workspace
    if workspace is None or workspace.shape != "box" or not np.array_equal(workspace.T_base_frame, np.eye(4)):
        return None
    return TaskBox(center=workspace.center * 1e3, size=workspace.size * 1e3, task=task)


def save_box(path: Path, box: TaskBox) -> None:
    """Write a box into its task file; comments are lost, all else stays.

    Raises:
        FileError: the file cannot be read as a task, or not be written.
    """
    load_task(path)
    content: dict[str, Any] = tomllib.loads(path.read_text(encoding="utf-8"))
    content["workspace"]["center_mm"] = np.round(box.center, TENTHS).tolist()
    content["workspace"]["size_mm"] = np.round(box.size, TENTHS).tolist()
    write_whole(path, tomli_w.dumps(content))


def first_task(model: ErrorModel, q: Float[np.ndarray, " joints"]) -> str:
    """A task file to begin with: a box of a tenth of the reach around the tool, as it is turned at some joint positions."""
    from taskcal.geometry import se3

    T = model.nominal.poses(q[None])[0]
    edge = round(100.0 * model.robot.reach, TENTHS)
    section: Mapping[str, Any] = {
        "frame": "base",
        "shape": "box",
        "center_mm": np.round(T[:3, 3] * 1e3, TENTHS).tolist(),
        "size_mm": [edge, edge, edge],
        "orientation": [{"quaternion": se3.to_quaternion(T[None, :3, :3])[0].tolist(), "cone_deg": 20.0}],
    }
    return tomli_w.dumps({"name": "task", "workspace": section, "accuracy": {"position_mm": 0.1}})
