"""The reference task of the published procedure: a box in front of an IRB 6660-205/1.9, worked in one tool orientation."""

from dataclasses import replace
from importlib import resources
from pathlib import Path

from taskcal.task.task import Task, load_task

ROBOT = "abb-irb6660-205-1.9"
"""Catalogue name of the robot whose workspace it is."""


def reference_task(spread: float = 0.0) -> Task:
    """The reference machining workspace of the IRB 6660-205/1.9.

    Args:
        spread: how far the tool tilts and turns about its one orientation, radians.
    """
    task = load_task(Path(str(resources.files("taskcal.demo"))) / "reference-task.toml")
    assert task.workspace is not None
    orientations = tuple(replace(o, cone=spread, spin=spread) for o in task.workspace.orientations)
    return replace(task, workspace=replace(task.workspace, orientations=orientations))
