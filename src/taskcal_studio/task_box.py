"""A task's box as a person moves and turns it: read from a task file, and written back with everything else that it says."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w
from jaxtyping import Float

from robot_programs.core.program import Program
from robot_programs.languages import language_of, languages
from taskcal.errors import TaskcalError
from taskcal.geometry import se3
from taskcal.geometry.euler import from_angles, to_angles
from taskcal.io.files import write_whole
from taskcal.io.toml_file import toml_of
from taskcal.robot.robot import Robot
from taskcal.task.orientation import WAYS
from taskcal.task.task import Task, load_task
from taskcal.task.workspace import Orientation, Workspace
from taskcal_studio.project import LAYOUT, Project

TENTHS = 1
"""Decimals of millimetres that a box is written with."""

THOUSANDTHS = 3
"""Decimals of degrees that turns are shown and written with."""

FREE = 180.0
"""Degrees to either side: a turn about the tool's z that is free."""


@dataclass(frozen=True, kw_only=True)
class ToolRoom:
    """An orientation of the tool and the room around it, in degrees."""

    angles: tuple[float, float, float]
    """Roll, pitch and yaw about fixed x, y, z of the task's frame."""
    cone: float
    """Largest tilt of the tool's z."""
    spin: float
    """Largest turn about it; `FREE` where it is free."""

    @property
    def orientation(self) -> Orientation:
        """Orientation, as tasks have it."""
        cone, spin = np.radians([self.cone, self.spin])
        return Orientation(rotation=_rotation(self.angles), cone=float(cone), spin=float(spin))

    @property
    def section(self) -> dict[str, Any]:
        """Section, as task files have it."""
        section: dict[str, Any] = {"rpy_deg": list(self.angles), "cone_deg": self.cone}
        return section | ({"spin": "free"} if self.spin >= FREE else {"spin_deg": self.spin})


@dataclass(frozen=True, eq=False, kw_only=True)
class TaskBox:
    """A box in the task's frame, with the orientations that the tool takes in it; numbers are as they are written."""

    center: Float[np.ndarray, " 3"]
    """Millimetres."""
    size: Float[np.ndarray, " 3"]
    """Edges, millimetres."""
    turn: Float[np.ndarray, " 3"]
    """Roll, pitch and yaw about fixed x, y, z, degrees."""
    rooms: tuple[ToolRoom, ...]
    task: Task
    """The task that the file describes, whose workspace it is."""

    @property
    def workspace(self) -> Workspace:
        """The workspace as it is now; what was not changed is exactly the file's."""
        before = self.task.workspace
        assert before is not None
        known = {_room(o): o for o in before.orientations}
        same = np.array_equal(self.turn, _angles(before.turned))
        return replace(
            before,
            center=self.center * 1e-3,
            size=self.size * 1e-3,
            turned=before.turned if same else _rotation(self.turn),
            orientations=tuple(known.get(room, room.orientation) for room in self.rooms),
        )

    @property
    def moved(self) -> Task:
        """The task with the box as it is now."""
        return replace(self.task, workspace=self.workspace)

    @property
    def T_base_box(self) -> Float[np.ndarray, "4 4"]:
        """Pose of the box in the robot's base, metres."""
        workspace = self.workspace
        return workspace.T_base_frame @ se3.pose(workspace.turned, workspace.center)

    def moved_to(self, place: Float[np.ndarray, " 3"]) -> "TaskBox":
        """With its middle at a place in the robot's base, metres."""
        return replace(self, center=np.round(self._in_frame(place) * 1e3, TENTHS))

    def turned_to(self, axis: int, place: Float[np.ndarray, " 3"]) -> "TaskBox":
        """Turned by the shortest way until one of its axes points to a place in the robot's base, metres."""
        wanted = self._in_frame(place) - self.center * 1e-3
        length = np.linalg.norm(wanted)
        if length < 1e-6:
            return self
        turned = self.workspace.turned
        now, wanted = turned[:, axis], wanted / length
        about = np.cross(now, wanted)
        if np.linalg.norm(about) < 1e-9:  # there already, or opposite: any axis across does
            about = turned[:, (axis + 1) % 3]
        angle = np.arctan2(np.linalg.norm(np.cross(now, wanted)), now @ wanted)
        return replace(self, turn=_angles(se3.exp(angle * about / np.linalg.norm(about)) @ turned))

    def _in_frame(self, place: Float[np.ndarray, " 3"]) -> Float[np.ndarray, " 3"]:
        return se3.apply(se3.inverse(self.workspace.T_base_frame), np.asarray(place, dtype=float))


def box_of(task: Task) -> TaskBox | None:
    """The box of a task; None where its workspace is something else."""
    workspace: Workspace | None = task.workspace
    if workspace is None or workspace.shape != "box":
        return None
    return TaskBox(
        center=workspace.center * 1e3,
        size=workspace.size * 1e3,
        turn=_angles(workspace.turned),
        rooms=tuple(map(_room, workspace.orientations)),
        task=task,
    )


def save_box(path: Path, box: TaskBox) -> TaskBox:
    """Write a box into its task file; comments are lost, all else stays.

    Returns:
        the box as the file has it now.

    Raises:
        FileError: the file cannot be read as a task with a box, or not be written.
    """
    before = box_of(load_task(path))
    content: dict[str, Any] = toml_of(path)
    section = content["workspace"]
    section["center_mm"] = np.round(box.center, TENTHS).tolist()
    section["size_mm"] = np.round(box.size, TENTHS).tolist()
    if before is None or not np.array_equal(before.turn, box.turn):
        for way in WAYS:
            section.pop(way, None)
        section["rpy_deg"] = box.turn.tolist()
    as_written = {} if before is None else dict(zip(before.rooms, section["orientation"], strict=True))
    section["orientation"] = [as_written.get(room, room.section) for room in box.rooms]
    write_whole(path, tomli_w.dumps(content))
    after = box_of(load_task(path))
    assert after is not None
    return after


def save_head(path: Path, *, name: str | None = None, accuracy_mm: float | None = None) -> None:
    """Write a task's name, or the error that it allows, into its file; comments are lost, all else stays.

    Args:
        path: of the file.
        name: of the task.
        accuracy_mm: allowed, 3D; zero for none.

    Raises:
        FileError: the file cannot be read as a task, or not be written.
    """
    load_task(path)
    content: dict[str, Any] = toml_of(path)
    if name is not None:
        content["name"] = name
    if accuracy_mm is not None:
        content.pop("accuracy", None)
        content |= {"accuracy": {"position_mm": accuracy_mm}} if accuracy_mm else {}
    write_whole(path, tomli_w.dumps(content))


def _rotation(angles: tuple[float, float, float] | Float[np.ndarray, " 3"]) -> Float[np.ndarray, "3 3"]:
    return from_angles("rpy", np.radians(np.asarray(angles)))


def _angles(R: Float[np.ndarray, "3 3"]) -> Float[np.ndarray, " 3"]:
    """Degrees, as they are shown."""
    return np.round(np.degrees(to_angles("rpy", R)), THOUSANDTHS) + 0.0  # without a minus before zero


def _room(orientation: Orientation) -> ToolRoom:
    roll, pitch, yaw = _angles(orientation.rotation).tolist()
    cone, spin = np.round(np.degrees([orientation.cone, orientation.spin]), THOUSANDTHS).tolist()
    return ToolRoom(angles=(roll, pitch, yaw), cone=cone, spin=spin)


# A task of the poses that a program drives to.

ACCURACY_MM = 0.1
"""That such a task begins with."""


def is_of_controller(path: str) -> bool:
    """Whether a file is no program but what a controller has for all of its programs, such as its frames: they read it."""
    name = Path(path).name.casefold()
    return name.endswith((".sys", ".va")) or name in {one.base_file.casefold() for one in languages() if one.base_file}


def read_together(project: Project, program: str) -> list[str]:
    """The files of a program: those of its name in the same language, and those of its controller."""
    language, stem = language_of(Path(program)), Path(program).stem.casefold()
    others = [
        path
        for path in project.files(LAYOUT.programs, language.suffixes)
        if path != program and (Path(path).stem.casefold() == stem or is_of_controller(path))
    ]
    return [program, *others]


def program_poses(program: Program, robot: Robot) -> Float[np.ndarray, "n 4 4"]:
    """Poses of the robot's own tool in the base while the flange is where the program's targets have it; metres.

    Raises:
        TaskcalError: no motion of it goes to a pose in a frame that stands still.
    """
    flange = [
        move.flange(move.end.T)
        for move in program.motions
        if move.end.T is not None and not move.carrier and not move.part.moved and move.tool.stated
    ]
    if not flange:
        raise TaskcalError(
            "the program has no motions to poses whose tool and frame are known; read it with its cell file"
        )
    return np.stack(flange) @ robot.T_flange_tool


def task_files(poses: Float[np.ndarray, "n 4 4"], name: str) -> tuple[str, str]:
    """A task file that names a table, and the table.

    Args:
        poses: of the tool in the base, metres.
        name: of the task, and of the table without its ending.
    """
    lines = ["x_mm,y_mm,z_mm,qx,qy,qz,qw"]
    quaternions = se3.to_quaternion(poses[:, :3, :3])
    for point, quaternion in zip(poses[:, :3, 3] * 1e3, quaternions, strict=True):
        lines.append(",".join([*(f"{value:.4f}" for value in point), *(f"{value:.9f}" for value in quaternion)]))
    task = {"name": name, "poses": f"{name}.csv", "accuracy": {"position_mm": ACCURACY_MM}}
    return tomli_w.dumps(task), "\n".join(lines) + "\n"
