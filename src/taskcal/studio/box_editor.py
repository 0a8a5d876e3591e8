"""A robot and the box of its task, moved and stretched by sliders and numbers, and dragged in the scene."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from nicegui import ui
from nicegui.element import Element
from nicegui.events import SceneDragEventArguments

from taskcal.robot.robot import Robot
from taskcal.studio.controls import MOVED, RELEASED, VALUE, button, set_attribute, text
from taskcal.studio.robot_view import VIEWS, RobotView
from taskcal.studio.task_box import TaskBox
from taskcal.studio.texts import Texts

UPDATES_S = 0.05
"""Between two places of a box that is dragged."""

SMALLEST_MM, STEP_MM = 1.0, 5.0


class BoxEditor:
    """The scene and the controls."""

    def __init__(
        self,
        robot: Robot,
        q: np.ndarray,
        box: TaskBox,
        texts: Texts,
        *,
        on_move: Callable[[TaskBox], None],
        on_release: Callable[[TaskBox], None],
    ) -> None:
        """Show a box.

        Args:
            robot: drawn beside it.
            q: its joint positions, radians or metres.
            box: to begin with.
            texts: of the page.
            on_move: called with every place of the box while it is dragged.
            on_release: called with the place where it is left.
        """
        self._box, self._on_move, self._on_release = box, on_move, on_release
        self._controls: dict[tuple[str, int], tuple[Element, Element]] = {}
        reach = float(np.ceil(robot.reach * 10.0) * 100.0)
        with ui.element("div").classes("side-by-side"):
            with ui.element("div"):
                self._view = RobotView(robot, q, on_drag=self._drop)
                set_attribute(self._view.scene, "aria-label", texts("task.space_of", robot=robot.title))
                self._view.scene.props("role=img")
                with ui.element("div").classes("row"):
                    for name in VIEWS:
                        button(texts(f"robot.view_{name}"), lambda name=name: self._view.look(name), plain=True)
                text("p", texts("task.drag")).classes("quiet")
            with ui.element("div"):
                for of, low, high in (("center", -reach, reach), ("size", SMALLEST_MM, reach)):
                    text("h2", texts(f"task.{of}"))
                    for axis, letter in enumerate("xyz"):
                        self._add_controls(of, axis, f"{texts(f'task.{of}')} {letter}", letter, low, high)
        self._show()

    def _add_controls(self, of: str, axis: int, label: str, letter: str, low: float, high: float) -> None:
        with ui.element("div").classes("joint"):
            text("span", letter)
            slider = ui.element("input").props(f"type=range min={low:g} max={high:g} step={STEP_MM}")
            slider.on("input", lambda e: self._take(of, axis, e.args), js_handler=MOVED, throttle=UPDATES_S)
            slider.on("change", lambda e: self._take(of, axis, e.args, release=True), js_handler=RELEASED)
            number = ui.element("input").props("type=number step=any").classes("value")
            number.on("change", lambda e: self._take(of, axis, e.args, release=True), js_handler=VALUE)
        set_attribute(slider, "aria-label", label)
        set_attribute(number, "aria-label", f"{label} (mm)")
        self._controls[of, axis] = (slider, number)

    def _take(self, of: str, axis: int, given: Any, *, release: bool = False) -> None:
        """A length from the browser, millimetres."""
        try:
            value = float(given)
        except (TypeError, ValueError):
            value = np.nan
        if np.isfinite(value) and abs(value) < 1e6 and (of == "center" or value >= SMALLEST_MM):
            changed = getattr(self._box, of).copy()
            changed[axis] = value
            self._box = replace(self._box, **{of: changed})
        self._show()
        (self._on_release if release else self._on_move)(self._box)

    def _drop(self, event: SceneDragEventArguments) -> None:
        """The box was dragged in the scene."""
        self._box = replace(self._box, center=np.array([event.x, event.y, event.z]) * 1e3)
        self._show()
        self._on_release(self._box)

    def _show(self) -> None:
        for (of, axis), (slider, number) in self._controls.items():
            value = f"{getattr(self._box, of)[axis]:.1f}"
            set_attribute(slider, "value", value)
            set_attribute(number, "value", value)
        self._view.place_box(self._box.center * 1e-3, self._box.size * 1e-3)
