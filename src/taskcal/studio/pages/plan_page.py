"""The plan: which poses to measure, what error to expect after it, and a program that goes there."""

import asyncio
import json
import re
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np
import plotly.graph_objects as go
from jaxtyping import Float
from nicegui import ui

from taskcal.errors import TaskcalError
from taskcal.io.files import write_whole
from taskcal.report.theme import BLUE, GREEN, ORANGE, styled, with_decades
from taskcal.robot.robot import Robot
from taskcal.studio.controls import button, facts, message, number, set_attribute, table, text
from taskcal.studio.editors import StationEditor
from taskcal.studio.pages.measurements_page import in_project
from taskcal.studio.pages.robot_page import robot_of
from taskcal.studio.project import LAYOUT, RESULT, Choices, Project
from taskcal.studio.run_panel import show_run
from taskcal.studio.runs import CommandRun, Status
from taskcal.studio.studio import Studio
from taskcal.studio.texts import Texts
from taskcal.studio.views import PosePlayer, figure
from taskcal.tables.forms import read_csv
from taskcal.virtual.station import Station

LONGEST_STEM = 20
"""Characters of a task's name in that of its plan; names of RAPID modules have 28 at most."""


MOST_OVER_BEFORE = 3.0
"""Expected errors that are drawn, over that before; the first few poses do not even find the frames."""


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
    try:
        robot = await asyncio.to_thread(robot_of, project)
    except TaskcalError as error:
        message(in_project(str(error), project))
        return
    editor = StationEditor(project, robot, texts, lambda error: in_project(str(error), project))
    text("h2", texts("plan.poses_chosen"))
    run = show_run(studio, "plan", texts)
    if run is None or run.status is not Status.running:
        button(texts("plan.plan"), lambda: _begin(studio))
    result = _read_result(project, choices)
    if result is not None:
        _show(result, project, texts)
        await _poses(result, project, robot, editor.station, texts)


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
    options += ["--station", choices.station] if choices.station else []
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
    wanted = {
        "expected_error_mm",
        "random_expected_error_mm",
        "grid_expected_error_mm",
        "by_count_mm",
        "lost",
        "candidates",
        "plan",
        "clearance_mm",
    }
    with suppress(OSError, ValueError, TaskcalError):
        content = json.loads(project.path(plan_of(choices) + RESULT).read_text(encoding="utf-8"))
        if isinstance(content, dict) and wanted <= content.keys():
            return content
    return None


def _show(result: Mapping[str, Any], project: Project, texts: Texts) -> None:
    """What to expect of the plan, and its files."""
    text("h2", texts("plan.expected"))
    facts(
        [
            (texts("plan.planned"), f"{result['expected_error_mm']:.4f} mm"),
            (texts("plan.random"), f"{result['random_expected_error_mm']:.4f} mm"),
            (texts("plan.grid"), f"{result['grid_expected_error_mm']:.4f} mm"),
        ]
    )
    lost = ", ".join(f"{number} {texts.named('lost', reason)}" for reason, number in result["lost"].items() if number)
    kept = result["candidates"]
    text("p", texts("plan.fell_away", kept=kept, lost=lost or texts("plan.none_fell"))).classes("quiet")
    figure(texts("plan.by_count"), _draw_by_count(result, texts), texts("plan.flat"))
    plan = str(result["plan"])
    beside = plan.removesuffix(".csv")
    with ui.element("div").classes("row"):
        for path in project.files(LAYOUT.plans, (".csv", ".mod", ".html")):
            if path in (plan, f"{beside}.mod", f"{beside}.html"):
                link = text("a", texts("program.download", name=Path(path).name)).classes("act plain")
                set_attribute(link, "href", f"/file/{quote(path)}?keep=1")


def _draw_by_count(result: Mapping[str, Any], texts: Texts) -> go.Figure:
    """The expected error after so many poses."""
    errors, count = np.array(result["by_count_mm"], dtype=float), result["count"]
    shown = errors <= MOST_OVER_BEFORE * result["before_mm"]
    drawn = go.Figure()
    drawn.add_scatter(
        x=np.arange(1, len(errors) + 1)[shown],
        y=errors[shown],
        mode="lines",
        name=texts("plan.planned"),
        line={"color": BLUE},
    )
    for key, name, colour, symbol in (
        ("random_expected_error_mm", "random", ORANGE, "square"),
        ("grid_expected_error_mm", "grid", GREEN, "triangle-up"),
    ):
        drawn.add_scatter(
            x=[count], y=[result[key]], mode="markers", name=texts(f"plan.{name}"),
            marker={"color": colour, "symbol": symbol, "size": 11},
        )  # fmt: skip
    styled(drawn, height=380, top=90)
    drawn.update_xaxes(title_text=texts("plan.poses_axis"))
    return with_decades(drawn, "mm")


async def _poses(
    result: Mapping[str, Any], project: Project, robot: Robot, station: Station | None, texts: Texts
) -> None:
    """The robot at the planned poses, and what is known of each."""
    text("h2", texts("plan.poses"))
    planned_for = result.get("station", "")
    if planned_for != project.choices.station:
        message(texts("plan.other_station", station=planned_for or texts("station.none")))
    try:
        q, ids = await asyncio.to_thread(read_plan, project.path(str(result["plan"])), robot)
    except TaskcalError as error:
        message(in_project(str(error), project))
        return
    known = of_poses(result, len(q))
    told = [
        ". ".join(
            (texts("player.at", id=name, count=len(q)), *(f"{texts(f'plan.{k}')}: {v[i]}" for k, v in known.items()))
        )
        for i, name in enumerate(ids)
    ]
    PosePlayer(robot, q, told, texts("plan.poses"), texts, station)
    text("p", texts("plan.modelled" if robot.link_radii else "plan.no_radii")).classes("quiet")
    if known:
        with ui.element("details"):
            text("summary", texts("plan.each_pose"))
            header = ["id", *(texts(f"plan.{key}") for key in known)]
            rows = [(name, *(values[i] for values in known.values())) for i, name in enumerate(ids)]
            table(
                texts("plan.poses"), header, rows, words=(0, *(i for i, key in enumerate(known, 1) if key == "visible"))
            )


def of_poses(result: Mapping[str, Any], count: int) -> Mapping[str, Sequence[str]]:
    """What the command line said of each of so many poses, by what it is: gaps in millimetres, reflectors that are seen."""
    gaps = {name: [f"{gap:.0f}" for gap in gaps] for name, gaps in result["clearance_mm"].items() if gaps is not None}
    seen = {"visible": [", ".join(names) for names in result["visible"]]} if "visible" in result else {}
    return {name: values for name, values in {**gaps, **seen}.items() if len(values) == count}


def read_plan(path: Path, robot: Robot) -> tuple[Float[np.ndarray, "n joints"], list[str]]:
    """Joint positions of a plan, radians or metres, and the ids of its poses.

    Raises:
        FileError: it is not a plan of this robot.
    """
    written = read_csv(path)
    columns = [
        written.numbers(f"{name}_{'mm' if slides else 'deg'}")
        for name, slides in zip(robot.joint_names, robot.prismatic, strict=True)
    ]
    scale = np.where(robot.prismatic, 1e-3, np.pi / 180.0)
    return np.column_stack(columns) * scale, [str(number) for number in range(len(columns[0]))]
