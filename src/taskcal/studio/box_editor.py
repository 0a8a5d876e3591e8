"""A robot and the box of its task, moved, stretched and turned by sliders and numbers, and dragged in the scene."""

from collections.abc import Callable
from dataclasses import replace
from typing import Literal

import numpy as np
from nicegui import ui

from taskcal.robot.robot import Robot
from taskcal.studio.box_view import UPDATES_S, BoxView, Part
from taskcal.studio.controls import text
from taskcal.studio.robot_view import RobotView
from taskcal.studio.task_box import TENTHS, THOUSANDTHS, TaskBox
from taskcal.studio.texts import Texts
from taskcal.studio.value_input import ValueInput
from taskcal.studio.view_buttons import add_views

SMALLEST_MM, STEP_MM, STEP_DEG = 1.0, 5.0, 1.0

Property = Literal["center", "size", "turn"]

UNITS: dict[Property, str] = {"center": "mm", "size": "mm", "turn": "°"}


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
        on_release: Callable[[TaskBox], TaskBox],
    ) -> None:
        """Show a box.

        Args:
            robot: drawn beside it.
            q: its joint positions, radians or metres.
            box: to begin with.
            texts: of the page.
            on_move: called with every place of the box while it is dragged.
            on_release: called with the place where it is left; gives the box as it was saved.
        """
        self.box = box
        self._on_move, self._on_release = on_move, on_release
        self._controls: dict[tuple[Property, int], tuple[ValueInput, ValueInput]] = {}
        reach = float(np.ceil(robot.reach * 10.0) * 100.0)
        with ui.element("div").classes("side-by-side"):
            with ui.element("div"):
                view = RobotView(robot, q)
                self._view = BoxView(view.scene, view.size, len(box.rooms), self._drag)
                with ui.element("div").classes("row"):
                    add_views(view.scene, view.look, texts("task.space_of", robot=robot.title), texts)
                text("p", texts("task.drag")).classes("quiet")
            with ui.element("div"):
                ranges: dict[Property, tuple[float, float, float]] = {
                    "center": (-reach, reach, STEP_MM),
                    "size": (SMALLEST_MM, reach, STEP_MM),
                    "turn": (-180.0, 180.0, STEP_DEG),
                }
                for of, limits in ranges.items():
                    text("h2", texts(f"task.{of}"))
                    for axis, letter in enumerate("xyz"):
                        self._add_controls(of, axis, f"{texts(f'task.{of}')} {letter}", letter, limits)
        self._show()

    def change(self, box: TaskBox, *, release: bool = True, held: Part | None = None) -> None:
        """Show another box, and hand it on.

        Args:
            box: the box.
            release: whether it stays, and is saved.
            held: what of it the mouse has in the scene.
        """
        self.box = box
        if release:
            self.box = self._on_release(box)
        self._show(held)
        if not release:
            self._on_move(box)

    def save(self, box: TaskBox) -> None:
        """Save a box whose orientations are others in number; the page has to be shown anew."""
        self.box = self._on_release(box)

    def _add_controls(
        self, of: Property, axis: int, label: str, letter: str, limits: tuple[float, float, float]
    ) -> None:
        low, high, step = limits
        with ui.element("div").classes("joint"):
            text("span", letter)
            slider = ValueInput("range", label, "", min=f"{low:g}", max=f"{high:g}", step=f"{step:g}")
            slider.on_moved(lambda given: self._take(of, axis, given), UPDATES_S)
            slider.on_left(lambda given: self._take(of, axis, given, release=True))
            number = ValueInput("number", f"{label} ({UNITS[of]})", "", step="any").classes("value")
            number.on_left(lambda given: self._take(of, axis, given, release=True))
        self._controls[of, axis] = (slider, number)

    def _take(self, of: Property, axis: int, given: str, *, release: bool = False) -> None:
        """A length from the browser, millimetres, or an angle, degrees."""
        try:
            value = float(given)
        except ValueError:
            value = np.nan
        box = self.box
        most = {"center": 1e6, "size": 1e6, "turn": 360.0}[of]
        if np.isfinite(value) and abs(value) < most and (of != "size" or value >= SMALLEST_MM):
            changed = getattr(box, of).copy()
            changed[axis] = round(value, THOUSANDTHS if of == "turn" else TENTHS)
            box = replace(box, **{of: changed})
        self.change(box, release=release)

    def _drag(self, part: Part, place: np.ndarray, done: bool) -> None:
        """The box, or a ball of one of its axes, is dragged in the scene."""
        box = self.box.moved_to(place) if part == "box" else self.box.turned_to("xyz".index(part), place)
        self.change(box, release=done, held=None if done else part)

    def _show(self, held: Part | None = None) -> None:
        """The box as it is now.

        Args:
            held: what of it the mouse has in the scene.
        """
        for (of, axis), controls in self._controls.items():
            value = f"{getattr(self.box, of)[axis]:.{2 if of == 'turn' else 1}f}"
            for control in controls:
                control.show(value)
        workspace = self.box.workspace
        R = workspace.T_base_frame[:3, :3]
        tools = [(R @ room.rotation, room) for room in workspace.orientations]
        self._view.place(self.box.T_base_box, workspace.size, tools, held)
