"""Measured points in three dimensions: to be turned, shifted and zoomed, and picked to see their row."""

from collections.abc import Callable, Sequence

import numpy as np
from jaxtyping import Float
from nicegui import ui
from nicegui.events import SceneClickEventArguments

from taskcal.studio.robot_view import BACKGROUND, VIEWS

MOST_PICKED = 3000
"""Points among which one can be picked; of more, every click would send all that it passes."""

AWAY = 1.9
"""From where the cloud is seen, in its sizes: all of it fits."""

POINT_SHARE = 0.04
"""Of the size of the cloud, of a point's size."""

CROWD = 1000
"""Points beyond which they are drawn smaller, as their distance from one another is."""

INK = (0.0, 0.35, 0.6)
ARROW = "#b34700"
PICKED = (0.84, 0.37, 0.0)
CONCERNED = (0.45, 0.1, 0.0)


class PointView:
    """A scene with points in it, about their middle."""

    def __init__(
        self,
        points: Float[np.ndarray, "n 3"],
        on_pick: Callable[[int], None],
        colours: Float[np.ndarray, "n 3"] | None = None,
    ) -> None:
        """Show points.

        Args:
            points: metres.
            on_pick: called with the number of a point that is clicked.
            colours: of the points, red, green and blue of sRGB from 0 to 1.
        """
        self._on_pick = on_pick
        self._arrows: list[ui.scene.line] = []
        self.middle = 0.5 * (points.max(axis=0) + points.min(axis=0))
        self._points = points - self.middle
        self.size = float(max(np.linalg.norm(self._points, axis=1).max(), 1e-3))
        self._colours = np.tile(INK, (len(points), 1)) if colours is None else colours
        self.scene = ui.scene(
            width=800,
            height=460,
            grid=False,
            background_color=BACKGROUND,
            camera=ui.scene.perspective_camera(fov=50, near=0.01 * self.size, far=100.0 * self.size),
            on_click=self._pick,
            click_events=["click"] if len(points) <= MOST_PICKED else [],
        ).classes("view")
        with self.scene:
            shown = linear(self._colours)
            point_size = self.size * POINT_SHARE * min(1.0, (CROWD / len(points)) ** (1.0 / 3.0))
            self._cloud = self.scene.point_cloud(self._points.tolist(), shown.tolist(), point_size)
            self.scene.axes_helper(0.4 * self.size)
            for letter, place in zip("XYZ", 0.45 * self.size * np.eye(3), strict=True):
                self.scene.text(letter).move(*place)
        self.look("oblique")

    def look(self, view: str) -> None:
        """See the points from one of `VIEWS`."""
        x, y, z = (AWAY * self.size * share for share in VIEWS[view])
        self.scene.move_camera(x, y, z, look_at_x=0.0, look_at_y=0.0, look_at_z=0.0, duration=0.0)

    def draw_arrows(self, numbers: Sequence[int], arrows: Float[np.ndarray, "k 3"], scale: float) -> None:
        """Draw a line from each of some points.

        Args:
            numbers: of the points.
            arrows: from them, metres.
            scale: how many times as long as they are.
        """
        with self.scene, self.scene._batch_calls():  # pyright: ignore[reportPrivateUsage]
            for number, arrow in zip(numbers, arrows, strict=True):
                line = self.scene.line([0.0, 0.0, 0.0], arrow.tolist()).material(ARROW)
                self._arrows.append(line.move(*self._points[number]))
        self.stretch_arrows(scale)

    def stretch_arrows(self, scale: float) -> None:
        """Show the arrows so many times as long as they are."""
        with self.scene._batch_calls():  # pyright: ignore[reportPrivateUsage]
            for line in self._arrows:
                line.scale(scale)

    def colour(self, colours: Float[np.ndarray, "n 3"]) -> None:
        """Show the points in other colours."""
        self._colours = colours
        self._cloud.set_points(self._points.tolist(), linear(colours).tolist())

    def mark(self, numbers: Sequence[int]) -> None:
        """Show some of the points as picked."""
        colours = self._colours.copy()
        colours[list(numbers)] = PICKED
        self._cloud.set_points(self._points.tolist(), linear(colours).tolist())

    def _pick(self, event: SceneClickEventArguments) -> None:
        """The point nearest to where a click met the cloud."""
        hits = [(hit.x, hit.y, hit.z) for hit in event.hits]
        if not hits:
            return
        distances = np.linalg.norm(np.array(hits)[:, None] - self._points[None], axis=2)
        self._on_pick(int(np.unravel_index(np.argmin(distances), distances.shape)[1]))


def linear(colours: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 3"]:
    """Colours of sRGB as three.js takes those of points: as shares of light (IEC 61966-2-1)."""
    return np.where(colours <= 0.04045, colours / 12.92, ((colours + 0.055) / 1.055) ** 2.4)
