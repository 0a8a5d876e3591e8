"""The robot: chosen from the catalogue or a file, drawn, jogged, and what is known of it."""

import asyncio
import re
from collections.abc import Mapping
from contextlib import suppress
from functools import cache
from typing import Any

import numpy as np
from jaxtyping import Float
from nicegui import ui
from nicegui.element import Element

from taskcal.errors import TaskcalError
from taskcal.geometry import se3
from taskcal.robot.catalogue import catalogue_names, load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot import Robot
from taskcal.studio.controls import VALUE, button, choice, drop_zone, facts, message, set_attribute, table, text
from taskcal.studio.project import LAYOUT, ROBOT_ENDINGS, Project
from taskcal.studio.robot_view import VIEWS, RobotView
from taskcal.studio.studio import Studio
from taskcal.studio.texts import Texts

UPDATES_S = 0.04
"""Between two positions of a slider that is dragged."""

WIDEST = np.pi
"""Radians to either side of zero that a slider offers of a joint without limits; half as many metres of a sliding one."""


def robot_of(project: Project) -> Robot:
    """The project's robot.

    Raises:
        TaskcalError: it has none yet, or its file describes none.
    """
    named = project.choices.robot
    if not named:
        raise TaskcalError("choose a robot first")
    return load_robot(project.path(named) if "/" in named else named)


async def build(studio: Studio, texts: Texts) -> None:
    """Fill the page."""
    project = studio.project
    named = project.choices.robot
    titles = await asyncio.to_thread(_titles)
    own = {path: path for path in project.files(LAYOUT.robots, ROBOT_ENDINGS)}

    def take(name: str) -> None:
        project.choose(robot=name)
        ui.navigate.reload()

    with ui.element("div").classes("row"):
        choice(texts("robot.choose"), own | titles, named, take, group="robot")
    with ui.element("details"):
        text("summary", texts("robot.own"))
        drop_zone(texts, "robot", texts("robot.drop"), ROBOT_ENDINGS)
    if not named:
        text("p", texts("robot.none"))
        return
    try:
        robot = await asyncio.to_thread(robot_of, project)
        model = await asyncio.to_thread(ErrorModel, robot)
    except TaskcalError as error:
        message(str(error))
        return
    _show(robot, model, texts)


def warm_up(project: Project) -> None:
    """Import and compile what the page needs, and read the catalogue, before somebody waits for it."""
    _titles()
    with suppress(TaskcalError):
        robot = robot_of(project)
        tool_place(ErrorModel(robot), np.clip(np.zeros(len(robot.joints)), *slider_ranges(robot).T))


@cache
def _titles() -> dict[str, str]:
    return {name: f"{load_robot(name).title} ({name})" for name in catalogue_names()}


def _show(robot: Robot, model: ErrorModel, texts: Texts) -> None:
    ranges = slider_ranges(robot)
    q = np.clip(np.zeros(len(ranges)), ranges[:, 0], ranges[:, 1])
    with ui.element("div").classes("side-by-side"):
        with ui.element("div"):
            text("h2", texts("robot.drawing"))
            view = RobotView(robot, q)
            set_attribute(view.scene, "aria-label", texts("robot.drawing_of", robot=robot.title))
            view.scene.props("role=img")
            with ui.element("div").classes("row"):
                for name in VIEWS:
                    button(texts(f"robot.view_{name}"), lambda name=name: view.look(name), plain=True)
            text("p", texts("robot.axes")).classes("quiet")
        with ui.element("div"):
            text("h2", texts("robot.jog"))
            _Jog(robot, model, view, q, texts)
    _describe(robot, model, texts)


def slider_ranges(robot: Robot) -> Float[np.ndarray, "joints 2"]:
    """Where sliders begin and end: the limits, or so far to either side where a joint has none."""
    half = np.where(robot.prismatic, 0.5 * WIDEST, WIDEST)
    limits = robot.limits
    return np.column_stack(
        [np.where(np.isfinite(limits[:, k]), limits[:, k], sign * half) for k, sign in ((0, -1.0), (1, 1.0))]
    )


class _Jog:
    """A slider and a number for each joint, and where the tool is."""

    def __init__(self, robot: Robot, model: ErrorModel, view: RobotView, q: np.ndarray, texts: Texts) -> None:
        self._robot, self._model, self._view, self._texts = robot, model, view, texts
        self._q = q.copy()
        self._scale = np.where(robot.prismatic, 1e3, 180.0 / np.pi)
        self._controls: list[tuple[Element, Element]] = []
        ranges = slider_ranges(robot) * self._scale[:, None]
        for i, name in enumerate(robot.joint_names):
            low, high = ranges[i]
            with ui.element("div").classes("joint"):
                text("span", name)
                slider = self._control(i, f"type=range min={low:.6g} max={high:.6g} step=any", VALUE, UPDATES_S)
                number = self._control(i, "type=number step=any", VALUE, 0.0).classes("value")
                set_attribute(slider, "aria-label", name)
                set_attribute(number, "aria-label", f"{name} ({self._unit(i)})")
                self._controls.append((slider, number))
        button(texts("robot.home"), self._home, plain=True)
        self._where = ui.element("div").props("role=status")
        self._show()

    def _unit(self, i: int) -> str:
        return "mm" if self._robot.prismatic[i] else "°"

    def _control(self, i: int, props: str, emit: str, throttle: float) -> Element:
        made = ui.element("input").props(props)
        event = "input" if throttle else "change"
        made.on(event, lambda e: self._take(i, e.args), js_handler=emit, throttle=throttle, leading_events=True)
        return made

    def _home(self) -> None:
        self._q[:] = np.clip(0.0, *slider_ranges(self._robot).T)
        self._show()

    def _take(self, i: int, given: Any) -> None:
        """A value from the browser, in degrees or millimetres."""
        said = str(given).strip()
        if re.fullmatch(r"[-+]?\d{0,9}(\.\d*)?(e-?\d{1,2})?", said) and any(c.isdigit() for c in said):
            self._q[i] = float(said) / self._scale[i]
        self._show()

    def _show(self) -> None:
        for (slider, number), value in zip(self._controls, self._q * self._scale, strict=True):
            set_attribute(slider, "value", f"{value:.4f}")
            set_attribute(number, "value", f"{value:.4f}")
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
    """Where the nominal robot has its tool, as ``taskcal poses`` writes it."""
    T = model.nominal.poses(q[None])[0]
    position = " ".join(f"{value:.4f}" for value in T[:3, 3] * 1e3)
    return {
        "position_mm": position,
        "quaternion": " ".join(f"{value:.6f}" for value in se3.to_quaternion(T[None, :3, :3])[0]),
    }


def _describe(robot: Robot, model: ErrorModel, texts: Texts) -> None:
    rows: list[tuple[str, ...]] = []
    for joint in robot.joints:
        slides = joint.kind == "prismatic"
        scale, unit = (1e3, "mm") if slides else (180.0 / np.pi, "°")
        low, high = (f"{limit * scale:.6g} {unit}" if np.isfinite(limit) else "–" for limit in joint.limits)
        rows.append((joint.name, texts("robot.slides" if slides else "robot.turns"), low, high))
    text("h2", texts("robot.joints"))
    header = [texts(f"robot.{key}") for key in ("joint", "kind", "lowest", "highest")]
    table(texts("robot.joints_of", robot=robot.title), header, rows, words=(0, 1))
    told = [(texts("robot.parameters"), str(len(model)))]
    told += [(texts("robot.loop"), texts("robot.yes" if robot.four_bar else "robot.no"))]
    told += [(texts("robot.source"), line) for line in robot.source]
    told += [(texts("robot.published"), robot.published.source)] if robot.published.source else []
    facts(told)
