"""The result: errors before, after and on rows that were held out; what is left of them, by row and in space."""

import asyncio
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float, Int
from nicegui import ui

from taskcal.correction.verdict import judge
from taskcal.errors import TaskcalError
from taskcal.identification.calibration import Calibration, load_calibration
from taskcal.identification.validation import measured_errors
from taskcal.report.calibration import (
    describe_held_out,
    draw_histogram,
    draw_over_joints,
    tabulate_errors,
    tabulate_left_out,
    tabulate_outliers,
    tabulate_parameters,
    tabulate_range,
)
from taskcal.report.content import Column, Table, millimetres
from taskcal.studio.controls import ValueInput, facts, line_of_text, message, tabulated, text
from taskcal.studio.pages.identify_page import result_of_fit
from taskcal.studio.project import Project
from taskcal.studio.runs import Studio
from taskcal.studio.steps import choose_calibration, link, show_error
from taskcal.studio.texts import Texts
from taskcal.studio.verdict import latest, show_verdict
from taskcal.studio.views import PointView, add_views, figure
from taskcal.task.task import load_task

MAX_ROWS = 20
"""Largest residuals that are listed."""

STRETCH_S = 0.1
"""Between two lengths of the lines."""

SCALES = (*(step * 10**power for power in range(5) for step in (1, 2, 5)), 10**5)
"""By which the lines are stretched, on the slider: round numbers."""

LONGEST_ARROW = 0.25
"""Of the size of the cloud, of the longest line to begin with."""

MAX_ARROWS = 400
"""Residuals that are drawn as lines, the largest; of the others the points alone."""


async def build(studio: Studio, texts: Texts) -> None:
    """Fill the page."""
    project = studio.project
    choices = project.choices
    if not choose_calibration(project, texts):
        return
    calibration = await asyncio.to_thread(load_calibration, project.path(choices.calibration))
    chosen, note = choices.calibration, choices.notes.get(choices.calibration, "")
    line_of_text(texts("result.note"), note, lambda given: project.annotate(chosen, given))
    tolerance = await _verdict(calibration, project, texts)
    held_out = calibration.held_out
    if held_out is not None:
        drawn = draw_histogram(held_out.nominal_validation, held_out.validation, tolerance)
        figure(texts("result.histogram"), drawn, texts, texts("result.histogram_note"))
    placed = await asyncio.to_thread(_place, calibration)
    if placed is not None:
        _in_space(placed, calibration, texts)
    result = result_of_fit(project, choices.calibration)
    if result is None:
        message(texts("result.no_errors"), fine=True)
    else:
        _errors(result, calibration, texts)
    for remark in calibration.remarks:
        message(remark, fine=True)
    for shown in (tabulate_left_out(calibration), tabulate_outliers(calibration)):
        if len(shown):
            tabulated(shown)
    errors = await asyncio.to_thread(measured_errors, calibration)
    if errors is not None:
        figure(texts("result.by_joint"), draw_over_joints(calibration, errors), texts, texts("result.by_joint_note"))
    with ui.element("details"):
        text("summary", texts("result.left"))
        _by_row(calibration, texts)
    with ui.element("details"):
        text("summary", texts("result.range"))
        tabulated(tabulate_range(calibration))
    with ui.element("details"):
        text("summary", texts("result.parameters"))
        tabulated(tabulate_parameters(calibration))


def _errors(result: Mapping[str, Any], calibration: Calibration, texts: Texts) -> None:
    """The table that ``taskcal identify`` prints."""
    summaries = {texts("result.nominal"): result["nominal"], texts("result.fitted"): result["fitted"]}
    if result["held_out"] is not None:
        summaries[texts("result.unseen")] = result["held_out"]
    text("h2", texts("result.errors"))
    tabulated(tabulate_errors(summaries, of=texts("result.of")))
    if calibration.held_out is not None:
        text("p", describe_held_out(calibration.held_out)).classes("quiet")


async def _verdict(calibration: Calibration, project: Project, texts: Texts) -> Mapping[str, float]:
    """Show whether the expected error keeps the task's tolerance; the tolerance in metres, by its name, if one is stated."""
    chosen = project.choices.task
    if not chosen:
        with text("p", texts("verdict.needs_task") + " "):
            link(texts("task.title"), "/task")
        return {}
    try:
        task = load_task(project.path(chosen))
        verdict = await asyncio.to_thread(judge, calibration, task)
    except TaskcalError as error:
        show_error(project, error)
        return {}
    show_verdict(latest(verdict.summary(), project), texts)
    return {} if task.accuracy is None else {texts("verdict.decision"): task.accuracy}


def _by_row(calibration: Calibration, texts: Texts) -> None:
    """The largest residuals."""
    residuals = calibration.residuals[:, :, :3]
    sizes = np.linalg.norm(residuals, axis=2)
    order = np.argsort(-np.nan_to_num(sizes, nan=-1.0), axis=None)[: min(MAX_ROWS, int(np.isfinite(sizes).sum()))]
    rows = list(zip(*np.unravel_index(order, sizes.shape), strict=True))
    columns = (
        Column(texts("result.row"), lambda at: calibration.ids[at[0]]),
        Column(texts("result.target"), lambda at: calibration.targets[at[1]]),
        *(millimetres(f"{axis} mm", lambda at, k=k: residuals[at][k], "+.4f") for k, axis in enumerate("xyz")),
        millimetres(texts("result.size"), lambda at: sizes[at], ".4f"),
    )
    tabulated(Table.of(texts("result.worst", count=len(rows)), columns, rows))


@dataclass(frozen=True, eq=False, kw_only=True)
class _Left:
    """Residuals, and where they were predicted to be."""

    rows: Int[np.ndarray, " k"]
    targets: Int[np.ndarray, " k"]
    points: Float[np.ndarray, "k 3"]
    """Predicted, in the tracker frame, metres."""
    residuals: Float[np.ndarray, "k 3"]
    """Measured less predicted, metres."""


def _place(calibration: Calibration) -> _Left | None:
    """Draw the residuals in 3D; None where that cannot be told, or nothing was seen."""
    if calibration.layout.base_size == 0:  # measured without a tracker
        return None
    rows, targets = np.nonzero(np.isfinite(calibration.residuals[:, :, :3]).all(axis=2))
    if not len(rows):
        return None
    points = calibration.target_poses(calibration.q)[rows, targets, :3, 3]
    return _Left(rows=rows, targets=targets, points=points, residuals=calibration.residuals[rows, targets, :3])


def _in_space(found: _Left, calibration: Calibration, texts: Texts) -> None:
    """Residuals as lines from where the robot was predicted to be."""
    rows, targets, points, left = found.rows, found.targets, found.points, found.residuals
    sizes = np.linalg.norm(left, axis=1)
    largest = np.argsort(-sizes)[:MAX_ARROWS]

    text("h2", texts("result.space"))

    def pick(number: int) -> None:
        view.mark([number])
        x, y, z = left[number] * 1e3
        name = f"{texts('result.row')} {calibration.ids[rows[number]]}, {calibration.targets[targets[number]]}"
        picked.set_text(f"{name}: {x:+.4f} {y:+.4f} {z:+.4f} mm")

    view = PointView(points, pick)
    fitting = LONGEST_ARROW * view.size / max(sizes.max(), 1e-9)
    step = max(int(np.searchsorted(SCALES, fitting, side="right")) - 1, 0)
    view.draw_arrows(largest.tolist(), left[largest], float(SCALES[step]))
    with ui.element("div").classes("row"):
        add_views(view.scene, view.look, texts("result.space_of", count=len(points)), texts)
        with ui.element("label").classes("row"):
            text("span", texts("result.scale"))
            slider = ValueInput("range", texts("result.scale"), str(step), min="0", max=str(len(SCALES) - 1), step="1")
            shown = text("span", f"× {SCALES[step]}")

    def stretch(given: str) -> None:
        chosen = int(np.clip(round(float(given)), 0, len(SCALES) - 1))
        slider.show(str(chosen))
        shown.set_text(f"× {SCALES[chosen]}")
        view.stretch_arrows(float(SCALES[chosen]))

    slider.on_moved(stretch, STRETCH_S)
    picked = text("p", texts("measurements.pick")).props("role=status")
    facts([(texts("result.drawn"), f"{len(largest)} / {len(points)}")])
