"""The plan: which poses to measure, what error to expect after it, and a program that goes there."""

import asyncio
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float
from nicegui import ui

from robot_programs.languages import languages
from taskcal.geometry import se3
from taskcal.kinematics.clearance import place_links
from taskcal.observations.point import Station
from taskcal.report.chart import GREEN, ORANGE, Axis, Figure, Panel, Series
from taskcal.report.content import Column, Table
from taskcal.report.plan import MAX_OVER_BEFORE
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot import Robot
from taskcal.tables.forms import read_csv
from taskcal_studio.controls import button, facts, headline, message, tabulated, text
from taskcal_studio.editors import StationEditor
from taskcal_studio.option_form import of_project, option_fields
from taskcal_studio.project import LAYOUT, Choices, Project
from taskcal_studio.results import plan_of, program_of, read_result, robot_of
from taskcal_studio.robot_meshes import meshes_if_sound
from taskcal_studio.runs import Studio
from taskcal_studio.selection import Selection
from taskcal_studio.stated_options import OF_IMAGES, OF_TRACKER, arguments, asked, offered
from taskcal_studio.steps import begin, choose_file, choose_or_drop, download, is_running, show_run
from taskcal_studio.texts import Texts
from taskcal_studio.views import NOWHERE, CellView, RowPlayer, figure

RESULT_KEYS = (
    "expected_error_mm",
    "random_expected_error_mm",
    "grid_expected_error_mm",
    "by_count_mm",
    "lost",
    "candidates",
)
RESULT_KEYS += ("plan",)
"""Keys that the page needs of what the command printed."""


async def build(studio: Studio, texts: Texts) -> None:
    """Fill the page."""
    project = studio.project
    choices = project.choices
    result = read_result(project, plan_of(choices), *RESULT_KEYS)
    if result is not None:
        _show(result, project, texts)
    facts([(texts("robot.title"), choices.robot), (texts("task.title"), choices.task)])
    by = {name: texts(f"plan.by_{name}") for name in ("tracker", "pixels")}
    choose_file(project, texts, "observe", by)
    stated = of_project(project, "plan")
    option_fields(project, texts, stated, "count", "seed", *(OF_TRACKER if choices.observe == "tracker" else ()))
    with ui.element("details"):
        text("summary", texts("identify.more"))
        shown = {"count", "seed", *OF_TRACKER, *OF_IMAGES}
        option_fields(project, texts, stated, *(name for name in offered("plan") if name not in shown))
    known = {one.name: f"{one.name} ({one.composed[0]})" for one in languages() if one.composed}
    choose_file(project, texts, "language", known, none=texts("plan.no_program"))
    if choices.observe == "pixels":
        _images(project, texts)
    robot = await asyncio.to_thread(robot_of, project)
    editor = StationEditor(project, robot, texts)
    text("h2", texts("plan.poses_chosen"))
    if not is_running(show_run(studio, "plan", texts)):
        button(texts("plan.plan"), lambda: begin_plan(studio))
    if result is not None:
        await _poses(result, project, robot, editor.station, texts)


def _images(project: Project, texts: Texts) -> None:
    """What a plan for images has to know: the board, the camera, where they are, and when an image counts."""
    text("h2", texts("plan.images"))
    text("p", texts("plan.images_how")).classes("quiet")
    choose_or_drop(project, texts, "board")
    choose_or_drop(project, texts, "camera", none=texts("station.none"))
    with ui.element("details"):
        text("summary", texts("plan.placed"))
        choose_or_drop(project, texts, "fixtures", none=texts("plan.before_task"))
        images = (name for name in offered("plan") if name in OF_IMAGES)
        option_fields(project, texts, of_project(project, "plan"), *images)


def arguments_of(choices: Choices) -> list[str]:
    """Arguments of ``taskcal`` for a plan."""
    plan, program, report = files_of(choices)
    given = {"robot": choices.robot, "task": choices.task, "station": choices.station}
    pictured = choices.observe == "pixels"
    if pictured:
        given |= {"observe": "pixels", "board": choices.board, "camera": choices.camera, "landmarks": choices.fixtures}
    stated = arguments("plan", choices.options, without=OF_TRACKER if pictured else OF_IMAGES)
    return asked("plan", stated, **given, output=plan, program=program, report=report)


def files_of(choices: Choices) -> tuple[str, str, str]:
    """Table, program and report of a plan; no program where none is to be written."""
    plan = plan_of(choices)
    return plan, program_of(plan, choices.language), f"{plan.removesuffix('.csv')}.html"


def begin_plan(studio: Studio) -> None:
    """Plan as chosen."""
    choices = studio.project.choices
    begin(studio, "plan", arguments_of(choices), outputs=[one for one in files_of(choices) if one], page="plan")


def _show(result: Mapping[str, Any], project: Project, texts: Texts) -> None:
    """Show the expected error of the plan, and its files."""
    count, error = result["count"], texts.number(result["expected_error_mm"], ".4f")
    headline(texts("plan.headline", error=error), texts("plan.headline_of", count=count))
    facts(
        [
            (texts("plan.random"), f"{texts.number(result['random_expected_error_mm'], '.4f')} mm"),
            (texts("plan.grid"), f"{texts.number(result['grid_expected_error_mm'], '.4f')} mm"),
        ]
    )
    lost = ", ".join(f"{number} {texts.named('lost', reason)}" for reason, number in result["lost"].items() if number)
    kept = result["candidates"]
    text("p", texts("plan.fell_away", kept=kept, lost=lost or texts("plan.none_fell"))).classes("quiet")
    figure(texts("plan.by_count"), _draw_by_count(result, texts), texts, texts("plan.flat"))
    present = project.files(LAYOUT.plans)
    with ui.element("div").classes("row"):
        for path in (result["plan"], *result.get("programs", ()), result.get("report")):
            if path in present:
                download(texts, path)
    if fixtures := result.get("standing"):
        _placed(fixtures, result.get("not_clear_from_the_pose_before", ()), texts)


def _placed(fixtures: Sequence[Mapping[str, Any]], unclear: Sequence[Mapping[str, Any]], texts: Texts) -> None:
    """Where boards or camera are planned for, what to do with the plan, and ways between poses that are not clear."""
    rows = [
        (
            one["name"],
            *(texts.number(v, ".0f") for v in one["position_mm"]),
            *(texts.number(round(v, 2) + 0.0, ".2f") for v in one["direction"]),
        )
        for one in fixtures
    ]
    header = (texts("plan.fixture"), "x mm", "y mm", "z mm", "i", "j", "k")
    tabulated(Table.of_rows(texts("plan.fixtures"), header, rows))
    text("p", texts("plan.take_images"))
    for found in (True, False):
        poses = [str(one["pose"]) for one in unclear if one["way_round"] == found]
        if poses:
            message(texts("plan.way_round" if found else "plan.no_way", poses=", ".join(poses)), fine=found)


def _draw_by_count(result: Mapping[str, Any], texts: Texts) -> Figure:
    """The expected error after so many poses."""
    errors, count = np.array(result["by_count_mm"], dtype=float), result["count"]
    shown = errors <= MAX_OVER_BEFORE * result["before_mm"]
    numbers = np.arange(1, len(errors) + 1)[shown]
    others = (
        Series(name=texts(f"plan.{key}"), x=[count], y=[result[f"{key}_expected_error_mm"]], colour=colour, shape=shape)
        for key, colour, shape in (("random", ORANGE, "square"), ("grid", GREEN, "triangle"))
    )
    series = (Series(kind="line", name=texts("plan.planned"), x=numbers, y=errors[shown]), *others)
    return Figure(
        panels=(Panel(x=Axis(title=texts("plan.poses_axis"), whole=True), y=Axis(unit="mm", log=True), series=series),)
    )


async def _poses(
    result: Mapping[str, Any], project: Project, robot: Robot, station: Station | None, texts: Texts
) -> None:
    """The robot at the planned poses, and what is known of each."""
    text("h2", texts("plan.poses"))
    planned_for = result.get("station", "")
    if planned_for != project.choices.station:
        message(texts("plan.other_station", station=planned_for or texts("station.none")))
    q, ids = await asyncio.to_thread(read_plan, project.path(str(result["plan"])), robot)
    known = of_poses(result, len(q))
    told = [
        ". ".join(
            (texts("player.at", id=name, count=len(q)), *(f"{texts(f'plan.{k}')}: {v[i]}" for k, v in known.items()))
        )
        for i, name in enumerate(ids)
    ]
    meshes = await asyncio.to_thread(meshes_if_sound, project)
    with Selection(len(q)) as selection:
        view = CellView(
            robot,
            q,
            meshes=meshes,
            instruments=NOWHERE if station is None else station.position[None],
            targets=0 if station is None else len(station.reflectors),
            keep_out=() if station is None else station.keep_out,
        )
        beams = None if station is None else partial(_beams, station, ErrorModel(robot))
        RowPlayer(view, q, selection, texts("plan.poses"), texts, tell=told.__getitem__, beams=beams)
        text("p", texts("plan.modelled" if robot.link_radii else "plan.no_radii")).classes("quiet")
        if known:
            with ui.element("details"):
                text("summary", texts("plan.each_pose"))
                columns = (
                    Column("id", ids.__getitem__),
                    *(
                        Column(texts(f"plan.{key}"), values.__getitem__, "" if key == "visible" else "s")
                        for key, values in known.items()
                    ),
                )
                tabulated(Table.of(texts("plan.poses"), columns, range(len(ids))), range(len(ids)))


def _beams(
    station: Station, model: ErrorModel, _: int | None, q: Float[np.ndarray, " joints"]
) -> tuple[Float[np.ndarray, " 3"], Float[np.ndarray, "k 3"]]:
    """Where the tracker stands, and the reflectors that it sees with the robot at q."""
    T = model.nominal.poses(q[None])
    seen = station.visible(T, place_links(model, q[None]))[0]
    return station.position, se3.apply(T[0], station.offsets)[seen]


def of_poses(result: Mapping[str, Any], count: int) -> Mapping[str, Sequence[str]]:
    """Statements of the command line on each of so many poses, by kind: gaps, what an image shows, reflectors that are seen."""
    found = {**result.get("clearance_mm", {}), **result.get("views", {})}
    gaps = {name: [f"{gap:.0f}" for gap in gaps] for name, gaps in found.items() if gaps is not None}
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
