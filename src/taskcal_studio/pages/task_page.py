"""The task: a box that the tool works in, or a list or path of poses from a file."""

import asyncio
from contextlib import suppress
from pathlib import Path

import numpy as np
from jaxtyping import Float
from nicegui import ui

from robot_programs.reading import read_program
from taskcal.errors import TaskcalError
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot import Robot
from taskcal.task.default_task import default_task, measured_task, task_text
from taskcal.task.task import Task, load_task, reach_task
from taskcal_studio.controls import button, drop_zone, line_of_text, message, number, text
from taskcal_studio.editors import BoxEditor, OrientationEditor
from taskcal_studio.measured_rows import cell_of
from taskcal_studio.pages.robot_page import slider_ranges
from taskcal_studio.project import LAYOUT, PROGRAM_ENDINGS, TASK_ENDINGS, Project, free_name
from taskcal_studio.results import read_measured, robot_of
from taskcal_studio.robot_meshes import RobotMeshes
from taskcal_studio.runs import Studio
from taskcal_studio.steps import choose_file, show_error
from taskcal_studio.task_box import (
    TaskBox,
    box_of,
    program_poses,
    read_together,
    save_box,
    save_head,
    task_files,
)
from taskcal_studio.texts import Texts
from taskcal_studio.views import CellView, add_views

MAX_TOLERANCE_MM = 1e3

TRIED = 60
"""Poses that are tried for whether the robot reaches the task."""


async def build(studio: Studio, texts: Texts) -> None:
    """Fill the page."""
    project = studio.project
    choices = project.choices
    files = {path: path for path in project.files(LAYOUT.tasks, TASK_ENDINGS)}
    if files:
        choose_file(project, texts, "task", files)
    drop_zone(texts, "task", texts("task.drop"), TASK_ENDINGS)
    robot = await asyncio.to_thread(robot_of, project)
    model = ErrorModel(robot)
    if not choices.task:
        text("p", texts("task.none"))
        button(texts("task.begin"), lambda: begin_task(studio))
        _offer_programs(project, model, texts)
        return
    task = await asyncio.to_thread(load_task, project.path(choices.task))
    path = project.path(choices.task)

    def head(*, name: str | None = None, accuracy_mm: float | None = None) -> None:
        with project.change(choices.task, joins=True):
            save_head(path, name=name, accuracy_mm=accuracy_mm)

    line_of_text(texts("task.name"), task.name, lambda name: head(name=name) if name else None)
    tolerance = 0.0 if task.accuracy is None else task.accuracy * 1e3
    number(texts("task.tolerance"), tolerance, lambda value: head(accuracy_mm=value), 0.0, MAX_TOLERANCE_MM)
    box = box_of(task)
    if box is None:
        text("p", texts("task.no_box")).classes("quiet")
    reached = _Reached(model, texts)
    cell = await asyncio.to_thread(cell_of, project, robot)
    if box is not None:

        def save(moved: TaskBox) -> TaskBox:
            with project.change(choices.task, joins=True):
                saved = save_box(path, moved)
            reached.look(saved.task)
            return saved

        if not np.array_equal(box.workspace.T_base_frame, np.eye(4)):
            text("p", texts("task.in_frame")).classes("quiet")
        editor = BoxEditor(robot, posture(robot), box, texts, cell, on_move=lambda _: None, on_release=save)
        OrientationEditor(editor, texts)
    elif task.poses is not None:
        _draw_poses(task.poses[:, :3, 3], robot, cell[0], texts)
    reached.show()
    reached.look(task)
    _offer_programs(project, model, texts)


def _draw_poses(points: Float[np.ndarray, "n 3"], robot: Robot, meshes: RobotMeshes | None, texts: Texts) -> None:
    view = CellView(robot, posture(robot)[None], meshes=meshes, cloud=points)
    with ui.element("div").classes("row"):
        add_views(view, texts("task.poses_of", count=len(points)), texts)
    text("p", texts("task.poses_of", count=len(points))).classes("quiet")


def _offer_programs(project: Project, model: ErrorModel, texts: Texts) -> None:
    """Tasks that are the poses of a program."""
    programs = project.files(LAYOUT.programs, PROGRAM_ENDINGS)
    if not programs:
        return
    with ui.element("details"):
        text("summary", texts("task.of_program"))
        text("p", texts("task.of_program_how")).classes("quiet")
        said = ui.element("div")
        with ui.element("div").classes("row"):
            for path in programs:
                label = texts("task.take_program", name=Path(path).name)
                button(label, lambda path=path: _take_program(project, model, path, said), plain=True)


def _take_program(project: Project, model: ErrorModel, path: str, said: ui.element) -> None:
    said.clear()
    try:
        sources = [project.path(file) for file in read_together(project, path)]
        poses = program_poses(read_program(*sources, robot=model.robot), model.robot)
        taken = [Path(file).with_suffix(".toml").name for file in project.files(LAYOUT.tasks)]
        name = Path(free_name(f"{Path(path).stem}-targets.toml", taken)).stem
        task, listed = task_files(poses, name)
        with project.change():
            project.put(LAYOUT.tasks, f"{name}.csv", listed.encode(), (".csv",))
            project.choose(task=project.put(LAYOUT.tasks, f"{name}.toml", task.encode(), TASK_ENDINGS))
    except TaskcalError as error:
        with said:
            show_error(project, error)
        return
    ui.navigate.reload()


def posture(robot: Robot) -> np.ndarray:
    """Joint positions that a robot is drawn in: all zero, or as near to that as its limits let it."""
    return np.clip(np.zeros(len(robot.joints)), *slider_ranges(robot).T)


async def begin_task(studio: Studio) -> None:
    """Begin with a box in the midst of what was measured, else with one that the robot reaches, and show it."""
    project, model = studio.project, ErrorModel(robot_of(studio.project))
    try:
        task = await asyncio.to_thread(_task_to_begin_with, project, model)
        with project.change():
            project.choose(task=project.put(LAYOUT.tasks, "task.toml", task_text(task).encode(), TASK_ENDINGS))
    except TaskcalError as error:
        show_error(project, error)
        return
    ui.navigate.to("/task")


def _task_to_begin_with(project: Project, model: ErrorModel) -> Task:
    if project.choices.campaign:
        with suppress(TaskcalError):
            return measured_task(model, read_measured(project, model.robot).q)
    return default_task(model)


class _Reached:
    """Reachable share of the task."""

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
