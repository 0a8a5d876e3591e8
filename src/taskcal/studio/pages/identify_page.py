"""Identification: which model, what is held out, and how far the fit is; models side by side."""

import json
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from nicegui import ui

from taskcal.errors import TaskcalError
from taskcal.io.files import write_whole
from taskcal.report.calibration import ERRORS
from taskcal.studio.controls import button, choice, facts, line_of_text, message, number, table, text, tick
from taskcal.studio.project import LAYOUT, RESULT, Choices, Project
from taskcal.studio.run_panel import show_run
from taskcal.studio.runs import CommandRun, Status
from taskcal.studio.studio import Studio
from taskcal.studio.texts import Texts

MODELS = {"none": "geometry", "auto": "auto"}
"""How the effects of a choice are called in the name of a calibration; others are listed by the user."""


async def build(studio: Studio, texts: Texts) -> None:
    """Fill the page."""
    project = studio.project
    choices = project.choices
    missing = [page for page, chosen in (("robot", choices.robot), ("measurements", choices.campaign)) if not chosen]
    for page in missing:
        text("p", texts("identify.missing"))
        text("a", texts(f"{page}.title")).props(f"href=/{page}")
    if missing:
        return
    facts([(texts("robot.title"), choices.robot), (texts("measurements.title"), choices.campaign)])
    text("h2", texts("identify.model"))
    _choose(project, texts)
    run = show_run(studio, "identify", texts)
    if run is None or run.status is not Status.running:
        button(texts("identify.fit"), lambda: _begin(studio))
    _compare(project, texts)


def _choose(project: Project, texts: Texts) -> None:
    choices = project.choices
    own = "" if choices.effects in MODELS else choices.effects

    def take(effects: str) -> None:
        project.choose(effects=effects or "none")
        ui.navigate.reload()

    offered = {key: texts(f"identify.effects_{MODELS[key]}") for key in MODELS} | ({own: own} if own else {})
    choice(texts("identify.effects"), offered, choices.effects, take)
    with ui.element("details"):
        text("summary", texts("identify.more"))
        line_of_text(texts("identify.list"), own, take)
        tick(texts("identify.robust"), choices.robust, lambda value: project.choose(robust=value))
        number(
            texts("identify.holdout"),
            100.0 * choices.holdout,
            lambda value: project.choose(holdout=value / 100.0),
            low=0.0,
            high=90.0,
            step="5",
        )
        number(texts("identify.seed"), choices.seed, lambda v: project.choose(seed=int(v)), low=0, high=1e6, step="1")


def arguments_of(choices: Choices) -> tuple[list[str], str]:
    """What ``taskcal`` is called with for a fit, and the calibration that it writes."""
    model = MODELS.get(choices.effects, "listed") + ("-robust" if choices.robust else "")
    calibration = f"{LAYOUT.calibrations}/{Path(choices.campaign).stem}-{model}.json"
    options = [f"--robot={choices.robot}", f"--output={calibration}", f"--effects={choices.effects}"]
    options += ["--loss=huber"] if choices.robust else []
    options += [f"--holdout={choices.holdout:g}", f"--seed={choices.seed}"] if choices.holdout else []
    return ["identify", choices.campaign, *options, "--json"], calibration


def _begin(studio: Studio) -> None:
    project = studio.project
    arguments, calibration = arguments_of(project.choices)

    async def keep(run: CommandRun) -> None:
        write_whole(project.path(result_of(calibration)), run.output)
        project.choose(calibration=calibration)

    try:
        project.path(LAYOUT.calibrations).mkdir(exist_ok=True)
        studio.start("identify", arguments, keep)
    except (OSError, TaskcalError) as error:
        message(str(error))
        return
    ui.navigate.reload()


def result_of(calibration: str) -> str:
    """Where what the command line said of a calibration is kept."""
    return calibration.removesuffix(".json") + RESULT


def read_result(project: Project, calibration: str) -> Mapping[str, Any] | None:
    """What the command line said of a calibration; None where that is not there, as of one that was put here by hand."""
    with suppress(OSError, ValueError, TaskcalError):
        content = json.loads(project.path(result_of(calibration)).read_text(encoding="utf-8"))
        if isinstance(content, dict) and {"nominal", "fitted", "held_out"} <= content.keys():
            return content
    return None


def _compare(project: Project, texts: Texts) -> None:
    """The calibrations that there are, side by side."""
    rows: list[tuple[str, ...]] = []
    for calibration in project.calibrations():
        result = read_result(project, calibration)
        if result is None:
            continue
        means = [_error(result[key], "mean_mm") for key in ("nominal", "fitted")]
        unseen = [_error(result["held_out"], key) for key in ("mean_mm", "max_mm")]
        name = Path(calibration).stem
        rows.append((name, str(result["rows"]), str(len(result["parameters"])), *means, *unseen))
    if not rows:
        return
    text("h2", texts("identify.side_by_side"))
    header = [
        texts(f"identify.{key}") for key in ("name", "rows", "parameters", "nominal", "fitted", "unseen", "largest")
    ]
    table(texts("identify.errors"), header, rows)
    text("a", texts("identify.to_result")).props("href=/result").classes("act")


def _error(summary: Mapping[str, float] | None, key: str) -> str:
    """An error as the command line's table has it; a dash where nothing was held out."""
    return next(column.cell(summary or {}) for column in ERRORS if column.value == key)
