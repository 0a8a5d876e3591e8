"""The task: a box that the tool works in, or a list or path of poses from a file."""

import asyncio

import numpy as np
from nicegui import ui

from taskcal.errors import TaskcalError
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot import Robot
from taskcal.studio.box_editor import BoxEditor
from taskcal.studio.controls import button, choice, drop_zone, facts, message, text
from taskcal.studio.pages.measurements_page import in_project
from taskcal.studio.pages.robot_page import robot_of, slider_ranges
from taskcal.studio.project import LAYOUT, TASK_ENDINGS, Project
from taskcal.studio.studio import Studio
from taskcal.studio.task_box import TaskBox, box_of, first_task, save_box
from taskcal.studio.texts import Texts
from taskcal.task.task import Task, load_task, reach_task

TRIED = 60
"""Poses that are tried for whether the robot reaches the task."""


async def build(studio: Studio, texts: Texts) -> None:
    """Fill the page."""
    project = studio.project
    choices = project.choices
    files = {path: path for path in project.files(LAYOUT.tasks, TASK_ENDINGS)}

    def take(path: str) -> None:
        project.choose(task=path)
        ui.navigate.reload()

    if files:
        choice(texts("task.choose"), files, choices.task, take)
    drop_zone(texts, "task", texts("task.drop"), TASK_ENDINGS)
    try:
        robot = await asyncio.to_thread(robot_of, project)
        model = ErrorModel(robot)
        if not choices.task:
            text("p", texts("task.none"))
            button(texts("task.begin"), lambda: _begin(project, model))
            return
        task = await asyncio.to_thread(load_task, project.path(choices.task))
    except TaskcalError as error:
        message(in_project(str(error), project))
        return
    tolerance = "–" if task.accuracy is None else f"{task.accuracy * 1e3:g} mm"
    facts([(texts("task.name"), task.name), (texts("task.tolerance"), tolerance)])
    box = box_of(task)
    if box is None:
        text("p", texts("task.no_box")).classes("quiet")
    reached = _Reached(model, texts)
    if box is not None:

        def save(moved: TaskBox) -> None:
            save_box(project.path(choices.task), moved)
            reached.look(moved.moved)

        BoxEditor(robot, posture(robot), box, texts, on_move=lambda _: None, on_release=save)
    reached.show()
    reached.look(task)


def posture(robot: Robot) -> np.ndarray:
    """Joint positions that a robot is drawn in: all zero, or as near to that as its limits let it."""
    return np.clip(np.zeros(len(robot.joints)), *slider_ranges(robot).T)


def _begin(project: Project, model: ErrorModel) -> None:
    """Begin with a box around the tool."""
    robot = model.robot
    middle = 0.5 * (posture(robot) + slider_ranges(robot).mean(axis=1))
    path = project.put(LAYOUT.tasks, "task.toml", first_task(model, middle).encode(), TASK_ENDINGS)
    project.choose(task=path)
    ui.navigate.reload()


class _Reached:
    """How much of the task the robot reaches."""

    def __init__(self, model: ErrorModel, texts: Texts) -> None:
        self._model, self._texts = model, texts
        self._place: ui.element | None = None

    def show(self) -> None:
        """Make room for it."""
        self._place = ui.element("div").props("role=status")

    def look(self, task: Task) -> None:
        """Try some poses, and say how many of them the robot reaches."""
        if self._place is None:
            return
        self._place.clear()
        with self._place:
            try:
                lost = float(reach_task(self._model, task, TRIED).unreachable.mean())
            except TaskcalError as error:
                message(str(error))
                return
            said = self._texts("task.reached", share=f"{1.0 - lost:.0%}")
            text("p", said).classes("good" if lost == 0.0 else "bad")
