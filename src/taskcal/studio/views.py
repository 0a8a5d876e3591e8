"""A robot in three dimensions: its chain as bars, its joints as drums about their axes, its loop, its base and its tool."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Literal
from urllib.parse import quote

import numpy as np
from jaxtyping import Float
from nicegui import ui
from nicegui.element import Element
from nicegui.events import SceneClickEventArguments

from taskcal.errors import TaskcalError
from taskcal.geometry import se3
from taskcal.kinematics.clearance import place_links
from taskcal.observations.point import Station
from taskcal.report import chart
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.mechanism import Skeleton, trace_skeleton
from taskcal.robot.robot import Robot
from taskcal.studio.controls import ValueInput, button, message, set_attribute, text
from taskcal.studio.robot_meshes import RobotMeshes
from taskcal.studio.texts import Texts
from taskcal.task.workspace import Orientation

LINK, JOINT, LOOP, BOX = "#6b7e91", "#8f4e00", "#007a58", "#0072B2"
"""Colours that stand out from the ground in grey, too; links and joints differ in luminance, not in hue alone."""

BACKGROUND = "#dfe5ea"

MIN_LENGTH_M = 1e-4
"""Shorter parts of a chain are not drawn: they would have no direction."""

WIDENED = 0.8
"""Size of a view over the distance of what it shows beside the robot."""

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
        self, robot: Robot, q: Float[np.ndarray, " joints"], meshes: RobotMeshes | None = None, file: str = ""
    ) -> None:
        """Show a robot.

        Args:
            robot: the robot.
            q: its joint positions, radians or metres.
            meshes: of its links, drawn in place of bars where none of them is missing.
            file: the robot's, that they belong to.
        """
        self._robot, self._meshes = robot, meshes
        looks = [] if meshes is None else [(number, visual.scale) for number, visual in meshes.drawn]
        skeleton = trace_skeleton(robot, q[None])
        strokes = _strokes(skeleton)
        self.size = float(max(np.linalg.norm(strokes, axis=1).max(), 0.3))
        """Metres from the base to its farthest part."""
        self._seen = self.size
        """What views show, metres."""
        metres = 2 * int(np.ceil(2.0 * self.size))
        self.scene = ui.scene(width=800, height=460, grid=(metres, 2 * metres), background_color=BACKGROUND).classes(
            "view"
        )
        thickness = 0.03 * self.size
        self._drum_length = 4.0 * thickness
        with self.scene:
            self._bars = [self._bar(thickness, LINK) for _ in range(len(strokes) // 2)]
            self._drums = [self._bar(1.8 * thickness, JOINT) for _ in robot.joints]
            self._loop = [self._bar(0.6 * thickness, LOOP) for _ in skeleton.loop]
            self._shells = [
                self.scene.stl(f"/mesh/{quote(Path(file).name)}/{number}").material(LINK).scale(*scale)
                for number, scale in looks
            ]
            self._tool = self.scene.axes_helper(0.2 * self.size)
            self._tool_letters = [self.scene.text(letter) for letter in "xyz"]
            _add_axes(self.scene, self.size)
        self.look("oblique")
        self._place(skeleton, q)
        if meshes is not None and meshes.drawn and not meshes.missing:
            for bar in (*self._bars, *self._drums):
                bar.material(LINK, opacity=0.0)

    def move(self, q: Float[np.ndarray, " joints"]) -> None:
        """Bring the robot to joint positions q, radians or metres.

        Raises:
            ClosureError: its loop does not close there.
        """
        self._place(trace_skeleton(self._robot, q[None]), q)

    def look(self, view: str) -> None:
        """See it from one of `VIEWS`."""
        middle = 0.4 * self.size
        x, y, z = (1.25 * self._seen * share for share in VIEWS[view])
        self.scene.move_camera(
            x, y, z + middle, look_at_x=0.25 * self._seen, look_at_y=0.0, look_at_z=middle, duration=0.0
        )

    def widen(self, distance: float) -> None:
        """Show what is so far from the base, metres, as well."""
        self._seen = max(self.size, WIDENED * distance)
        self.look("oblique")

    def _place(self, skeleton: Skeleton, q: Float[np.ndarray, " joints"]) -> None:
        with self.scene._batch_calls():  # pyright: ignore[reportPrivateUsage]  # a message a pose, not one a bar
            for bar, (start, end) in zip(self._bars, _strokes(skeleton).reshape(-1, 2, 3), strict=True):
                stretch_cylinder(bar, start, end)
            for drum, at, axis in zip(self._drums, skeleton.origins[0], skeleton.axes[0], strict=True):
                half = 0.5 * self._drum_length * axis
                stretch_cylinder(drum, at - half, at + half)
            for bar, (start, end) in zip(self._loop, (ends[0] for ends in skeleton.loop), strict=True):
                stretch_cylinder(bar, start, end)
            if self._meshes is not None:
                poses = self._meshes.poses(self._robot.joint_names, q)
                for shell, T in zip(self._shells, poses, strict=True):
                    shell.move(*T[:3, 3].tolist()).rotate_R(T[:3, :3].tolist())
            tool = skeleton.tool[0]
            self._tool.move(*tool[:3, 3]).rotate_R(tool[:3, :3].tolist())
            for letter, place in zip(self._tool_letters, tool[:3, 3] + 0.23 * self.size * tool[:3, :3].T, strict=True):
                letter.move(*place)

    def _bar(self, radius: float, colour: str) -> ui.scene.cylinder:
        return self.scene.cylinder(radius, radius, 1.0, 16).material(colour)


def _add_axes(scene: ui.scene, size: float) -> None:
    """Axes of the base or the tracker, with their letters."""
    scene.axes_helper(0.4 * size)
    for letter, place in zip("XYZ", 0.45 * size * np.eye(3), strict=True):
        scene.text(letter).move(*place)


def _strokes(skeleton: Skeleton) -> Float[np.ndarray, "ends 3"]:
    """Both ends of every straight part, one part behind the other."""
    return np.concatenate([np.stack([link[0, :-1], link[0, 1:]], axis=1).reshape(-1, 3) for link in skeleton.links])


def stretch_cylinder(
    bar: ui.scene.cylinder, start: Float[np.ndarray, " 3"], end: Float[np.ndarray, " 3"], radius: float = 1.0
) -> None:
    """Lay a cylinder, whose own axis is y and whose length is one, from one point to another; metres, radius in its own."""
    length = float(np.linalg.norm(end - start))
    if length < MIN_LENGTH_M:
        bar.visible(False)
        return
    along = (end - start) / length
    other = np.cross(along, [0.0, 0.0, 1.0] if abs(along[2]) < 0.9 else [1.0, 0.0, 0.0])
    other /= np.linalg.norm(other)
    turn = np.column_stack([np.cross(along, other), along, other])
    bar.visible(True).scale(radius, length, radius).rotate_R(turn.tolist()).move(*(0.5 * (start + end)))


# A tracker in a scene, its beams to the reflectors that it sees, and the boxes that neither robot nor beam may enter.

TRACKER, SEEN, KEEP_OUT = "#1f2933", "#a33c00", "#5b3a8c"


class BeamView:
    """The tracker, a beam for every reflector, and the boxes."""

    def __init__(self, scene: ui.scene, size: float, robot: Robot, station: Station) -> None:
        """Put a station into a scene.

        Args:
            scene: the robot's.
            size: of the robot, metres.
            robot: that is measured.
            station: where and what the tracker measures.
        """
        self._scene, self._station, self._model = scene, station, ErrorModel(robot)
        x, y, z = station.position
        with scene:
            scene.cylinder(0.02 * size, 0.05 * size, 0.16 * size, 16).material(TRACKER).rotate(np.pi / 2, 0, 0).move(
                x, y, z
            )
            scene.sphere(0.035 * size).material(TRACKER).move(x, y, z + 0.1 * size)
            self._beams = [
                scene.cylinder(0.004 * size, 0.004 * size, 1.0, 6).material(SEEN) for _ in station.reflectors
            ]
            for box in station.keep_out:
                drawn = scene.box(*box.size.tolist()).material(KEEP_OUT, opacity=0.35)
                drawn.rotate_R(box.pose[:3, :3].tolist()).move(*box.pose[:3, 3].tolist())

    def move(self, q: Float[np.ndarray, " joints"]) -> None:
        """Show the beams to what the tracker sees with the robot at q, radians or metres."""
        T = self._model.nominal.poses(q[None])
        seen = self._station.visible(T, place_links(self._model, q[None]))[0]
        ends = se3.apply(T[0], self._station.offsets)
        with self._scene._batch_calls():  # pyright: ignore[reportPrivateUsage]
            for beam, end, sees in zip(self._beams, ends, seen, strict=True):
                if sees:
                    stretch_cylinder(beam, self._station.position, end)
                else:
                    beam.visible(False)


# A box in a scene, with balls before its faces: the box is dragged to be moved, a ball to turn it; and the tool's
# cones.

AXES = ("#b3261e", "#00674b", "#00558a")
"""Colours of x, y and z: red, green and blue, dark enough on the ground of a scene."""

CONE = "#5b3a8c"

UPDATES_S = 0.05
"""Between two places of a box that is dragged."""

MIN_CONE, MAX_CONE = np.radians([2.0, 75.0])
"""Cones that are drawn for narrower or wider ones, which would be a line or a plane."""

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
                opening = length * np.tan(np.clip(room.cone, MIN_CONE, MAX_CONE))
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


# Measured points in three dimensions: to be turned, shifted and zoomed, and picked to see their row.

MAX_PICKED = 3000
"""Points among which one can be picked; of more, every click would send all that it passes."""

VIEW_DISTANCE = 1.9
"""From which the cloud is seen, in its sizes: all of it fits."""

POINT_SHARE = 0.04
"""Of the size of the cloud, of a point's size."""

MAX_FULL_SIZE = 1000
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
            click_events=["click"] if len(points) <= MAX_PICKED else [],
        ).classes("view")
        with self.scene:
            shown = linear(self._colours)
            point_size = self.size * POINT_SHARE * min(1.0, (MAX_FULL_SIZE / len(points)) ** (1.0 / 3.0))
            self._cloud = self.scene.point_cloud(self._points.tolist(), shown.tolist(), point_size)
            _add_axes(self.scene, self.size)
        self.look("oblique")

    def look(self, view: str) -> None:
        """See the points from one of `VIEWS`."""
        x, y, z = (VIEW_DISTANCE * self.size * share for share in VIEWS[view])
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


# The directions from which a scene is seen: a button for each, and a key while the scene has the focus.

PRESSED = "(event) => { if (/^[1-9]$/.test(event.key) && !event.ctrlKey && !event.altKey && !event.metaKey) emit(event.key); }"


def add_views(scene: ui.scene, look: Callable[[str], None], label: str, texts: Texts) -> None:
    """Say what a scene shows, and add its views; in a row of elements, so that others can follow.

    Args:
        scene: the scene.
        look: called with the name of a view.
        label: what the scene shows, for those who do not see it.
        texts: of the page.
    """
    names = tuple(VIEWS)

    def press(event: Any) -> None:
        number = int(event.args)
        if number <= len(names):
            look(names[number - 1])

    scene.props("role=img tabindex=0")
    set_attribute(scene, "aria-label", label)
    scene.on("keydown", press, js_handler=PRESSED)
    for number, name in enumerate(names, 1):
        shown = button(texts(f"robot.view_{name}"), lambda name=name: look(name), plain=True)
        set_attribute(shown, "aria-keyshortcuts", str(number))
    text("span", texts("robot.view_keys", count=len(names))).classes("quiet")


# A robot that goes from pose to pose: by a slider, or by itself; with the beams of the tracker that measures it.

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


# A figure of a report on a page.


def figure(caption: str, drawn: chart.Figure, texts: Texts, note: str = "") -> Element:
    """Show a figure.

    Args:
        caption: what it shows.
        drawn: the figure.
        texts: in whose language its numbers are.
        note: how to read it.
    """
    with ui.element("figure") as whole:
        text("figcaption", caption)
        ui.html(chart.html(drawn, caption, texts.number, selects=True), sanitize=False)
        if note:
            text("p", note).classes("quiet")
    return whole
