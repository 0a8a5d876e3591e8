"""Identification: which model, what is held out, and how far the fit is; models side by side."""

import asyncio
from collections.abc import Mapping
from contextlib import suppress
from datetime import datetime
from pathlib import Path
from typing import Any

from nicegui import ui

from taskcal.errors import TaskcalError
from taskcal.identification.calibration import load_calibration
from taskcal.identification.effects import tracker_error
from taskcal.report.calibration import ERRORS
from taskcal.report.content import Column, TextTable, moment
from taskcal.report.fit import may_have_effects
from taskcal_studio.controls import button, facts, headline, line_of_text, message, tabulated, text
from taskcal_studio.option_form import of_project, option_fields
from taskcal_studio.project import LAYOUT, LONGEST, Project, free_name, plain_name
from taskcal_studio.results import changed_since, contents, options_of_images, read_measured, read_result
from taskcal_studio.runs import Studio
from taskcal_studio.stated_options import arguments, asked, offered, stated_or_begun
from taskcal_studio.steps import begin, is_running, show_run
from taskcal_studio.texts import Texts

MODELS = {"none": "geometry", "auto": "auto"}
"""Names of the effects of a choice in the name of a calibration; others are listed by the user."""


async def build(studio: Studio, texts: Texts) -> None:
    """Fill the page."""
    project = studio.project
    choices = project.choices
    result = result_of_fit(project, choices.calibration)
    if result is not None and result["held_out"]:
        left, before = (texts.number(result[of]["mean_mm"], ".3f") for of in ("held_out", "nominal"))
        said = texts("identify.headline", name=Path(choices.calibration).stem, nominal=before)
        headline(f"{left} mm", said)
    facts([(texts("robot.title"), choices.robot), (texts("measurements.title"), choices.campaign)])
    text("h2", texts("identify.model"))
    _choose(project, texts)
    if not is_running(show_run(studio, "identify", texts)):
        button(texts("identify.fit"), lambda: begin_fit(studio))
    await _offer(studio, texts)
    _compare(project, texts)


async def _offer(studio: Studio, texts: Texts) -> None:
    """Offer the fit with effects where the chosen one, of the chosen rows, leaves more than the tracker's noise."""
    project = studio.project
    result = result_of_fit(project, project.choices.calibration)
    if result is None or is_running(studio.run_of("identify")):
        return
    noise_mm = await asyncio.to_thread(_noise_of_one_with_effects, project, result)
    if noise_mm is None:
        return
    left = texts.number((result["held_out"] or result["fitted"])["mean_mm"], ".3f")
    message(texts("identify.effects_may", left=left, noise=texts.number(noise_mm, ".3f")), fine=True)
    button(texts("identify.with_effects"), lambda: _with_effects(studio), plain=True)


def _noise_of_one_with_effects(project: Project, result: Mapping[str, Any]) -> float | None:
    """Mean error by the tracker's noise alone, millimetres, where a calibration may have effects; None where it may not."""
    with suppress(TaskcalError):  # it is read on the pages of measurements and result, which say why it is not
        if changed_since(project, project.choices.calibration, contents(project)):
            return None
        calibration = load_calibration(project.path(project.choices.calibration))
        campaign = read_measured(project, calibration.model.robot)
        noise_mm = tracker_error(campaign) * 1e3
        return noise_mm if may_have_effects(calibration, result, noise_mm) else None
    return None


def _with_effects(studio: Studio) -> None:
    studio.project.state("identify", "effects", "auto")
    begin_fit(studio)


def _choose(project: Project, texts: Texts) -> None:
    choices, stated = project.choices, of_project(project, "identify")
    option_fields(project, texts, stated, "effects")
    line_of_text(texts("identify.fit_name"), choices.fit_name, lambda name: project.choose(fit_name=name[:LONGEST]))
    with ui.element("details"):
        text("summary", texts("identify.more"))
        option_fields(project, texts, stated, *(name for name in offered("identify") if name != "effects"))


def arguments_of(project: Project) -> tuple[list[str], str]:
    """Arguments of ``taskcal`` for a fit, and the calibration that it writes, which is none that there is."""
    choices = project.choices
    texts = stated_or_begun("identify", choices.options)
    model = MODELS.get(texts["effects"], "listed")
    named = plain_name(f"{choices.fit_name or f'{Path(choices.campaign).stem}-{model}'}.json", [".json"])
    calibration = f"{LAYOUT.calibrations}/{free_name(named, [Path(path).name for path in project.calibrations()])}"
    given = {"campaign": choices.campaign, "robot": choices.robot, "output": calibration, **options_of_images(project)}
    return asked("identify", arguments("identify", choices.options), **given), calibration


def begin_fit(studio: Studio) -> None:
    """Fit as chosen."""
    arguments, calibration = arguments_of(studio.project)
    chosen = {"calibration": calibration}
    begin(studio, "identify", arguments, outputs=[calibration], chosen=chosen, page="identify")


def result_of_fit(project: Project, calibration: str) -> Mapping[str, Any] | None:
    """Read what the command line printed of a calibration."""
    return read_result(project, calibration, "nominal", "fitted", "held_out")


def _compare(project: Project, texts: Texts) -> None:
    """The calibrations that there are, side by side."""
    found = {path: result_of_fit(project, path) for path in project.calibrations()}
    notes = project.choices.notes
    rows = [
        {"name": Path(path).stem, "note": notes.get(path, ""), "written": project.path(path).stat().st_mtime, **result}
        for path, result in found.items()
        if result is not None
    ]
    if not rows:
        return
    rows.sort(key=lambda row: row["written"])
    errors = {str(column.value): column for column in ERRORS}

    def error(title: str, sample: str, key: str) -> Column:
        return Column(texts(f"identify.{title}"), lambda row: errors[key].of(row[sample] or {}), errors[key].form)

    columns = (
        Column(texts("identify.name"), "name"),
        Column(
            texts("identify.written"), lambda row: moment(f"{datetime.fromtimestamp(row['written']):%Y-%m-%dT%H:%M}")
        ),
        Column(texts("identify.of"), lambda row: row.get("campaign", "")),
        Column(texts("identify.rows"), "rows", "d"),
        Column(texts("identify.parameters"), lambda row: len(row["parameters"]), "d"),
        error("nominal", "nominal", "mean_mm"),
        error("fitted", "fitted", "mean_mm"),
        error("unseen", "held_out", "mean_mm"),
        error("largest", "held_out", "max_mm"),
        Column(texts("identify.note"), "note", optional=True),
    )
    text("h2", texts("identify.side_by_side"))
    tabulated(TextTable.of(texts("identify.errors"), columns, rows), texts=texts)
