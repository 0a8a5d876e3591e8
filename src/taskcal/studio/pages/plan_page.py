"""The plan: which poses to measure, what error to expect after it, and a program that goes there."""

import json
import re
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any
from urllib.parse import quote

from nicegui import ui

from taskcal.errors import TaskcalError
from taskcal.files import write_whole
from taskcal.studio.command_run import CommandRun, Status
from taskcal.studio.controls import button, facts, message, number, set_attribute, text
from taskcal.studio.project import LAYOUT, RESULT, Choices, Project
from taskcal.studio.run_panel import show_run
from taskcal.studio.studio import Studio
from taskcal.studio.texts import Texts

LONGEST_STEM = 20
"""Characters of a task's name in that of its plan; names of RAPID modules have 28 at most."""


async def build(studio: Studio, texts: Texts) -> None:
    """Fill the page."""
    project = studio.project
    choices = project.choices
    missing = [page for page, chosen in (("robot", choices.robot), ("task", choices.task)) if not chosen]
    for page in missing:
        text("p", texts("identify.missing"))
        text("a", texts(f"{page}.title")).props(f"href=/{page}")
    if missing:
        return
    facts([(texts("robot.title"), choices.robot), (texts("task.title"), choices.task)])
    label = texts("plan.count")
    number(label, choices.poses, lambda value: project.choose(poses=int(value)), low=1, high=2000, step="1")
    run = show_run(studio, "plan", texts)
    if run is None or run.status is not Status.running:
        button(texts("plan.plan"), lambda: _begin(studio))
    result = _read_result(project, choices)
    if result is not None:
        _show(result, project, texts)


def plan_of(choices: Choices) -> str:
    """Where the plan of a task is kept; its program is a module of the same name, as RAPID lets it be."""
    stem = re.sub(r"[^A-Za-z0-9]", "_", Path(choices.task).stem)[:LONGEST_STEM]
    return f"{LAYOUT.plans}/m_{stem}_{choices.poses}.csv"


def arguments_of(choices: Choices) -> list[str]:
    """What ``taskcal`` is called with for a plan."""
    plan = plan_of(choices)
    beside = plan.removesuffix(".csv")
    options = [
        f"--robot={choices.robot}",
        "--task",
        choices.task,
        "--count",
        str(choices.poses),
        f"--seed={choices.seed}",
    ]
    return ["plan", *options, "--output", plan, "--program", f"{beside}.mod", "--report", f"{beside}.html", "--json"]


def _begin(studio: Studio) -> None:
    project = studio.project
    choices = project.choices

    async def keep(run: CommandRun) -> None:
        write_whole(project.path(plan_of(choices) + RESULT), run.output)

    try:
        project.path(LAYOUT.plans).mkdir(exist_ok=True)
        studio.start("plan", arguments_of(choices), keep)
    except (OSError, TaskcalError) as error:
        message(str(error))
        return
    ui.navigate.reload()


def _read_result(project: Project, choices: Choices) -> Mapping[str, Any] | None:
    """What the command line said of the plan of this task and count."""
    with suppress(OSError, ValueError, TaskcalError):
        content = json.loads(project.path(plan_of(choices) + RESULT).read_text(encoding="utf-8"))
        if isinstance(content, dict) and {"expected_error_mm", "random_expected_error_mm"} <= content.keys():
            return content
    return None


def _show(result: Mapping[str, Any], project: Project, texts: Texts) -> None:
    """What to expect of the plan, and its files."""
    text("h2", texts("plan.expected"))
    facts(
        [
            (texts("plan.planned"), f"{result['expected_error_mm']:.4f} mm"),
            (texts("plan.random"), f"{result['random_expected_error_mm']:.4f} mm"),
        ]
    )
    plan = str(result["plan"])
    beside = plan.removesuffix(".csv")
    with ui.element("div").classes("row"):
        for path in project.files(LAYOUT.plans, (".csv", ".mod", ".html")):
            if path in (plan, f"{beside}.mod", f"{beside}.html"):
                link = text("a", texts("program.download", name=Path(path).name)).classes("act plain")
                set_attribute(link, "href", f"/file/{quote(path)}?keep=1")
