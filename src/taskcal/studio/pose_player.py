"""A robot that goes from pose to pose: by a slider, or by itself; with the beams of the tracker that measures it."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float
from nicegui import ui

from taskcal.errors import TaskcalError
from taskcal.measurement.station import Station
from taskcal.robot.robot import Robot
from taskcal.studio.beam_view import BeamView
from taskcal.studio.controls import button, message, text
from taskcal.studio.robot_view import RobotView
from taskcal.studio.texts import Texts
from taskcal.studio.value_input import ValueInput
from taskcal.studio.view_buttons import add_views

STEPS = 6
"""Pictures from one pose to the next."""

STEP_S = 0.1


class PosePlayer:
    """A scene, a slider and a button that plays the poses."""

    def __init__(
        self,
        robot: Robot,
        q: Float[np.ndarray, "n joints"],
        told: Sequence[str],
        label: str,
        texts: Texts,
        station: Station | None = None,
    ) -> None:
        """Show the first pose.

        Args:
            robot: the robot.
            q: joint positions, radians or metres, in their order.
            told: of each pose, in words.
            label: what they are.
            texts: of the page.
            station: with the tracker that measures them.
        """
        self._q, self._told, self._texts = q, told, texts
        self._at, self._step = 0, 0
        self._view = RobotView(robot, q[0])
        self._beams = None
        if station is not None:
            self._beams = BeamView(self._view.scene, self._view.size, robot, station)
            self._view.widen(float(np.linalg.norm(station.position)))
        with ui.element("div").classes("row"):
            add_views(self._view.scene, self._view.look, label, texts)
        with ui.element("div").classes("row"):
            self._play = button(texts("player.play"), self._toggle)
            with ui.element("label").classes("row"):
                text("span", texts("player.pose"))
                self._slider = ValueInput("range", texts("player.pose"), "0", min="0", max=str(len(q) - 1), step="1")
                self._slider.on_moved(self._choose, STEP_S)
            self._said = text("span", "").props("role=status")
        self._timer = ui.timer(STEP_S, self._advance, active=False)
        self._show(q[0])

    def _choose(self, given: str) -> None:
        """A pose from the slider."""
        if given.isdigit() and int(given) < len(self._q):
            self._at, self._step = int(given), 0
            self._show(self._q[self._at])

    def _toggle(self) -> None:
        if self._timer.active:
            self._timer.deactivate()
        else:
            if self._at == len(self._q) - 1:
                self._at = 0
            self._timer.activate()
        self._play.set_text(self._texts("player.stop" if self._timer.active else "player.play"))

    def _advance(self) -> None:
        """The next picture, on the way in the joints from this pose to the next."""
        self._step += 1
        if self._step == STEPS:
            self._at, self._step = self._at + 1, 0
        if self._at >= len(self._q) - 1:
            self._at, self._step = len(self._q) - 1, 0
            self._toggle()
        share = self._step / STEPS
        after = self._q[min(self._at + 1, len(self._q) - 1)]
        self._show((1.0 - share) * self._q[self._at] + share * after)

    def _show(self, q: Float[np.ndarray, " joints"]) -> None:
        try:
            self._view.move(q)
        except TaskcalError as error:  # a loop need not close on the way between two poses at which it does
            message(str(error))
        if self._beams is not None:
            self._beams.move(q)
        if self._step == 0:
            self._slider.show(str(self._at))
            self._said.set_text(self._told[self._at])
