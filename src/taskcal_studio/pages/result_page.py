"""The result: errors before, after and on rows that were held out; what is left of them, by row and in space."""

import asyncio
from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import Any

import numpy as np
from nicegui import ui

from taskcal.correction.verdict import judge
from taskcal.errors import TaskcalError
from taskcal.export.camera import Pictured
from taskcal.identification.calibration import Calibration, load_calibration
from taskcal.report.calibration import calibration_sections
from taskcal.report.content import Column, Section, TextTable, Viewer, millimetres
from taskcal.task.task import load_task
from taskcal_studio.controls import ValueInput, facts, line_of_text, tabulated, text
from taskcal_studio.measured_rows import MeasuredRows, fitted_rows
from taskcal_studio.project import Project
from taskcal_studio.results import contents, read_measured
from taskcal_studio.robot_meshes import RobotMeshes, meshes_if_sound
from taskcal_studio.runs import Studio
from taskcal_studio.sections import show_sections
from taskcal_studio.selection import RowSelection
from taskcal_studio.steps import choose_calibration, link, show_error
from taskcal_studio.texts import Texts
from taskcal_studio.verdict import latest, show_verdict
from taskcal_studio.views import MAX_PICKED, CellView, RowPlayer

OPEN_SECTIONS = 2
"""Summary and held-out error, which are shown at once; the others on demand."""

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
    judged = await _verdict(calibration, project, texts)
    chosen, note = choices.calibration, choices.notes.get(choices.calibration, "")
    line_of_text(texts("result.note"), note, lambda given: project.annotate(chosen, given))
    sections = await asyncio.to_thread(_sections, calibration, judged, project)
    measured = await asyncio.to_thread(fitted_rows, calibration)
    same = await asyncio.to_thread(contents, project)
    drawn_as = meshes_if_sound(project) if calibration.provenance.robot_digest == same["robot"] else None
    with RowSelection(len(calibration.q)) as selection:

        def in_space(_: Viewer) -> None:
            if measured is not None:
                _in_space(measured, calibration, drawn_as, selection, texts)

        show_sections(sections, texts, folded=OPEN_SECTIONS, scene=in_space)
        with ui.element("details"):
            text("summary", texts("result.left"))
            _by_row(calibration, texts)


def _sections(calibration: Calibration, judged: Mapping[str, Any] | None, project: Project) -> Sequence[Section]:
    """Sections as the report has them, with the corners of the chosen campaign where it is the one that was fitted."""
    folders = [project.path(images)] if (images := project.choices.images) else []
    for folder in (*folders, None) if Pictured.of(calibration) is not None else ():
        with suppress(TaskcalError):  # of another campaign than the one that is chosen the corners are not there
            campaign = read_measured(project, calibration.model.robot)
            return calibration_sections(calibration, judged=judged, campaign=campaign, images=folder)
    return calibration_sections(calibration, judged=judged)


async def _verdict(calibration: Calibration, project: Project, texts: Texts) -> Mapping[str, Any] | None:
    """Show whether the expected error keeps the task's tolerance; the verdict, if there is a task."""
    chosen = project.choices.task
    if not chosen:
        with text("p", texts("verdict.needs_task") + " "):
            link(texts("task.title"), "/task")
        return None
    try:
        task = load_task(project.path(chosen))
        verdict = await asyncio.to_thread(judge, calibration, task)
    except TaskcalError as error:
        show_error(project, error)
        return None
    judged = latest(verdict.summary(), project)
    show_verdict(judged, texts)
    return judged


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
    tabulated(TextTable.of(texts("result.worst", count=len(rows)), columns, rows), [int(row) for row, _ in rows])


def _in_space(
    measured: MeasuredRows, calibration: Calibration, meshes: RobotMeshes | None, selection: RowSelection, texts: Texts
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
