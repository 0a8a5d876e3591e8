"""What a task and a plan are edited by: a robot and the box of its task, the tool's orientations, the measuring station."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, Literal

import numpy as np
import tomli_w
from jaxtyping import Float
from nicegui import ui
from nicegui.elements.mixins.text_element import TextElement

from taskcal.errors import TaskcalError
from taskcal.io.files import write_whole
from taskcal.io.toml_file import toml_of
from taskcal.observations.point import Station, load_station
from taskcal.robot.robot import Robot
from taskcal_studio.controls import ANGLES, MAX_DISTANCE_MM, Dial, button, drop_zone, facts, number, text
from taskcal_studio.measured_rows import MeasuredRows
from taskcal_studio.project import LAYOUT, STATION_ENDINGS, Project
from taskcal_studio.robot_meshes import RobotMeshes
from taskcal_studio.selection import RowSelection
from taskcal_studio.steps import choose_file, show_error
from taskcal_studio.task_box import FREE, TENTHS, THOUSANDTHS, TaskBox, ToolRoom
from taskcal_studio.texts import Texts
from taskcal_studio.views import UPDATES_S, BoxView, CellView, OnDrag, Part, RowPlayer, add_views

# A robot and the box of its task, moved, stretched and turned by sliders and numbers, and dragged in the scene.

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
        cell: tuple[RobotMeshes | None, MeasuredRows | None],
        *,
        on_move: Callable[[TaskBox], None],
        on_release: Callable[[TaskBox], TaskBox],
    ) -> None:
        """Show a box.

        Args:
            robot: drawn beside it.
            q: its joint positions where nothing was measured, radians or metres.
            box: to begin with.
            texts: of the page.
            cell: meshes of the robot, and what was measured.
            on_move: called with every place of the box while it is dragged.
            on_release: called with the place where it is left; gives the box as it was saved.
        """
        self.box = box
        self._on_move, self._on_release = on_move, on_release
        self._controls: dict[tuple[Property, int], Dial] = {}
        reach = float(np.ceil(robot.reach * 10.0) * 100.0)
        with ui.element("div").classes("side-by-side"):
            with ui.element("div"):
                meshes, measured = cell
                self._view = _show_cell(robot, q, box, meshes, measured, self._drag, texts)
                text("p", texts("task.drag")).classes("quiet")
            with ui.element("div"):
                ranges: dict[Property, tuple[tuple[float, float], float]] = {
                    "center": ((-reach, reach), STEP_MM),
                    "size": ((SMALLEST_MM, reach), STEP_MM),
                    "turn": ((-180.0, 180.0), STEP_DEG),
                }
                for of, (limits, step) in ranges.items():
                    text("h2", texts(f"task.{of}"))
                    for axis, letter in enumerate("xyz"):
                        label, take = f"{texts(f'task.{of}')} {letter}", partial(self._take, of, axis)
                        self._controls[of, axis] = Dial(letter, label, UNITS[of], limits, take, UPDATES_S, f"{step:g}")
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

    def _take(self, of: Property, axis: int, given: str, release: bool) -> None:
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
        for (of, axis), control in self._controls.items():
            control.show(f"{getattr(self.box, of)[axis]:.{2 if of == 'turn' else 1}f}")
        workspace = self.box.workspace
        R = workspace.T_base_frame[:3, :3]
        tools = [(R @ room.rotation, room) for room in workspace.orientations]
        self._view.place(self.box.T_base_box, workspace.size, tools, held)


def _show_cell(
    robot: Robot,
    q: Float[np.ndarray, " joints"],
    box: TaskBox,
    meshes: RobotMeshes | None,
    measured: MeasuredRows | None,
    on_drag: OnDrag,
    texts: Texts,
) -> BoxView:
    """The scene with the box, and a slider over the measured rows where there are any."""
    label = texts("task.space_of", robot=robot.title)
    if measured is None:
        view = CellView(robot, q[None], meshes=meshes, workspace=box.workspace)
        with ui.element("div").classes("row"):
            add_views(view, label, texts)
        return BoxView(view.scene, view.size, len(box.rooms), on_drag)
    points, rows, _ = measured.cloud
    with RowSelection(len(measured.q)) as selection:
        view = CellView(
            robot,
            measured.q,
            meshes=meshes,
            cloud=points,
            on_pick=lambda number: selection.choose(int(rows[number])),
            instruments=measured.standing,
            targets=measured.points.shape[1],
            workspace=box.workspace,
        )
        RowPlayer(
            *(view, measured.q, selection, label, texts),
            tell=lambda row: texts("player.at", id=row, count=len(measured.q)),
            beams=lambda row, _: measured.beams(row),
            points=measured.at,
        )
    return BoxView(view.scene, view.size, len(box.rooms), on_drag)


# The orientations of the tool in a task: their angles, the cone in which it may tilt, and how far it may turn about
# its axis.

MAX_ORIENTATIONS = 6
"""That are edited here; a task file may have more."""


class OrientationEditor:
    """A group of numbers for every orientation."""

    def __init__(self, editor: BoxEditor, texts: Texts) -> None:
        """Show them; a change is saved at once.

        Args:
            editor: of the box in which the tool is turned so.
            texts: of the page.
        """
        self._editor, self._texts = editor, texts
        self._directions: list[TextElement] = []
        text("h2", texts("task.orientations"))
        text("p", texts("task.orientations_how")).classes("quiet")
        rooms = editor.box.rooms
        for k, room in enumerate(rooms):
            self._group(k, room, removable=len(rooms) > 1)
        if len(rooms) < MAX_ORIENTATIONS:
            button(texts("task.add_orientation"), lambda: self._renew((*self._rooms, self._rooms[-1])), plain=True)
        self._tell()

    @property
    def _rooms(self) -> tuple[ToolRoom, ...]:
        return self._editor.box.rooms

    def _group(self, k: int, room: ToolRoom, *, removable: bool) -> None:
        texts = self._texts
        with ui.element("fieldset").classes("orientation"):
            text("legend", texts("task.orientation", number=k + 1))
            with ui.element("div").classes("row"):
                for i, name in enumerate(ANGLES):
                    number(texts(f"task.{name}"), room.angles[i], partial(self._turn, k, i), -360.0, 360.0)
                number(texts("task.cone"), room.cone, lambda value: self._change(k, cone=value), 0, 180)
                number(texts("task.spin"), room.spin, lambda value: self._change(k, spin=value), 0, FREE)
                if removable:
                    button(texts("task.remove_orientation", number=k + 1), lambda: self._remove(k), plain=True)
            told = text("p", "").classes("quiet")
            told.props("role=status")
            self._directions.append(told)

    def _remove(self, k: int) -> None:
        self._renew(tuple(room for other, room in enumerate(self._rooms) if other != k))

    def _turn(self, k: int, i: int, value: float) -> None:
        angles = list(self._rooms[k].angles)
        angles[i] = round(value, THOUSANDTHS)
        self._change(k, angles=tuple(angles))

    def _change(self, k: int, **changed: object) -> None:
        rounded = {name: round(v, THOUSANDTHS) if isinstance(v, float) else v for name, v in changed.items()}
        rooms = tuple(replace(room, **rounded) if other == k else room for other, room in enumerate(self._rooms))
        self._editor.change(replace(self._editor.box, rooms=rooms))
        self._tell()

    def _renew(self, rooms: tuple[ToolRoom, ...]) -> None:
        self._editor.save(replace(self._editor.box, rooms=rooms))
        ui.navigate.reload()

    def _tell(self) -> None:
        """State the direction of the tool's z axis in words that need no convention of angles."""
        for place, orientation in zip(self._directions, self._editor.box.workspace.orientations, strict=True):
            x, y, z = orientation.rotation[:, 2]
            place.set_text(self._texts("task.points_to", direction=f"{x:+.3f} {y:+.3f} {z:+.3f}"))


# The measuring station of a plan: chosen, dropped or begun, and where its tracker stands.

TRACKER_DISTANCE = 1.5
"""Over the robot's reach, at which a tracker is put to begin with: out of reach, in front of the robot."""


class StationEditor:
    """A list of the station files, a place to drop one, and numbers for where the tracker stands."""

    def __init__(self, project: Project, robot: Robot, texts: Texts) -> None:
        """Show it; a change is saved at once.

        Args:
            project: whose stations they are.
            robot: that is measured.
            texts: of the page.
        """
        self._project, self._texts = project, texts
        self.station: Station | None = None
        """As the chosen file has it."""
        chosen = project.choices.station
        files = {path: path for path in project.files(LAYOUT.stations, STATION_ENDINGS)}
        text("h2", texts("station.title"))
        text("p", texts("station.how")).classes("quiet")
        choose_file(project, texts, "station", files, none=texts("station.none"))
        if chosen:
            try:
                self.station = load_station(project.path(chosen))
            except TaskcalError as error:
                show_error(project, error)
            else:
                self._place(chosen, self.station)
        with ui.element("details"):
            text("summary", texts("station.another"))
            drop_zone(texts, "station", texts("station.drop"), STATION_ENDINGS)
            button(texts("station.begin"), lambda: self._begin(robot), plain=True)

    def _begin(self, robot: Robot) -> None:
        """Begin with a tracker before the robot, and one reflector at the TCP."""
        project = self._project
        with project.change():
            begun = first_station(robot).encode()
            project.choose(station=project.put(LAYOUT.stations, "station.toml", begun, STATION_ENDINGS))
        ui.navigate.reload()

    def _place(self, path: str, station: Station) -> None:
        texts = self._texts
        place = station.position * 1e3

        def put(axis: int, value: float) -> None:
            place[axis] = value
            with self._project.change(path, joins=True):
                move_tracker(self._project.path(path), place)

        with ui.element("div").classes("row"):
            for k, letter in enumerate("xyz"):
                number(texts("station.at", axis=letter), place[k], partial(put, k), -MAX_DISTANCE_MM, MAX_DISTANCE_MM)
        names = ", ".join(reflector.name for reflector in station.reflectors)
        facts([(texts("station.reflectors"), names), (texts("station.keep_out"), str(len(station.keep_out)))])


def first_station(robot: Robot) -> str:
    """A station file to begin with: a tracker before the robot, and a reflector at the TCP that is seen from everywhere."""
    away = float(np.ceil(TRACKER_DISTANCE * robot.reach * 10.0) * 100.0)
    content: dict[str, Any] = {
        "position_mm": [away, -0.5 * away, 0.25 * away],
        "reflector": [{"name": "smr1", "position_mm": [0.0, 0.0, 0.0]}],
    }
    return tomli_w.dumps(content)


def move_tracker(path: Path, place: Float[np.ndarray, " 3"]) -> None:
    """Write into a station file where its tracker stands, millimetres in the base; comments are lost, all else stays."""
    content = toml_of(path)
    content["position_mm"] = place.tolist()
    write_whole(path, tomli_w.dumps(content))
