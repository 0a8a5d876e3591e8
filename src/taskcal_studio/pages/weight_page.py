"""Sensitivity: which parameters move the tool over the task, and which its poses can tell apart, as the box is dragged."""

import asyncio
from dataclasses import dataclass
from itertools import chain

import numpy as np
from nicegui import ui
from nicegui.elements.mixins.text_element import TextElement

from taskcal.analysis.identifiability import identifiability
from taskcal.analysis.sensitivity import sensitivity
from taskcal.errors import TaskcalError
from taskcal.report.content import TextTable
from taskcal.robot.error_model import ErrorModel
from taskcal.task.task import Task, load_task, reach_task
from taskcal_studio.controls import command_line, facts, message, tabulated
from taskcal_studio.editors import BoxEditor
from taskcal_studio.measured_rows import cell_of
from taskcal_studio.pages.task_page import posture
from taskcal_studio.results import robot_of
from taskcal_studio.runs import Studio
from taskcal_studio.task_box import TaskBox, box_of, save_box
from taskcal_studio.texts import Texts

POSES = 30
"""Spread over the task; few enough for ten looks a second while the box is dragged."""

NANOMETRES = 9
"""Decimals of metres by which parameters are ordered: those that differ by rounding alone stay in the model's order."""

MAX_PARAMETERS = 12
"""Most influential parameters that are listed."""


COLUMNS = 5
"""Of a table of parameters with symbols."""


@dataclass(frozen=True, kw_only=True)
class Weight:
    """Effects of the parameters on the tool over a task."""

    rows: tuple[tuple[str, ...], ...]
    """Parameter, symbol where the robot has any, tolerance, and its effect on the tool in space, largest and rms, millimetres."""
    rank: int
    """Parameters that the poses tell apart."""
    parameters: int
    reached: float
    """Share of the poses that the robot reaches."""


def weigh(model: ErrorModel, task: Task) -> Weight:
    """Sensitivity and identifiability over a task, by the functions of the command line.

    Raises:
        TaskcalError: the robot reaches the task nowhere.
    """
    poses = reach_task(model, task, POSES)
    influence = sensitivity(model, poses.q)
    largest, rms = influence.maximum_in_space(scaled=True), influence.rms(scaled=True)
    first = np.argsort(-np.round(largest, NANOMETRES), kind="stable")[:MAX_PARAMETERS]
    named = any(p.symbol for p in model.parameters)
    rows = tuple(
        (p.name, *([p.symbol] if named else []), p.stated_tolerance, f"{largest[i] * 1e3:.4f}", f"{rms[i] * 1e3:.4f}")
        for i, p in ((i, model.parameters[i]) for i in first)
    )
    apart = identifiability(model, poses.q).rank
    return Weight(rows=rows, rank=apart, parameters=len(model), reached=1.0 - float(poses.unreachable.mean()))


async def build(studio: Studio, texts: Texts) -> None:
    """Fill the page."""
    project = studio.project
    choices = project.choices
    robot = await asyncio.to_thread(robot_of, project)
    task = await asyncio.to_thread(load_task, project.path(choices.task))
    shown = _Shown(ErrorModel(robot), texts)
    box = box_of(task)
    if box is not None:

        def release(moved: TaskBox) -> TaskBox:
            with project.change(choices.task, joins=True):
                saved = save_box(project.path(choices.task), moved)
            shown.want(saved.task)
            return saved

        def move(moved: TaskBox) -> None:
            shown.want(moved.moved)

        cell = await asyncio.to_thread(cell_of, project, robot)
        BoxEditor(robot, posture(robot), box, texts, cell, on_move=move, on_release=release)
    command_line(
        f"taskcal sensitivity --robot {choices.robot} --task {choices.task} --count {POSES} --sort influence", texts
    )
    shown.make_room()
    await shown.show(task)


class _Shown:
    """Sensitivity at the last place of the box; places that came and went meanwhile are passed over."""

    def __init__(self, model: ErrorModel, texts: Texts) -> None:
        self._model, self._texts = model, texts
        self._wanted: Task | None = None
        self._busy = False
        self._place: ui.element | None = None
        self._cells: list[TextElement] = []

    def make_room(self) -> None:
        """Place in which it is shown."""
        self._place = ui.element("div").props('role=status data-updates="0"')

    def want(self, task: Task) -> None:
        """Show it for this task as soon as may be."""
        self._wanted = task
        if not self._busy:
            ui.timer(0.0, self._catch_up, once=True)

    async def _catch_up(self) -> None:
        if self._busy:
            return
        self._busy = True
        try:
            while self._wanted is not None:
                task, self._wanted = self._wanted, None
                await self.show(task)
        finally:
            self._busy = False

    async def show(self, task: Task) -> None:
        """Compute and show it."""
        assert self._place is not None
        try:
            weight = await asyncio.to_thread(weigh, self._model, task)
        except TaskcalError as error:
            self._place.clear()
            self._cells = []
            with self._place:
                message(str(error))
            return
        contents = [f"{weight.reached:.0%}", f"{weight.rank} / {weight.parameters}", *chain.from_iterable(weight.rows)]
        if len(self._cells) != len(contents):
            self._build(weight)
        for cell, content in zip(self._cells, contents, strict=True):
            if cell.text != content:  # elements made anew would cost ten times as much, here and in the browser
                cell.set_text(content)
        self._place.props["data-updates"] = str(int(self._place.props["data-updates"]) + 1)

    def _build(self, weight: Weight) -> None:
        """The elements, and which of them hold what changes."""
        assert self._place is not None
        texts = self._texts
        self._place.clear()
        with self._place:
            told = facts([(texts("weight.reached"), "–"), (texts("weight.apart"), "–")])
            words = ["parameter", "symbol"] if len(weight.rows[0]) == COLUMNS else ["parameter"]
            header = tuple(texts(f"weight.{key}") for key in (*words, "tolerance", "largest", "rms"))
            title = texts("weight.most", count=len(weight.rows))
            rows = tabulated(TextTable.of_rows(title, header, weight.rows, text_columns=tuple(range(len(words)))))
        within = [*told.descendants(), *rows.descendants()]
        self._cells = [e for e in within if isinstance(e, TextElement) and e.tag in ("dd", "td")]
