"""Scenes of the cell in the robot's base: robot, measured points, the task's box, instruments and their beams; and figures."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Literal
from urllib.parse import quote

import numpy as np
from jaxtyping import Float, Int
from nicegui import ui
from nicegui.element import Element
from nicegui.events import SceneClickEventArguments

from taskcal.errors import TaskcalError
from taskcal.kinematics.clearance import Box
from taskcal.report import chart
from taskcal.report.scene import outline, robot_look, spread_rows
from taskcal.robot.mechanism import Skeleton, trace_skeleton
from taskcal.robot.robot import Robot
from taskcal.task.workspace import Orientation, Workspace
from taskcal_studio.controls import ValueInput, button, message, set_attribute, text
from taskcal_studio.robot_meshes import RobotMeshes
from taskcal_studio.selection import RowSelection
from taskcal_studio.texts import Texts

BOX, INSTRUMENT, BEAM, MARK, KEEP_OUT, ARROW = "#0072B2", "#44505c", "#a33c00", "#d65e00", "#5b3a8c", "#b34700"
"""Colours that stand out from the ground in grey, too."""

INK, CONCERNED = (0.0, 0.35, 0.6), (0.45, 0.1, 0.0)
"""Of points: red, green and blue of sRGB."""

DARK_GAIN = 3.0
"""Times that scenes are brighter on a dark ground: what is drawn is dark enough for a light one."""

VIEWS: Mapping[str, tuple[float, float, float]] = {
    "oblique": (0.75, -0.75, 0.45),
    "front": (1.0, 0.0, 0.0),
    "side": (0.0, -1.0, 0.0),
    "top": (0.0, -0.01, 1.0),
}
"""Directions from which a scene is seen."""

FIELD_DEG, LEAST_ASPECT, MARGIN = 50.0, 1.4, 1.08
"""The camera's upright field of view; width over height of a scene, at least, as the style sheet has it; and the room around."""

MAX_FITTED = 40
"""Poses of a robot that the first view shows as a whole."""

MAX_INSTRUMENT = 2.0
"""Distance from the base, over the robot's reach, up to which an instrument is in the first view: the cell would shrink for one
farther away."""

MIN_LENGTH_M = 1e-4
"""Shorter parts of a chain are not drawn: they would have no direction."""

MAX_PICKED = 3000
"""Points among which one can be picked; of more, every click would send all that it passes."""

PICKED_WITHIN = 0.04
"""Of the size of a scene, from a click to the point that it picks, at most."""

POINT_SHARE, MAX_FULL_SIZE = 0.02, 1000
"""Of the size of a scene, of a point's size; and points beyond which they are drawn smaller, as their distance is."""

FEW_POINTS_LARGER = 3.0
"""That few points are drawn larger at most, where nothing but them is in a scene."""

Places = Float[np.ndarray, "k 3"]
Bar = tuple[Float[np.ndarray, "2 3"], float, str]
"""Ends and radius of a straight part, metres, and its material."""
Ball = tuple[Float[np.ndarray, " 3"], float, str]
NOWHERE = np.zeros((0, 3))


class CellView:
    """One scene of all there is."""

    def __init__(
        self,
        robot: Robot | None,
        q: Float[np.ndarray, "n joints"],
        *,
        meshes: RobotMeshes | None = None,
        cloud: Places = NOWHERE,
        colours: Places | None = None,
        on_pick: Callable[[int], None] | None = None,
        instruments: Float[np.ndarray, "m 3"] = NOWHERE,
        targets: int = 0,
        keep_out: Sequence[Box] = (),
        workspace: Workspace | None = None,
    ) -> None:
        """Show the robot at the first of some poses, and what stands around it; the whole fitted into the view.

        Args:
            robot: the robot; None where it is not known how the points lie to it.
            q: joint positions that it goes to, radians or metres.
            meshes: of its links, drawn in place of bars where none of them is missing.
            cloud: points, in the robot's base, metres.
            colours: of the points, red, green and blue of sRGB from 0 to 1.
            on_pick: called with the number of a point that is clicked.
            instruments: where trackers stand, metres.
            targets: points that are marked, and measured, at once, at most.
            keep_out: boxes that neither robot nor beam may enter.
            workspace: of the task; what is drawn of it is drawn by others, and is in the first view.
        """
        self._points, self._on_pick, self._robot = cloud, on_pick, None
        self._arrows: list[ui.scene.line] = []
        seen = [cloud, *(box.pose[None, :3, 3] for box in keep_out)]
        seen += outline(workspace) if workspace is not None else []
        if robot is not None:
            skeleton = trace_skeleton(robot, q[spread_rows(len(q), MAX_FITTED)])
            lines = np.concatenate([link.reshape(-1, 3) for link in (*skeleton.links, *skeleton.loop)])
            thick = 1e-3 * max(robot_look(robot)["links"], default=0.0) * np.eye(3)
            seen += [*(lines + side for side in (*thick, *-thick)), np.zeros((1, 3))]
            near = np.linalg.norm(instruments, axis=1) <= MAX_INSTRUMENT * robot.reach
            seen.append(instruments[near])
        self._seen = np.concatenate(seen)
        self._seen = self._seen[np.isfinite(self._seen).all(axis=1)]
        self.size = max(0.5 * float(np.linalg.norm(np.ptp(self._seen, axis=0))), 1e-3)
        """Half of the diagonal of what the first view shows, metres."""
        pickable = on_pick is not None and 0 < len(cloud) <= MAX_PICKED
        metres = 2 * int(np.ceil(np.abs(self._seen[:, :2]).max())) if robot is not None else 0
        self.scene = ui.scene(
            width=800,
            height=500,
            grid=(metres, 2 * metres) if metres else False,
            camera=ui.scene.perspective_camera(fov=FIELD_DEG, near=0.01 * self.size, far=100.0 * self.size),
            on_click=self._pick if pickable else None,
            click_events=["click"] if pickable else [],
        ).classes("view")
        self.scene.on("init", js_handler=f"() => taskcalScene('{self.scene.html_id}', {DARK_GAIN})")
        colours = np.tile(INK, (len(cloud), 1)) if colours is None else colours
        axes = 0.2 * self.size
        with self.scene:
            if robot is not None:
                self._robot = _RobotDrawing(self.scene, robot, q[0], meshes, 0.6 * axes)
            if len(cloud):
                largest = 1.0 if robot is not None else FEW_POINTS_LARGER
                point_size = self.size * POINT_SHARE * min(largest, (MAX_FULL_SIZE / len(cloud)) ** (1.0 / 3.0))
                self._cloud = self.scene.point_cloud(cloud.tolist(), linear(colours).tolist(), point_size)
            for x, y, z in instruments.tolist():
                foot, head = 0.12 * self.size, 0.03 * self.size
                self.scene.cylinder(0.5 * head, head, foot, 16).material(INSTRUMENT).rotate(np.pi / 2, 0, 0).move(
                    x, y, z - 0.5 * foot
                )
                self.scene.sphere(head).material(INSTRUMENT).move(x, y, z)
            radius, beams = 0.003 * self.size, targets if len(instruments) else 0
            self._beams = [
                self.scene.cylinder(radius, radius, 1.0, 6).material(BEAM).visible(False) for _ in range(beams)
            ]
            self._marks = [self.scene.sphere(5.0 * radius).material(MARK).visible(False) for _ in range(targets)]
            for box in keep_out:
                drawn = self.scene.box(*box.size.tolist()).material(KEEP_OUT, opacity=0.35)
                drawn.rotate_R(box.pose[:3, :3].tolist()).move(*box.pose[:3, 3].tolist())
            corner = (
                np.zeros(3) if robot is not None else self._seen.min(axis=0)
            )  # the base may be far away from points alone
            self.scene.axes_helper(axes).move(*corner.tolist())
            for letter, place in zip("XYZ", corner + 1.15 * axes * np.eye(3), strict=True):
                self.scene.text(letter).move(*place.tolist())
        self.look("oblique")

    def move(self, q: Float[np.ndarray, " joints"]) -> None:
        """Bring the robot to joint positions q, radians or metres.

        Raises:
            ClosureError: its loop does not close there.
        """
        if self._robot is not None:
            self._robot.move(q)

    def aim(self, start: Float[np.ndarray, " 3"], ends: Places) -> None:
        """Show beams from an instrument to points, metres; none without points."""
        with self.scene._batch_calls():  # pyright: ignore[reportPrivateUsage]
            for number, beam in enumerate(self._beams):
                if number < len(ends):
                    stretch_cylinder(beam, start, ends[number])
                else:
                    beam.visible(False)

    def look(self, view: str) -> None:
        """See it from one of `VIEWS`, near enough that all of it just has room."""
        place, at = fitted_camera(np.array(VIEWS[view]), self._seen)
        self.scene.move_camera(*place.tolist(), *at.tolist(), duration=0.0)

    def draw_arrows(self, numbers: Sequence[int], arrows: Places, scale: float, colour: str = ARROW) -> None:
        """Draw a line from each of some points.

        Args:
            numbers: of the points.
            arrows: from them, metres.
            scale: how many times as long as they are.
            colour: of the lines.
        """
        with self.scene, self.scene._batch_calls():  # pyright: ignore[reportPrivateUsage]
            for number, arrow in zip(numbers, arrows, strict=True):
                line = self.scene.line([0.0, 0.0, 0.0], arrow.tolist()).material(colour)
                self._arrows.append(line.move(*self._points[number].tolist()))
        self.stretch_arrows(scale)

    def stretch_arrows(self, scale: float) -> None:
        """Show the arrows so many times as long as they are."""
        with self.scene._batch_calls():  # pyright: ignore[reportPrivateUsage]
            for line in self._arrows:
                line.scale(scale)

    def colour(self, colours: Places) -> None:
        """Show the points in other colours."""
        self._cloud.set_points(self._points.tolist(), linear(colours).tolist())

    def mark(self, places: Places) -> None:
        """Show points as picked, metres."""
        with self.scene._batch_calls():  # pyright: ignore[reportPrivateUsage]
            for number, mark in enumerate(self._marks):
                mark.visible(number < len(places))
                if number < len(places):
                    mark.move(*places[number].tolist())

    def _pick(self, event: SceneClickEventArguments) -> None:
        """The point nearest to the line of sight through a click."""
        hits = np.array([(hit.x, hit.y, hit.z) for hit in event.hits if hit.object_id == self._cloud.id]).reshape(-1, 3)
        distances = np.linalg.norm(hits[:, None] - self._points[None], axis=2)
        if self._on_pick is not None and distances.min(initial=np.inf) <= PICKED_WITHIN * self.size:
            self._on_pick(int(np.unravel_index(np.argmin(distances), distances.shape)[1]))


class _RobotDrawing:
    """A robot in a scene, with the parts, proportions and materials that it has in reports."""

    def __init__(
        self, scene: ui.scene, robot: Robot, q: Float[np.ndarray, " joints"], meshes: RobotMeshes | None, axes: float
    ) -> None:
        self._scene, self._robot, self._meshes, self._axes = scene, robot, meshes, axes
        self._look = robot_look(robot)
        covered = meshes is not None and bool(meshes.drawn) and not meshes.missing
        self._corners = None if covered else lasting_corners(robot, q)
        colours: Mapping[str, str] = self._look["colours"]
        bars, balls = drawn_parts(trace_skeleton(robot, q[None]), self._look, self._corners)
        self._bars = [scene.cylinder(r, r, 1.0, 24).material(colours[part]) for _, r, part in bars]
        self._balls = [scene.sphere(r, 24, 12).material(colours[part]) for _, r, part in balls]
        self._shells = [
            scene.stl(f"/mesh/{quote(Path(meshes.robot).name)}/{number}").material(colours["link"]).scale(*visual.scale)
            for number, visual in meshes.drawn
        ] if meshes is not None else []  # fmt: skip
        self._tool = scene.axes_helper(axes)
        self._letters = [scene.text(letter) for letter in "xyz"]
        self.move(q)

    def move(self, q: Float[np.ndarray, " joints"]) -> None:
        skeleton = trace_skeleton(self._robot, q[None])
        bars, balls = drawn_parts(skeleton, self._look, self._corners)
        with self._scene._batch_calls():  # pyright: ignore[reportPrivateUsage]  # a message a pose, not one a bar
            for bar, (ends, _, _) in zip(self._bars, bars, strict=True):
                stretch_cylinder(bar, *ends)
            for ball, (place, _, _) in zip(self._balls, balls, strict=True):
                ball.move(*place.tolist())
            if self._meshes is not None:
                poses = self._meshes.poses(self._robot.joint_names, q)
                for shell, T in zip(self._shells, poses, strict=True):
                    shell.move(*T[:3, 3].tolist()).rotate_R(T[:3, :3].tolist())
            T = skeleton.tool[0]
            self._tool.move(*T[:3, 3].tolist()).rotate_R(T[:3, :3].tolist())
            for letter, place in zip(self._letters, T[:3, 3] + 1.15 * self._axes * T[:3, :3].T, strict=True):
                letter.move(*place.tolist())


def lasting_corners(robot: Robot, q: Float[np.ndarray, " joints"]) -> list[Int[np.ndarray, " _"]]:
    """Corners of every link without those that always lie on the one before; at q, and where a part may have slid to."""
    probed = [q]
    if robot.four_bar is None:  # whose loop need not close elsewhere
        low, high = robot.bounded_limits().T
        probed += list(np.random.default_rng(0).uniform(low, high, (3, len(q))))
    links = trace_skeleton(robot, np.array(probed)).links
    apart = (np.linalg.norm(np.diff(link, axis=1), axis=2).max(axis=0) > MIN_LENGTH_M for link in links)
    return [np.flatnonzero(np.r_[True, one]) for one in apart]


def drawn_parts(
    skeleton: Skeleton, look: Mapping[str, Any], corners: Sequence[Int[np.ndarray, " _"]] | None
) -> tuple[list[Bar], list[Ball]]:
    """Bars and balls of a robot at the first pose of a skeleton, in the proportions of `robot_look`.

    Args:
        skeleton: lines of the robot.
        look: its proportions.
        corners: of every link that are joined; None where meshes stand for links and joints.
    """
    bars, balls = list[Bar](), list[Ball]()
    if corners is not None:
        for link, chosen, radius in zip(skeleton.links, corners, look["links"], strict=True):
            at = link[0, chosen]
            bars += [(ends, radius * 1e-3, "link") for ends in np.stack([at[:-1], at[1:]], axis=1)]
            balls += [(corner, radius * 1e-3, "link") for corner in at[1:-1]]
        drums = zip(skeleton.origins[0], skeleton.axes[0], look["drums"], look["halves"], strict=True)
        bars += [
            (at + 1e-3 * half * np.array([[-1.0], [1.0]]) * axis, 1e-3 * r, "joint") for at, axis, r, half in drums
        ]
    bars += [(bar[0], look["bar"] * 1e-3, "loop") for bar in skeleton.loop]
    balls += [(pin, look["pin"] * 1e-3, "loop") for bar in skeleton.loop for pin in bar[0]]
    return bars, [*balls, (skeleton.tool[0, :3, 3], look["tool"] * 1e-3, "tool")]


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
    bar.visible(True).scale(radius, length, radius).rotate_R(turn.tolist()).move(*(0.5 * (start + end)).tolist())


def fitted_camera(
    direction: Float[np.ndarray, " 3"], points: Places
) -> tuple[Float[np.ndarray, " 3"], Float[np.ndarray, " 3"]]:
    """The place from which all points are just seen, and the point that is looked at.

    Args:
        direction: in which the camera stands.
        points: to be seen, metres.
    """
    out = direction / np.linalg.norm(direction)
    right = np.cross([0.0, 0.0, 1.0], out)
    right /= np.linalg.norm(right)
    axes = np.stack([right, np.cross(out, right), out], axis=1)
    local = points @ axes
    middle = 0.5 * (local.max(axis=0) + local.min(axis=0))
    half = np.tan(np.radians(0.5 * FIELD_DEG)) / MARGIN
    away = np.abs(local - middle)
    distance = (np.maximum(away[:, 0] / (half * LEAST_ASPECT), away[:, 1] / half) + local[:, 2] - middle[2]).max()
    at = axes @ middle
    return at + max(float(distance), 1e-3) * out, at


def linear(colours: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 3"]:
    """Colours of sRGB as three.js takes those of points: as shares of light (IEC 61966-2-1)."""
    return np.where(colours <= 0.04045, colours / 12.92, ((colours + 0.055) / 1.055) ** 2.4)


# A box in a scene, with balls before its faces: the box is dragged to be moved, a ball to turn it; and the tool's
# cones.

AXES = ("#b3261e", "#00674b", "#00558a")
"""Colours of x, y and z: red, green and blue, dark enough on a light ground."""

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


# The directions from which a scene is seen: a button for each, and a key while the scene has the focus.

PRESSED = "(event) => { if (/^[1-9]$/.test(event.key) && !event.ctrlKey && !event.altKey && !event.metaKey) emit(event.key); }"


def add_views(view: CellView, label: str, texts: Texts) -> None:
    """Say what a scene shows, and add its views; in a row of elements, so that others can follow.

    Args:
        view: the scene.
        label: what the scene shows, for those who do not see it.
        texts: of the page.
    """
    names = tuple(VIEWS)

    def press(event: Any) -> None:
        number = int(event.args)
        if number <= len(names):
            view.look(names[number - 1])

    view.scene.props("role=img tabindex=0 data-steps")
    set_attribute(view.scene, "aria-label", label)
    view.scene.on("keydown", press, js_handler=PRESSED)
    for number, name in enumerate(names, 1):
        shown = button(texts(f"robot.view_{name}"), lambda name=name: view.look(name), plain=True)
        set_attribute(shown, "aria-keyshortcuts", str(number))
    text("span", texts("robot.view_keys", count=len(names))).classes("quiet")


# A robot that goes from row to row: by a slider, by itself, or to what is selected elsewhere on the page.

STEPS = 6
"""Pictures from one row to the next."""

STEP_S = 0.1

Beams = Callable[[int | None, Float[np.ndarray, " joints"]], tuple[Float[np.ndarray, " 3"], Places]]
"""Where an instrument stands, and the points to which its beams go: of a row, or of joint positions on the way to one."""


class RowPlayer:
    """A slider and a button that plays the rows, below a scene."""

    def __init__(
        self,
        view: CellView,
        q: Float[np.ndarray, "n joints"],
        selection: RowSelection,
        label: str,
        texts: Texts,
        *,
        tell: Callable[[int], str],
        beams: Beams | None = None,
        points: Callable[[int], Places] | None = None,
    ) -> None:
        """Show the row that is selected.

        Args:
            view: the scene.
            q: joint positions of each row, radians or metres.
            selection: that it follows, and makes.
            label: what the scene shows.
            texts: of the page.
            tell: what is said of a row.
            beams: that are shown.
            points: of a row, that are marked.
        """
        self._view, self._q, self._selection, self._texts = view, q, selection, texts
        self._tell, self._beams, self._points = tell, beams, points
        self._at, self._step = 0, 0
        with ui.element("div").classes("row"):
            add_views(view, label, texts)
        with ui.element("div").classes("row"):
            self._play = button(texts("player.play"), self._toggle)
            with ui.element("label").classes("row"):
                text("span", texts("player.pose"))
                self._slider = ValueInput("range", texts("player.pose"), "0", min="0", max=str(len(q) - 1), step="1")
                self._slider.on_moved(self._choose, STEP_S)
            self._said = text("span", "").props("role=status")
        self._timer = ui.timer(STEP_S, self._advance, active=False)
        selection.follow(self._follow)

    def _choose(self, given: str) -> None:
        """A row from the slider."""
        if given.isdecimal():
            self._selection.choose(int(given[:9]))

    def _follow(self, row: int) -> None:
        self._at, self._step = row, 0
        self._show(self._q[row])

    def _toggle(self) -> None:
        if self._timer.active:
            self._timer.deactivate()
        else:
            if self._at == len(self._q) - 1:
                self._selection.choose(0)
            self._timer.activate()
        self._play.set_text(self._texts("player.stop" if self._timer.active else "player.play"))

    def _advance(self) -> None:
        """The next picture, on the way in the joints from this row to the next."""
        if self._at == len(self._q) - 1:
            self._toggle()
        elif self._step + 1 == STEPS:
            self._selection.choose(self._at + 1)
        else:
            self._step += 1
            share = self._step / STEPS
            self._show((1.0 - share) * self._q[self._at] + share * self._q[self._at + 1])

    def _show(self, q: Float[np.ndarray, " joints"]) -> None:
        row = None if self._step else self._at
        try:
            self._view.move(q)
        except TaskcalError as error:  # a loop need not close on the way between two poses at which it does
            message(str(error))
        if self._beams is not None:
            self._view.aim(*self._beams(row, q))
        if row is not None:
            self._slider.show(str(row))
            self._said.set_text(self._tell(row))
            if self._points is not None:
                self._view.mark(self._points(row))


# A figure of a report on a page.


def figure(caption: str, drawn: chart.Figure, texts: Texts, note: str = "", *, selects: bool = False) -> Element:
    """Show a figure.

    Args:
        caption: what it shows.
        drawn: the figure.
        texts: in whose language it is.
        note: how to read it.
        selects: whether its marks stand for rows of the page's selection.
    """
    with ui.element("figure").props("tabindex=0 data-steps" if selects else "") as whole:
        text("figcaption", caption)
        ui.html(chart.html(drawn.said(texts.said), caption, texts.number, selects=selects), sanitize=False)
        if note:
            text("p", note).classes("quiet")
    return whole
