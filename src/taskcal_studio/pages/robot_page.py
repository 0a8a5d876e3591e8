"""The robot: chosen from the catalogue or a file, drawn, jogged, and what is known of it."""

import asyncio
import re
from collections.abc import Mapping
from contextlib import suppress
from functools import cache
from pathlib import Path

import numpy as np
from jaxtyping import Float
from nicegui import ui

from taskcal.errors import TaskcalError, listed
from taskcal.geometry import se3
from taskcal.report.content import Column, TextTable
from taskcal.robot.catalogue import catalogue_names, load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot import Robot, RobotJoint
from taskcal_studio.controls import Dial, button, choice, drop_zone, facts, message, set_attribute, tabulated, text
from taskcal_studio.files import ROBOT_DROPS
from taskcal_studio.project import LAYOUT, ROBOT_ENDINGS, TABLE_ENDINGS, Project, free_name
from taskcal_studio.results import robot_of
from taskcal_studio.robot_meshes import RobotMeshes, meshes_of
from taskcal_studio.runs import Studio
from taskcal_studio.stated_options import asked
from taskcal_studio.steps import begin, is_running, show_run
from taskcal_studio.texts import Texts
from taskcal_studio.views import CellView, add_views

# A table of Denavit–Hartenberg parameters that was dropped: shown, its convention asked for, and made into a robot
# file.

CONVENTIONS = ("dh", "mdh")
UNITS = ("mm,deg", "mm,rad", "m,deg", "m,rad")

MAX_LINES, MAX_CHARACTERS = 40, 4000
"""Of the table that are shown."""


class RobotTable:
    """Questions of the page on a table."""

    def __init__(self, studio: Studio, table: str, texts: Texts) -> None:
        """Show it.

        Args:
            studio: whose project it lies in.
            table: its path from the project's folder.
            texts: of the page.
        """
        self._studio, self._table, self._texts = studio, table, texts
        self._convention = self._units = ""
        text("h2", texts("robot.table"))
        text("p", texts("robot.table_how"))
        content = studio.project.path(table).read_bytes()[:MAX_CHARACTERS].decode("utf-8", "replace")
        listing = text("pre", "\n".join(content.splitlines()[:MAX_LINES])).classes("command listing")
        listing.props("tabindex=0 role=region").props["aria-label"] = texts("robot.table")
        conventions = {name: texts(f"robot.convention_{name}") for name in CONVENTIONS}
        choice(texts("robot.convention"), conventions, "", lambda name: setattr(self, "_convention", name))
        units = {"": texts("measurements.told")} | {name: name for name in UNITS}
        choice(texts("robot.units"), units, "", lambda name: setattr(self, "_units", name))
        if not is_running(show_run(studio, "robot", texts, about=table)):
            button(texts("robot.make"), self._make)
        self._said = ui.element("div")

    def _make(self) -> None:
        project = self._studio.project
        self._said.clear()
        with self._said:
            if not self._convention:
                message(self._texts("robot.convention_missing"))
                return
            taken = [Path(path).name for path in project.files(LAYOUT.robots)]
            stem = re.sub(r"[^\w-]+", "-", Path(self._table).stem)
            made = f"{LAYOUT.robots}/{free_name(f'{stem}.toml', taken)}"
            given = {"convention": self._convention, "units": self._units, "output": made}
            arguments = asked("robots import", source=self._table, **given)
            begin(self._studio, "robot", arguments, outputs=[made], chosen={"robot": made})


UPDATES_S = 0.04
"""Between two positions of a slider that is dragged."""

MAX_MISSING = 3
"""Missing meshes whose reasons are listed."""

UNLIMITED_RAD = np.pi
"""To either side of zero that a slider offers of a joint without limits; half as many metres of a sliding one."""


async def build(studio: Studio, texts: Texts) -> None:
    """Fill the page."""
    project = studio.project
    named = project.choices.robot
    titles = await asyncio.to_thread(_titles)
    own = {path: path for path in project.files(LAYOUT.robots, (*ROBOT_ENDINGS, *TABLE_ENDINGS))}

    def take(name: str) -> None:
        project.choose(robot=name)
        ui.navigate.reload()

    with ui.element("div").classes("row"):
        choice(texts("choose.robot"), own | titles, named, take, group="robot")
    with ui.element("details") as own_robot:
        set_attribute(own_robot, "open", not named)
        text("summary", texts("robot.own"))
        drop_zone(texts, "robot", texts("robot.drop"), ROBOT_DROPS, several=True)
    if not named:
        text("p", texts("robot.none"))
        return
    if named.endswith(TABLE_ENDINGS) and named in own:
        RobotTable(studio, named, texts)
        return
    robot = await asyncio.to_thread(robot_of, project)
    model = await asyncio.to_thread(ErrorModel, robot)
    meshes = None
    try:
        meshes = await asyncio.to_thread(meshes_of, project, named)
    except TaskcalError as error:
        message(str(error))
    _show(robot, model, texts, meshes)


def warm_up(project: Project) -> None:
    """Import and compile what the page needs, and read the catalogue, before somebody waits for it."""
    _titles()
    with suppress(TaskcalError):
        robot = robot_of(project)
        tool_place(ErrorModel(robot), np.clip(np.zeros(len(robot.joints)), *slider_ranges(robot).T))


@cache
def _titles() -> dict[str, str]:
    return {name: f"{load_robot(name).title} ({name})" for name in catalogue_names()}


def _show(robot: Robot, model: ErrorModel, texts: Texts, meshes: RobotMeshes | None) -> None:
    ranges = slider_ranges(robot)
    q = np.clip(np.zeros(len(ranges)), ranges[:, 0], ranges[:, 1])
    with ui.element("div").classes("side-by-side"):
        with ui.element("div"):
            text("h2", texts("robot.drawing"))
            view = CellView(robot, q[None], meshes=meshes)
            with ui.element("div").classes("row"):
                add_views(view, texts("robot.drawing_of", robot=robot.title), texts)
            text("p", texts("robot.axes")).classes("quiet")
            if meshes is None:
                text("p", texts("robot.no_meshes")).classes("quiet")
            if meshes is not None and meshes.missing:
                text("p", listed(meshes.missing, MAX_MISSING, "; ")).classes("quiet")
        with ui.element("div"):
            text("h2", texts("robot.jog"))
            _Jog(robot, model, view, q, texts)
    _describe(robot, model, texts)


def slider_ranges(robot: Robot) -> Float[np.ndarray, "joints 2"]:
    """Ranges of the sliders: the limits, or so far to either side where a joint has none."""
    half = np.where(robot.prismatic, 0.5 * UNLIMITED_RAD, UNLIMITED_RAD)
    limits = robot.limits
    return np.column_stack(
        [np.where(np.isfinite(limits[:, k]), limits[:, k], sign * half) for k, sign in ((0, -1.0), (1, 1.0))]
    )


class _Jog:
    """A slider and a number for each joint, and where the tool is."""

    def __init__(self, robot: Robot, model: ErrorModel, view: CellView, q: np.ndarray, texts: Texts) -> None:
        self._robot, self._model, self._view, self._texts = robot, model, view, texts
        self._q = q.copy()
        self._scale = np.where(robot.prismatic, 1e3, 180.0 / np.pi)
        units = np.where(robot.prismatic, "mm", "°")
        self._controls = [
            Dial(
                name, name, str(unit), (float(low), float(high)), lambda given, _, i=i: self._take(i, given), UPDATES_S
            )
            for i, (name, unit, (low, high)) in enumerate(
                zip(robot.joint_names, units, slider_ranges(robot) * self._scale[:, None], strict=True)
            )
        ]
        button(texts("robot.home"), self._home, plain=True)
        self._where = ui.element("div").classes("stacked").props("role=status")
        self._show()

    def _home(self) -> None:
        self._q[:] = np.clip(0.0, *slider_ranges(self._robot).T)
        self._show()

    def _take(self, i: int, given: str) -> None:
        """A value from the browser, in degrees or millimetres."""
        if re.fullmatch(r"[-+]?\d{0,9}(\.\d*)?(e-?\d{1,2})?", given) and any(c.isdigit() for c in given):
            self._q[i] = float(given) / self._scale[i]
        self._show()

    def _show(self) -> None:
        for control, value in zip(self._controls, self._q * self._scale, strict=True):
            control.show(f"{value:.4f}")
        self._where.clear()
        with self._where:
            try:
                self._view.move(self._q)
                placed = tool_place(self._model, self._q)
            except TaskcalError as error:
                message(str(error))
                return
            facts(
                [
                    (self._texts("robot.tool_at"), f"{placed['position_mm']} mm"),
                    (self._texts("robot.tool_turned"), placed["quaternion"]),
                ]
            )
            for _, reason in self._robot.outside_limits(self._q[None]):
                message(reason)


def tool_place(model: ErrorModel, q: Float[np.ndarray, " joints"]) -> Mapping[str, str]:
    """Tool pose of the nominal robot, as ``taskcal poses`` writes it."""
    T = model.nominal.poses(q[None])[0]
    position = " ".join(f"{value:.4f}" for value in T[:3, 3] * 1e3)
    return {
        "position_mm": position,
        "quaternion": " ".join(f"{value:.6f}" for value in se3.to_quaternion(T[None, :3, :3])[0]),
    }


def _describe(robot: Robot, model: ErrorModel, texts: Texts) -> None:
    columns = (
        Column(texts("robot.joint"), "name"),
        Column(
            texts("robot.kind"), lambda joint: texts("robot.slides" if joint.kind == "prismatic" else "robot.turns")
        ),
        *(
            Column(texts(f"robot.{end}"), lambda joint, k=k: _limit(joint, k), "s")
            for k, end in enumerate(("lowest", "highest"))
        ),
    )
    text("h2", texts("robot.joints"))
    tabulated(TextTable.of(texts("robot.joints_of", robot=robot.title), columns, robot.joints))
    told = [(texts("robot.parameters"), str(len(model)))]
    told += [(texts("robot.loop"), texts("robot.yes" if robot.four_bar else "robot.no"))]
    told += [(texts("robot.source"), line) for line in robot.source]
    told += [(texts("robot.published"), robot.published.source)] if robot.published.source else []
    facts(told)


def _limit(joint: RobotJoint, end: int) -> str | None:
    """The lower or upper limit of a joint."""
    scale, unit = (1e3, "mm") if joint.kind == "prismatic" else (180.0 / np.pi, "°")
    limit = joint.limits[end]
    return f"{limit * scale:.6g} {unit}" if np.isfinite(limit) else None
