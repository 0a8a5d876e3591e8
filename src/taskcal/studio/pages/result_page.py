"""The result: errors before, after and on rows that were held out; what is left of them, by row and in space."""

import asyncio
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float, Int
from nicegui import ui

from taskcal.errors import TaskcalError
from taskcal.identification.calibration import Calibration, load_calibration
from taskcal.identification.validation import measured_errors
from taskcal.report.calibration import (
    describe_held_out,
    draw_over_joints,
    tabulate_errors,
    tabulate_left_out,
    tabulate_outliers,
    tabulate_parameters,
)
from taskcal.studio.controls import ValueInput, choice, facts, message, table, tabulated, text
from taskcal.studio.pages.identify_page import read_result
from taskcal.studio.pages.measurements_page import in_project
from taskcal.studio.project import Project
from taskcal.studio.studio import Studio
from taskcal.studio.texts import Texts
from taskcal.studio.views import PointView, add_views, figure
from taskcal.task.task import load_task

WORST = 20
"""Rows that are listed."""

STRETCH_S = 0.1
"""Between two lengths of the lines."""

STRETCH_STEP = 0.25
"""Of the slider of their scale, which is logarithmic."""

LONGEST_ARROW = 0.25
"""Of the size of the cloud, of the longest line to begin with."""

MOST_ARROWS = 400
"""Residuals that are drawn as lines, the largest; of the others the points alone."""


async def build(studio: Studio, texts: Texts) -> None:
    """Fill the page."""
    project = studio.project
    choices = project.choices
    found = {path: Path(path).stem for path in project.calibrations()}
    if not found:
        text("p", texts("result.none"))
        text("a", texts("identify.title")).props("href=/identify")
        return

    def take(path: str) -> None:
        project.choose(calibration=path)
        ui.navigate.reload()

    choice(texts("result.choose"), found, choices.calibration, take)
    if choices.calibration not in found:
        return
    try:
        calibration = await asyncio.to_thread(load_calibration, project.path(choices.calibration))
    except TaskcalError as error:
        message(in_project(str(error), project))
        return
    result = read_result(project, choices.calibration)
    if result is None:
        message(texts("result.no_errors"), fine=True)
    else:
        _errors(result, calibration, texts)
        _tolerance(result, project, texts)
    for remark in calibration.remarks:
        message(remark, fine=True)
    for shown in (tabulate_left_out(calibration), tabulate_outliers(calibration)):
        if len(shown):
            tabulated(shown)
    _by_row(calibration, texts)
    placed = await asyncio.to_thread(_place, calibration)
    if placed is not None:
        _in_space(placed, calibration, texts)
    errors = await asyncio.to_thread(measured_errors, calibration)
    if errors is not None:
        figure(texts("result.by_joint"), draw_over_joints(calibration, errors), texts("result.by_joint_note"))
    with ui.element("details"):
        text("summary", texts("result.parameters"))
        tabulated(tabulate_parameters(calibration))


def _errors(result: Mapping[str, Any], calibration: Calibration, texts: Texts) -> None:
    """The table that ``taskcal identify`` prints."""
    summaries = {texts("result.nominal"): result["nominal"], texts("result.fitted"): result["fitted"]}
    if result["held_out"] is not None:
        summaries[texts("result.unseen")] = result["held_out"]
    text("h2", texts("result.errors"))
    tabulated(tabulate_errors(texts("result.errors_of"), summaries, of=texts("result.of")))
    if calibration.held_out is not None:
        text("p", describe_held_out(calibration.held_out)).classes("quiet")


def _tolerance(result: Mapping[str, Any], project: Project, texts: Texts) -> None:
    """Whether rows that were not fitted keep the tolerance of the task."""
    task = project.choices.task
    if not task or result["held_out"] is None:
        return
    try:
        tolerance = load_task(project.path(task)).accuracy
    except TaskcalError as error:
        message(in_project(str(error), project))
        return
    if tolerance is None:
        return
    largest = result["held_out"]["max_mm"]
    met = largest <= tolerance * 1e3
    said = texts(
        "result.met" if met else "result.not_met", largest=f"{largest:.3f}", tolerance=f"{tolerance * 1e3:g}", task=task
    )
    text("p", said).classes("good" if met else "bad")


def _by_row(calibration: Calibration, texts: Texts) -> None:
    residuals = calibration.residuals[:, :, :3] * 1e3
    sizes = np.linalg.norm(residuals, axis=2)
    order = np.argsort(-np.nan_to_num(sizes, nan=-1.0), axis=None)[: min(WORST, int(np.isfinite(sizes).sum()))]
    rows: list[tuple[str, ...]] = []
    for row, target in zip(*np.unravel_index(order, sizes.shape), strict=True):
        numbers = [f"{value:+.4f}" for value in residuals[row, target]]
        rows.append((calibration.ids[row], calibration.targets[target], *numbers, f"{sizes[row, target]:.4f}"))
    text("h2", texts("result.left"))
    header = [texts("result.row"), texts("result.target"), "x mm", "y mm", "z mm", texts("result.size")]
    table(texts("result.worst", count=len(rows)), header, rows, words=(0, 1))


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
    """Where residuals are in space; None where that cannot be told, or nothing was seen."""
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
    largest = np.argsort(-sizes)[:MOST_ARROWS]

    text("h2", texts("result.space"))

    def pick(number: int) -> None:
        view.mark([number])
        x, y, z = left[number] * 1e3
        name = f"{texts('result.row')} {calibration.ids[rows[number]]}, {calibration.targets[targets[number]]}"
        picked.set_text(f"{name}: {x:+.4f} {y:+.4f} {z:+.4f} mm")

    view = PointView(points, pick)
    fitting = LONGEST_ARROW * view.size / max(sizes.max(), 1e-9)
    power = float(np.clip(np.floor(np.log10(fitting) / STRETCH_STEP) * STRETCH_STEP, 0.0, 5.0))
    view.draw_arrows(largest.tolist(), left[largest], 10.0**power)
    with ui.element("div").classes("row"):
        add_views(view.scene, view.look, texts("result.space_of", count=len(points)), texts)
        with ui.element("label").classes("row"):
            text("span", texts("result.scale"))
            slider = ValueInput(
                "range", texts("result.scale"), f"{power:g}", min="0", max="5", step=f"{STRETCH_STEP:g}"
            )
            shown = text("span", f"× {10**power:.0f}")

    def stretch(given: str) -> None:
        scale = 10.0 ** float(np.clip(float(given), 0.0, 5.0))
        slider.show(f"{np.log10(scale):g}")
        shown.set_text(f"× {scale:.0f}")
        view.stretch_arrows(scale)

    slider.on_moved(stretch, STRETCH_S)
    picked = text("p", texts("measurements.pick")).props("role=status")
    facts([(texts("result.drawn"), f"{len(largest)} / {len(points)}")])
