"""The plan: which poses to measure, what error to expect after it, and a program that goes there."""

import asyncio
from collections.abc import Mapping
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
from taskcal.report.plan import plan_sections, tabulate_poses
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
from taskcal_studio.sections import show_sections
from taskcal_studio.selection import RowSelection
from taskcal_studio.stated_options import OF_IMAGES, OF_TRACKER, arguments, asked, offered
from taskcal_studio.steps import begin, choose_file, choose_or_drop, download, is_running, show_run
from taskcal_studio.texts import Texts
from taskcal_studio.views import NOWHERE, CellView, RowPlayer

RESULT_KEYS = ("expected_error_mm", "random_plans", "task", "plan")
"""Keys of what the command printed by which it is known to be of this version."""


async def build(studio: Studio, texts: Texts) -> None:
    """Fill the page."""
    project = studio.project
    choices = project.choices
    result = read_result(project, plan_of(choices), *RESULT_KEYS)
    robot = await asyncio.to_thread(robot_of, project)
    if result is not None:
        _show(result, project, robot, texts)
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


def _show(result: Mapping[str, Any], project: Project, robot: Robot, texts: Texts) -> None:
    """Show the expected error of the plan, and its files."""
    error = texts.number(result["expected_error_mm"], ".4f")
    headline(texts("plan.headline", error=error), texts("plan.headline_of", count=result["count"]))
    show_sections(plan_sections(result, robot), texts)
    present = project.files(LAYOUT.plans)
    with ui.element("div").classes("row"):
        for path in (result["plan"], *result.get("programs", ()), result.get("report")):
            if path in present:
                download(texts, path)


async def _poses(
    result: Mapping[str, Any], project: Project, robot: Robot, station: Station | None, texts: Texts
) -> None:
    """The robot at the planned poses, and what is known of each."""
    text("h2", texts("plan.poses"))
    planned_for = result.get("station", "")
    if planned_for != project.choices.station:
        message(texts("plan.other_station", station=planned_for or texts("station.none")))
    q, ids = await asyncio.to_thread(read_plan, project.path(str(result["plan"])), robot)
    known = tabulate_poses(result, robot, q) if len(q) == result["count"] else None

    def tell(row: int) -> str:
        cells = (
            [] if known is None else list(zip(known.header, known.rows[row], strict=True))[1 + len(robot.joint_names) :]
        )
        said = (f"{texts.said(name)}: {texts.said(cell)}" for name, cell in cells)
        return ". ".join((texts("player.at", id=ids[row], count=len(q)), *said))

    meshes = await asyncio.to_thread(meshes_if_sound, project)
    with RowSelection(len(q)) as selection:
        view = CellView(
            robot,
            q,
            meshes=meshes,
            instruments=NOWHERE if station is None else station.position[None],
            targets=0 if station is None else len(station.reflectors),
            keep_out=() if station is None else station.keep_out,
        )
        beams = None if station is None else partial(_beams, station, ErrorModel(robot))
        RowPlayer(view, q, selection, texts("plan.poses"), texts, tell=tell, beams=beams)
        text("p", texts("plan.modelled" if robot.link_radii else "plan.no_radii")).classes("quiet")
        if known is not None:
            with ui.element("details"):
                text("summary", texts("plan.each_pose"))
                tabulated(known, range(len(ids)), texts=texts)


def _beams(
    station: Station, model: ErrorModel, _: int | None, q: Float[np.ndarray, " joints"]
) -> tuple[Float[np.ndarray, " 3"], Float[np.ndarray, "k 3"]]:
    """Where the tracker stands, and the reflectors that it sees with the robot at q."""
    T = model.nominal.poses(q[None])
    seen = station.visible(T, place_links(model, q[None]))[0]
    return station.position, se3.apply(T[0], station.offsets)[seen]


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
