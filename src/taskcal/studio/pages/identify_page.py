"""Identification: which model, what is held out, and how far the fit is; models side by side."""

from collections.abc import Mapping
from datetime import datetime
from pathlib import Path
from typing import Any

from nicegui import ui

from taskcal.report.calibration import ERRORS
from taskcal.report.content import Column, Table
from taskcal.studio.controls import button, choice, facts, line_of_text, number, tabulated, text, tick
from taskcal.studio.project import LAYOUT, LONGEST, Project, free_name, plain_name
from taskcal.studio.results import options_of_images, read_result
from taskcal.studio.runs import Studio
from taskcal.studio.steps import begin, is_running, show_run
from taskcal.studio.texts import Texts

MODELS = {"none": "geometry", "auto": "auto"}
"""Names of the effects of a choice in the name of a calibration; others are listed by the user."""


async def build(studio: Studio, texts: Texts) -> None:
    """Fill the page."""
    project = studio.project
    choices = project.choices
    facts([(texts("robot.title"), choices.robot), (texts("measurements.title"), choices.campaign)])
    text("h2", texts("identify.model"))
    _choose(project, texts)
    if not is_running(show_run(studio, "identify", texts)):
        button(texts("identify.fit"), lambda: begin_fit(studio))
    _compare(project, texts)


def _choose(project: Project, texts: Texts) -> None:
    choices = project.choices
    own = "" if choices.effects in MODELS else choices.effects

    def take(effects: str) -> None:
        project.choose(effects=effects or "none")
        ui.navigate.reload()

    offered = {key: texts(f"identify.effects_{MODELS[key]}") for key in MODELS} | ({own: own} if own else {})
    choice(texts("identify.effects"), offered, choices.effects, take)
    line_of_text(texts("identify.fit_name"), choices.fit_name, lambda name: project.choose(fit_name=name[:LONGEST]))
    with ui.element("details"):
        text("summary", texts("identify.more"))
        line_of_text(texts("identify.list"), own, take)
        tick(texts("identify.robust"), choices.robust, lambda value: project.choose(robust=value))
        holdout = 100.0 * choices.holdout
        number(texts("identify.holdout"), holdout, lambda v: project.choose(holdout=v / 100.0), 0.0, 90.0, step="5")
        number(texts("identify.seed"), choices.seed, lambda v: project.choose(seed=int(v)), 0, 1e6, step="1")


def arguments_of(project: Project) -> tuple[list[str], str]:
    """Arguments of ``taskcal`` for a fit, and the calibration that it writes, which is none that there is."""
    choices = project.choices
    model = MODELS.get(choices.effects, "listed") + ("-robust" if choices.robust else "")
    named = plain_name(f"{choices.fit_name or f'{Path(choices.campaign).stem}-{model}'}.json", [".json"])
    calibration = f"{LAYOUT.calibrations}/{free_name(named, [Path(path).name for path in project.calibrations()])}"
    options = [f"--robot={choices.robot}", f"--output={calibration}", f"--effects={choices.effects}"]
    options += ["--loss=huber"] if choices.robust else []
    options += [f"--holdout={choices.holdout:g}", f"--seed={choices.seed}"] if choices.holdout else []
    return ["identify", choices.campaign, *options, *options_of_images(project), "--json"], calibration


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
        Column(texts("identify.written"), lambda row: f"{datetime.fromtimestamp(row['written']):%Y-%m-%d %H:%M}"),
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
    tabulated(Table.of(texts("identify.errors"), columns, rows))
