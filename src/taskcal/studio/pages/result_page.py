"""The result: errors before, after and on rows that were held out; what is left of them, by row and in space."""

import asyncio
from collections.abc import Mapping
from contextlib import suppress
from typing import Any

import numpy as np
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
from taskcal.report.camera import camera_section
from taskcal.report.chart import Figure
from taskcal.report.content import Chart, Column, Table, millimetres
from taskcal.studio.controls import ValueInput, facts, line_of_text, message, tabulated, text
from taskcal.studio.measured_rows import MeasuredRows, fitted_rows
from taskcal.studio.pages.identify_page import result_of_fit
from taskcal.studio.project import Project
from taskcal.studio.results import contents, read_measured
from taskcal.studio.robot_meshes import RobotMeshes, meshes_if_sound
from taskcal.studio.runs import Studio
from taskcal.studio.selection import Selection
from taskcal.studio.steps import choose_calibration, link, show_error
from taskcal.studio.texts import Texts
from taskcal.studio.verdict import latest, show_verdict
from taskcal.studio.views import MAX_PICKED, CellView, RowPlayer, figure
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
    measured = await asyncio.to_thread(fitted_rows, calibration)
    errors = await asyncio.to_thread(measured_errors, calibration)
    result = result_of_fit(project, choices.calibration)
    with Selection(len(calibration.q)) as selection:
        if measured is not None:
            same = await asyncio.to_thread(contents, project)
            drawn_as = meshes_if_sound(project) if calibration.provenance.robot_digest == same["robot"] else None
            _in_space(measured, calibration, drawn_as, selection, texts)
        if result is None:
            message(texts("result.no_errors"), fine=True)
        else:
            _errors(result, calibration, texts)
        for remark in calibration.remarks:
            message(remark, fine=True)
        for shown in (tabulate_left_out(calibration), tabulate_outliers(calibration)):
            if len(shown):
                tabulated(shown)
        if errors is not None:
            drawn = draw_over_joints(calibration, errors)
            figure(texts("result.by_joint"), drawn, texts, texts("result.by_joint_note"), selects=True)
        with ui.element("details"):
            text("summary", texts("result.left"))
            _by_row(calibration, texts)
    await _camera(calibration, project, texts)
    with ui.element("details"):
        text("summary", texts("result.range"))
        tabulated(tabulate_range(calibration))
    with ui.element("details"):
        text("summary", texts("result.parameters"))
        tabulated(tabulate_parameters(calibration))


async def _camera(calibration: Calibration, project: Project, texts: Texts) -> None:
    """Camera, hand-eye and corners, as the report has them; nothing without images."""
    made = await asyncio.to_thread(camera_section, calibration)
    if made is None:
        return
    with suppress(TaskcalError):  # of another campaign than the one that is chosen the corners are not there
        campaign = await asyncio.to_thread(read_measured, project, calibration.model.robot)
        made = await asyncio.to_thread(camera_section, calibration, campaign) or made
        if project.choices.images:
            folder = project.path(project.choices.images)
            made = await asyncio.to_thread(camera_section, calibration, campaign, folder) or made
    text("h2", texts("result.camera"))
    for block in made.blocks:
        if isinstance(block, Table):
            tabulated(block)
        elif isinstance(block, Chart):
            views = {block.title: block.figure} if isinstance(block.figure, Figure) else block.figure
            (name, first), *others = views.items()
            figure(name, first, texts, block.note)
            for name, drawn in others:
                with ui.element("details"):
                    text("summary", name)
                    figure(name, drawn, texts)


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
    tabulated(Table.of(texts("result.worst", count=len(rows)), columns, rows), [int(row) for row, _ in rows])


def _in_space(
    measured: MeasuredRows, calibration: Calibration, meshes: RobotMeshes | None, selection: Selection, texts: Texts
) -> None:
    """The robot at the selected row, and residuals as lines from where its targets were predicted to be."""
    points, rows, targets = measured.cloud
    left = calibration.residuals[rows, targets, :3] @ calibration.T_tracker_base[:3, :3]
    sizes = np.linalg.norm(left, axis=1)
    largest = np.argsort(-sizes)[:MAX_ARROWS]
    text("h2", texts("result.space"))
    view = CellView(
        calibration.model.robot,
        calibration.q,
        meshes=meshes,
        cloud=points,
        on_pick=lambda number: selection.choose(int(rows[number])),
        instruments=measured.standing,
        targets=len(calibration.targets),
    )

    def tell(row: int) -> str:
        seen = [
            (name, " ".join(texts.number(value, "+.4f") for value in (at[:3] * 1e3).tolist()))
            for name, at in zip(calibration.targets, calibration.residuals[row], strict=True)
            if np.isfinite(at[:3]).all()
        ]
        said = "; ".join(f"{name} {at} mm" for name, at in seen)
        return f"{texts('result.row')} {calibration.ids[row]}: {said}"

    fitting = LONGEST_ARROW * view.size / max(sizes.max(), 1e-9)
    step = max(int(np.searchsorted(SCALES, fitting, side="right")) - 1, 0)
    view.draw_arrows(largest.tolist(), left[largest], float(SCALES[step]))
    label = texts("result.space_of", count=len(points))
    RowPlayer(
        *(view, calibration.q, selection, label, texts),
        tell=tell,
        beams=lambda row, _: measured.beams(row),
        points=measured.at,
    )
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
    hint = texts("measurements.pick") if len(points) <= MAX_PICKED else texts("measurements.too_many")
    text("p", hint).classes("quiet")
    facts([(texts("result.drawn"), f"{len(largest)} / {len(points)}")])
