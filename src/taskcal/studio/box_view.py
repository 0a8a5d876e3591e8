"""A box in a scene, with balls before its faces: the box is dragged to be moved, a ball to turn it; and the tool's cones."""

from collections.abc import Callable, Sequence
from typing import Any, Literal

import numpy as np
from jaxtyping import Float
from nicegui import ui

from taskcal.studio.robot_view import BOX, stretch_cylinder
from taskcal.task.workspace import Orientation

AXES = ("#b3261e", "#00674b", "#00558a")
"""Colours of x, y and z: red, green and blue, dark enough on the ground of a scene."""

CONE = "#5b3a8c"

UPDATES_S = 0.05
"""Between two places of a box that is dragged."""

NARROWEST, WIDEST = np.radians([2.0, 75.0])
"""Cones that are drawn for those that are narrower or wider."""

Part = Literal["box", "x", "y", "z"]
"""What can be dragged: the box itself, or the ball of one of its axes."""

OnDrag = Callable[[Part, Float[np.ndarray, " 3"], bool], None]
"""What is dragged, where it is in the base, metres, and whether it was let go."""


class BoxView:
    """The box, its balls and its cones."""

    def __init__(self, scene: ui.scene, size: float, orientations: int, on_drag: OnDrag) -> None:
        """Put a box into a scene.

        Args:
            scene: the robot's.
            size: of the robot, metres.
            orientations: how many cones it has.
            on_drag: called as the box or one of its balls is dragged.
        """
        self._scene, self._size, self._on_drag = scene, size, on_drag
        with scene:
            self._box = scene.box(1.0, 1.0, 1.0).material(BOX, opacity=0.45).draggable()
            self._balls = [scene.sphere(0.03 * size).material(colour).draggable() for colour in AXES]
            self._letters = [scene.text(letter) for letter in "xyz"]
            self._cones = [scene.cylinder(0.0, 1.0, 1.0, 24).material(CONE, opacity=0.5) for _ in range(orientations)]
        scene.on("drag", self._dragged, throttle=UPDATES_S)
        scene.on("dragend", self._dragged)

    def place(
        self,
        T: Float[np.ndarray, "4 4"],
        size: Float[np.ndarray, " 3"],
        tools: Sequence[tuple[Float[np.ndarray, "3 3"], Orientation]],
        held: Part | None = None,
    ) -> None:
        """Show the box.

        Args:
            T: its pose in the base, metres.
            size: its edges, metres.
            tools: rotations of the tool in the base, with their room.
            held: what the mouse has, and the browser moves itself.
        """
        with self._scene._batch_calls():  # pyright: ignore[reportPrivateUsage]
            self._box.scale(*size).rotate_R(T[:3, :3].tolist())
            _place(self._box, T[:3, 3], held=held == "box")
            for axis, (ball, letter) in enumerate(zip(self._balls, self._letters, strict=True)):
                before_face = T[:3, 3] + T[:3, axis] * (0.5 * size[axis] + 0.08 * self._size)
                _place(ball, before_face, held=held == "xyz"[axis])
                letter.move(*(before_face + T[:3, axis] * 0.07 * self._size))
            for cone, (R, room) in zip(self._cones, tools, strict=True):
                length = 0.2 * self._size
                opening = length * np.tan(np.clip(room.cone, NARROWEST, WIDEST))
                stretch_cylinder(cone, T[:3, 3] - length * R[:, 2], T[:3, 3], radius=float(opening))

    def _dragged(self, event: Any) -> None:
        said = event.args
        parts: tuple[Part, ...] = ("box", "x", "y", "z")
        things = (self._box, *self._balls)
        objects: dict[str, Part] = {thing.id: part for thing, part in zip(things, parts, strict=True)}
        if said["object_id"] not in objects:
            return
        place = np.array([said["x"], said["y"], said["z"]], dtype=float)
        if not np.isfinite(place).all():
            return
        done = said["type"] == "dragend"
        self._on_drag(objects[said["object_id"]], place, done)
        if done:  # the right button turns what it drags in the browser alone
            self._scene.run_method("rotate", self._box.id, self._box.R)


def _place(thing: Any, at: Float[np.ndarray, " 3"], *, held: bool) -> None:
    if held:
        thing.x, thing.y, thing.z = at.tolist()
    else:
        thing.move(*at.tolist())
