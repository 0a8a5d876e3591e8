"""A task: the poses that matter, how much each counts, and the accuracy needed."""

import os
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np
from jaxtyping import Bool, Float
from pydantic import Field, model_validator

from taskcal.arguments import checked
from taskcal.errors import FileError, ReachError
from taskcal.geometry import se3
from taskcal.io.toml_file import Direction, FileSection, Finite, HalfTurn, Positive, read_toml
from taskcal.kinematics.inverse import (
    ANY_MISS,
    Reached,
    find_posture,
    find_postures,
    follow,
    freedom_of,
    solve_near,
)
from taskcal.robot.error_model import ErrorModel
from taskcal.short_repr import short_repr
from taskcal.tables.forms import read_csv
from taskcal.task.orientation import DirectedSection, TurnSection, read_tool_poses, towards
from taskcal.task.workspace import Orientation, Workspace

AT_THE_BASE = 0.01
"""Share of a robot's reach, within which of the middle of its base no robot works."""

Triple = tuple[Finite, Finite, Finite]


@checked
@short_repr
@dataclass(frozen=True, eq=False, kw_only=True)
class Task:
    """Task of a robot: workspace, poses or path, and the required accuracy."""

    name: str
    workspace: Workspace | None = None
    """Where the tool works; None for a list of poses or a path."""
    poses: Float[np.ndarray, "n 4 4"] | None = None
    """Tool poses in the base, for a list or a path."""
    joints: Float[np.ndarray, "n joints"] | None = None
    """Joint positions that reach the poses, radians, where they are known; else they are looked for."""
    weights: Float[np.ndarray, " n"] | None = None
    """How much each pose counts."""
    path: bool = False
    """Whether the poses are run through in order."""
    accuracy: float | None = None
    """Position error allowed in space, metres."""


@short_repr
@dataclass(frozen=True, eq=False, kw_only=True)
class TaskPoses:
    """Poses of a task that the robot reaches, with the joints that do."""

    T: Float[np.ndarray, "n 4 4"]
    """Tool poses in the base."""
    q: Float[np.ndarray, "n joints"]
    """Joint positions, radians, all on the branch of the task's middle."""
    weights: Float[np.ndarray, " n"]
    """Adding up to one."""
    unreachable: Bool[np.ndarray, " asked"]
    """Which of the poses asked for are missing."""

    def __len__(self) -> int:
        return len(self.q)


@checked
def reach_task(
    model: ErrorModel,
    task: Task,
    count: int = 200,
    seed: int = 0,
    known: Float[np.ndarray, "n joints"] | None = None,
) -> TaskPoses:
    """Poses of a task with the joints that reach them, continuous in the branch of the task's middle.

    A robot that commands fewer than six directions takes the nearest poses that it can, where these are in the workspace, too.

    Args:
        model: the model of the nominal robot.
        task: the task.
        count: how many poses to spread over a workspace; a list or a path has its own.
        seed: of the spread.
        known: joint positions in the branch in which the robot works, such as measured ones, radians; by default the branch is
            that of the posture which is deepest inside the limits.

    Raises:
        ReachError: the robot reaches the task nowhere, or leaves the branch along a path; or the task is at its very base.
    """
    model = model.nominal
    _check_unit(model, task)
    if task.workspace is not None:
        T, weights = task.workspace.sample(count, seed), np.ones(count)
        q, reached = _spread(model, task.workspace, T, known)
        if not freedom_of(model).whole:
            T[reached] = model.poses(q[reached])
    else:
        assert task.poses is not None
        T = task.poses
        weights = np.ones(len(T)) if task.weights is None else task.weights
        if task.joints is not None:
            q, reached = task.joints, model.robot.inside_limits(task.joints)
        elif task.path:
            q, reached = _in_order(model, T, known)
        else:
            found = follow(model, T, _posture(model, T[len(T) // 2], known))
            q, reached = found.q, found.reached
    if not reached.any():
        raise ReachError(
            f"{model.robot.name} reaches none of the {len(T)} poses of task '{task.name}' on one branch inside its limits; "
            "move the workspace or turn the tool"
        )
    kept = weights[reached]
    return TaskPoses(T=T[reached], q=q[reached], weights=kept / kept.sum(), unreachable=~reached)


# Where measuring poses for a task may be.

MEASURING_ROOM, MEASURING_TURN = 1.5, np.radians(45.0)
"""Measured poses may lie in a box 1.5 times the task's, with the tool up to 45° from the task's orientations."""


def enlarge(task: Task, model: ErrorModel) -> Task:
    """A task's workspace with the room that measuring poses may take; around the poses of a list or a path."""
    if task.workspace is not None:
        space = task.workspace
        turned = tuple(
            Orientation(rotation=o.rotation, cone=max(o.cone, MEASURING_TURN), spin=max(o.spin, MEASURING_TURN))
            for o in space.orientations
        )
        return replace(task, workspace=replace(space, size=MEASURING_ROOM * space.size, orientations=turned))
    assert task.poses is not None
    low, high = task.poses[:, :3, 3].min(axis=0), task.poses[:, :3, 3].max(axis=0)
    # a flat or narrow path still needs room in every direction
    size = np.maximum(MEASURING_ROOM * (high - low), 0.1 * model.robot.reach)
    middle = task.poses[len(task.poses) // 2, :3, :3]
    space = Workspace(
        T_base_frame=np.eye(4),
        shape="box",
        center=0.5 * (low + high),
        size=size,
        turned=np.eye(3),
        orientations=(Orientation(rotation=middle, cone=MEASURING_TURN, spin=MEASURING_TURN),),
    )
    return Task(name=task.name, workspace=space, accuracy=task.accuracy)


def measuring_task(model: ErrorModel, task: Task) -> Task:
    """Task in which to measure without a plan: the task's own workspace; for poses or a path, which may be a line, around it."""
    return task if task.workspace is not None else enlarge(task, model)


def _check_unit(model: ErrorModel, task: Task) -> None:
    """See that the task is not where no robot works: lengths in metres, read as millimetres, put it there."""
    if task.workspace is not None:
        room = task.workspace
        middle = se3.apply(room.T_base_frame, room.center)
        away = float(np.linalg.norm(middle) + 0.5 * np.linalg.norm(room.size))
    else:
        assert task.poses is not None
        away = float(np.linalg.norm(task.poses[:, :3, 3], axis=1).max())
    if away < AT_THE_BASE * model.robot.reach:
        raise ReachError(
            f"task '{task.name}' lies within {away * 1e3:.2g} mm of the middle of the robot's base: its lengths seem to be in "
            "metres; write them in millimetres"
        )


def _posture(
    model: ErrorModel, T: np.ndarray, known: np.ndarray | None, workspace: Workspace | None = None
) -> np.ndarray:
    """A posture for one pose: in the branch of the known one whose pose is nearest, if that leads to it.

    Of a workspace it may be for a pose beside that one in the workspace, where the robot does not reach it itself.
    """
    if known is not None and len(known):
        there = model.poses(known)
        away = np.linalg.norm(there[:, :3, 3] - T[:3, 3], axis=1) / model.robot.reach
        away += np.linalg.norm(se3.log(T[:3, :3] @ np.swapaxes(there[:, :3, :3], 1, 2)), axis=1)
        near = known[np.argmin(away)]
        found = follow(model, T[None], near) if workspace is None else follow_inside(model, workspace, T[None], near)
        if found.reached[0]:
            return found.q[0]
    return find_posture(model, T) if workspace is None else find_posture_inside(model, workspace, T)


def find_posture_inside(
    model: ErrorModel, workspace: Workspace, T: Float[np.ndarray, "4 4"]
) -> Float[np.ndarray, " joints"]:
    """A posture for a pose of a workspace, or for the nearest that the robot can take, the best of those in the workspace.

    Raises:
        ReachError: no seed leads there inside the limits; the message has how far the tool is turned from the orientation at
            least, where it is that which is missed.
    """
    postures = find_postures(model, T, miss=ANY_MISS)
    there = model.poses(postures)
    inside = workspace.contains(there)
    if inside.any():
        return postures[np.argmax(inside)]
    away = np.linalg.norm(there[:, :3, 3] - T[:3, 3], axis=1)
    turned = np.linalg.norm(se3.log(there[:, :3, :3] @ T[:3, :3].T), axis=1)
    best = int(np.argmin(turned + away / model.robot.reach))
    freedom = freedom_of(model)
    x, y, z = T[:3, 3] * 1e3
    raise ReachError(
        f"{model.robot.name} moves its tool in {freedom.rank} of six directions, and comes no nearer to the pose at x {x:.0f}, "
        f"y {y:.0f}, z {z:.0f} mm than {away[best] * 1e3:.3g} mm and {np.degrees(turned[best]):.3g}°; state an orientation that it "
        "can take, or open it in the task file (cone_deg, spin)"
    )


def _spread(
    model: ErrorModel, workspace: Workspace, T: np.ndarray, known: np.ndarray | None
) -> tuple[np.ndarray, np.ndarray]:
    """Each orientation on the branch of its own middle, each middle on the branch of the first if it can be."""
    q, reached = np.zeros((len(T), len(model.robot.joints))), np.zeros(len(T), dtype=bool)
    first: np.ndarray | None = None
    for k, middle in enumerate(workspace.middle()):
        mine = slice(k, None, len(workspace.orientations))
        start = None
        if first is not None:
            on_branch = follow_inside(model, workspace, middle[None], first)
            start = on_branch.q[0] if on_branch.reached[0] else None
        if start is None:
            start = _posture(model, middle, known, workspace)
        first = start if first is None else first
        found = follow_inside(model, workspace, T[mine], start)
        q[mine], reached[mine] = found.q, found.reached
    return q, reached


def follow_inside(
    model: ErrorModel, workspace: Workspace, T: Float[np.ndarray, "n 4 4"], start: Float[np.ndarray, " joints"]
) -> Reached:
    """Follow poses of a workspace on the branch of a posture, or the nearest that the robot can take in that workspace.

    Args:
        model: of the nominal robot.
        workspace: the workspace.
        T: tool poses in the base.
        start: posture that the branch is taken from, radians or metres.
    """
    found = follow(model, T, start, miss=ANY_MISS)
    if freedom_of(model).whole:
        return found
    inside = found.reached.copy()
    inside[inside] = workspace.contains(model.poses(found.q[inside]))
    return replace(found, reached=inside)


def _in_order(model: ErrorModel, T: np.ndarray, known: np.ndarray | None) -> tuple[np.ndarray, np.ndarray]:
    """Along a path, each pose from the one before."""
    q, reached = np.zeros((len(T), len(model.robot.joints))), np.zeros(len(T), dtype=bool)
    last = _posture(model, T[0], known)
    for i in range(len(T)):
        found = solve_near(model, T[i : i + 1], last[None])
        q[i], reached[i] = found.q[0], found.reached[0]
        if reached[i]:
            if np.abs(q[i] - last).max() > np.pi / 3:
                x, y, z = T[i, :3, 3] * 1e3
                raise ReachError(
                    f"the path leaves its branch at pose {i} (x {x:.1f}, y {y:.1f}, z {z:.1f} mm): a joint would jump by "
                    f"{np.degrees(np.abs(q[i] - last).max()):.0f}°; give closer poses, or keep away from the singularity"
                )
            last = q[i]
    return q, reached


class OrientationSection(DirectedSection):
    """A tool orientation of a task file."""

    cone_deg: HalfTurn = 0.0
    spin: Literal["fixed", "free"] = "fixed"
    spin_deg: HalfTurn | None = None

    @model_validator(mode="after")
    def _consistent(self) -> "OrientationSection":
        if not self.stated and self.direction is None:
            raise ValueError(
                "says no orientation; give quaternion, rpy_deg, abc_deg (KUKA), wpr_deg (FANUC) or direction"
            )
        if self.direction is not None and (
            self.spin_deg is not None or ("spin" in self.model_fields_set and self.spin == "fixed")
        ):
            raise ValueError(
                "a direction leaves the turn about it free; state the orientation in another way to hold it"
            )
        return self

    def orientation(self) -> Orientation:
        """The orientation it describes."""
        spin = 180.0 if self.spin == "free" or self.direction is not None else self.spin_deg or 0.0
        return Orientation(
            rotation=self.rotation(),
            cone=float(np.radians(self.cone_deg)),
            spin=float(np.radians(spin)),
        )


class WorkspaceSection(TurnSection):
    """The workspace of a task file; a rotation is that of the box in the frame, none where none is stated."""

    frame: str = "base"
    shape: Literal["box", "cylinder"] = "box"
    center_mm: Triple
    size_mm: tuple[Positive, Positive, Positive] | None = None
    radius_mm: Positive | None = None
    height_mm: Positive | None = None
    axis: Direction = (0.0, 0.0, 1.0)
    orientation: tuple[OrientationSection, ...] = Field(min_length=1)

    @model_validator(mode="after")
    def _consistent(self) -> "WorkspaceSection":
        box = self.size_mm is not None
        cylinder = self.radius_mm is not None and self.height_mm is not None
        if self.shape == "box" and (not box or self.radius_mm is not None or self.height_mm is not None):
            raise ValueError("a box has size_mm, and neither radius_mm nor height_mm")
        if self.shape == "cylinder" and (not cylinder or box):
            raise ValueError("a cylinder has radius_mm and height_mm, and no size_mm")
        if self.shape == "cylinder" and self.stated:
            raise ValueError("a cylinder is turned by its axis; give axis in place of the rotation")
        if self.shape == "box" and "axis" in self.model_fields_set:
            raise ValueError("a box has no axis; turn it by quaternion, rpy_deg, abc_deg or wpr_deg")
        return self

    def turned(self) -> Float[np.ndarray, "3 3"]:
        """Rotation of the shape in the frame."""
        return towards(np.array(self.axis)) if self.shape == "cylinder" else self.rotation()


class FrameSection(TurnSection):
    """A named frame of a task file, by its pose in the robot's base; not turned where no rotation is stated."""

    position_mm: Triple


class AccuracySection(FileSection):
    """The accuracy needed: in space, or along each axis."""

    position_mm: Positive | None = None
    per_axis_mm: tuple[Positive, Positive, Positive] | None = None

    @model_validator(mode="after")
    def _one(self) -> "AccuracySection":
        if (self.position_mm is None) == (self.per_axis_mm is None):
            raise ValueError("give position_mm, an error in space, or per_axis_mm, three errors along x, y and z")
        return self

    def in_space(self) -> float:
        """Error in space that meets it, metres; for errors along the axes the smallest, which is on the safe side."""
        return (self.position_mm or min(self.per_axis_mm or (0.0,))) * 1e-3


class TaskFile(FileSection):
    """A task file."""

    name: str = Field(min_length=1)
    workspace: WorkspaceSection | None = None
    poses: str | None = None
    path: str | None = None
    frames: dict[str, FrameSection] = Field(default_factory=dict)
    accuracy: AccuracySection | None = None

    @model_validator(mode="after")
    def _one(self) -> "TaskFile":
        given = [key for key in ("workspace", "poses", "path") if getattr(self, key) is not None]
        if len(given) != 1:
            raise ValueError(
                f"a task has exactly one of workspace, poses, path; this one has {' and '.join(given) or 'none'}"
            )
        if self.workspace and self.workspace.frame != "base" and self.workspace.frame not in self.frames:
            known = ", ".join(["base", *self.frames])
            raise ValueError(f"the workspace's frame '{self.workspace.frame}' is not defined; known: {known}")
        return self

    def task(self, folder: Path) -> Task:
        """The task it describes; files are looked for in the folder, and no other ones are read."""
        accuracy = self.accuracy.in_space() if self.accuracy else None
        if self.workspace is None:
            named = folder / (self.poses or self.path or "")
            own, real = Path(os.path.realpath(folder)), Path(os.path.realpath(str(named).replace("\0", "")))
            if not real.is_relative_to(own):
                raise FileError(
                    named,
                    "is named by a task, but lies outside the task file's folder; put it there, since a task that somebody else "
                    "wrote reads no other file",
                )
            poses, weights = _read_poses(named)
            return Task(name=self.name, poses=poses, weights=weights, path=self.path is not None, accuracy=accuracy)
        section = self.workspace
        frame = np.eye(4)
        if section.frame != "base":
            placed = self.frames[section.frame]
            frame = se3.pose(placed.rotation(), np.array(placed.position_mm) * 1e-3)
        size = section.size_mm or (
            2 * (section.radius_mm or 0.0),
            2 * (section.radius_mm or 0.0),
            section.height_mm or 0.0,
        )
        workspace = Workspace(
            T_base_frame=frame,
            shape=section.shape,
            center=np.array(section.center_mm) / 1e3,
            size=np.array(size) / 1e3,
            turned=section.turned(),
            orientations=tuple(o.orientation() for o in section.orientation),
        )
        return Task(name=self.name, workspace=workspace, accuracy=accuracy)


def _read_poses(path: Path) -> tuple[Float[np.ndarray, "n 4 4"], Float[np.ndarray, " n"]]:
    """Poses of a CSV with x_mm y_mm z_mm, an orientation and, optionally, weight."""
    columns = read_csv(path)
    T = read_tool_poses(columns)
    if not len(columns):
        raise columns.error("has no poses below its header")
    weights = columns.numbers("weight") if "weight" in columns else np.ones(len(columns))
    for row in np.flatnonzero(weights < 0):
        raise columns.error(f"{weights[row]:g} is not a weight; give zero or more", int(row), "weight")
    if not weights.any():
        raise columns.error("all weights are zero; give at least one pose a weight")
    return T, weights


@checked
def load_task(path: str | Path) -> Task:
    """Read a task file.

    Raises:
        FileError: it is missing, no TOML, or does not describe a task; or it names a file outside its own folder.
    """
    path = Path(path)
    described = read_toml(path, TaskFile)
    return described.task(path.parent)
