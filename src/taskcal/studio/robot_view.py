"""A robot in three dimensions: its chain as bars, its joints as drums about their axes, its loop, its base and its tool."""

from collections.abc import Callable, Mapping

import numpy as np
from jaxtyping import Float
from nicegui import ui
from nicegui.events import SceneDragEventArguments

from taskcal.robot.robot import Robot
from taskcal.robot.skeleton import Skeleton, trace_skeleton

LINK, JOINT, LOOP, BOX = "#8fa3b5", "#E69F00", "#009E73", "#0072B2"
"""Colours that colour-blind readers tell apart, on light and dark ground."""

BACKGROUND = "#dfe5ea"

SHORTEST = 1e-4
"""Metres; shorter parts of a chain are not drawn."""

VIEWS: Mapping[str, tuple[float, float, float]] = {
    "oblique": (0.75, -0.75, 0.45),
    "front": (1.1, 0.0, 0.0),
    "side": (0.0, -1.1, 0.0),
    "top": (0.0, -0.01, 1.1),
}
"""Directions from which a scene is seen, and how far off in its sizes."""


class RobotView:
    """A scene with a robot in it."""

    def __init__(
        self,
        robot: Robot,
        q: Float[np.ndarray, " joints"],
        on_drag: Callable[[SceneDragEventArguments], None] | None = None,
    ) -> None:
        """Show a robot.

        Args:
            robot: the robot.
            q: its joint positions, radians or metres.
            on_drag: called as the box of `place_box` was dragged.
        """
        self._robot = robot
        self._box: ui.scene.box | None = None
        skeleton = trace_skeleton(robot, q[None])
        strokes = _strokes(skeleton)
        self._size = float(max(np.linalg.norm(strokes, axis=1).max(), 0.3))
        metres = 2 * int(np.ceil(2.0 * self._size))
        self.scene = ui.scene(
            width=800, height=460, grid=(metres, 2 * metres), background_color=BACKGROUND, on_drag_end=on_drag
        ).classes("view")  # fmt: skip
        thickness = 0.03 * self._size
        self._drum_length = 4.0 * thickness
        with self.scene:
            self._bars = [self._bar(thickness, LINK) for _ in range(len(strokes) // 2)]
            self._drums = [self._bar(1.8 * thickness, JOINT) for _ in robot.joints]
            self._loop = [self._bar(0.6 * thickness, LOOP) for _ in skeleton.loop]
            self._tool = self.scene.axes_helper(0.2 * self._size)
            self.scene.axes_helper(0.4 * self._size)
            for letter, place in zip("XYZ", 0.45 * self._size * np.eye(3), strict=True):
                self.scene.text(letter).move(*place)
        self.look("oblique")
        self._place(skeleton)

    def move(self, q: Float[np.ndarray, " joints"]) -> None:
        """Bring the robot to joint positions q, radians or metres.

        Raises:
            ClosureError: its loop does not close there.
        """
        self._place(trace_skeleton(self._robot, q[None]))

    def look(self, view: str) -> None:
        """See it from one of `VIEWS`."""
        middle = 0.4 * self._size
        x, y, z = (1.25 * self._size * share for share in VIEWS[view])
        self.scene.move_camera(
            x, y, z + middle, look_at_x=0.25 * self._size, look_at_y=0.0, look_at_z=middle, duration=0.0
        )

    def place_box(self, center: Float[np.ndarray, " 3"], size: Float[np.ndarray, " 3"]) -> None:
        """Show a box in the base, metres."""
        if self._box is None:
            with self.scene:
                self._box = self.scene.box(1.0, 1.0, 1.0).material(BOX, opacity=0.45).draggable()
        with self.scene._batch_calls():  # pyright: ignore[reportPrivateUsage]
            self._box.scale(*size).move(*center)

    def _place(self, skeleton: Skeleton) -> None:
        with self.scene._batch_calls():  # pyright: ignore[reportPrivateUsage]  # a message a pose, not one a bar
            for bar, (start, end) in zip(self._bars, _strokes(skeleton).reshape(-1, 2, 3), strict=True):
                _stretch(bar, start, end)
            for drum, at, axis in zip(self._drums, skeleton.origins[0], skeleton.axes[0], strict=True):
                half = 0.5 * self._drum_length * axis
                _stretch(drum, at - half, at + half)
            for bar, (start, end) in zip(self._loop, (ends[0] for ends in skeleton.loop), strict=True):
                _stretch(bar, start, end)
            tool = skeleton.tool[0]
            self._tool.move(*tool[:3, 3]).rotate_R(tool[:3, :3].tolist())

    def _bar(self, radius: float, colour: str) -> ui.scene.cylinder:
        return self.scene.cylinder(radius, radius, 1.0, 16).material(colour)


def _strokes(skeleton: Skeleton) -> Float[np.ndarray, "ends 3"]:
    """Both ends of every straight part, one part behind the other."""
    return np.concatenate([np.stack([link[0, :-1], link[0, 1:]], axis=1).reshape(-1, 3) for link in skeleton.links])


def _stretch(bar: ui.scene.cylinder, start: Float[np.ndarray, " 3"], end: Float[np.ndarray, " 3"]) -> None:
    """Lay a cylinder, whose own axis is y, from one point to another."""
    length = float(np.linalg.norm(end - start))
    if length < SHORTEST:
        bar.visible(False)
        return
    along = (end - start) / length
    other = np.cross(along, [0.0, 0.0, 1.0] if abs(along[2]) < 0.9 else [1.0, 0.0, 0.0])
    other /= np.linalg.norm(other)
    turn = np.column_stack([np.cross(along, other), along, other])
    bar.visible(True).scale(1.0, length, 1.0).rotate_R(turn.tolist()).move(*(0.5 * (start + end)))
