"""Error over a task: maps over slices of a workspace, and curves along a path."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from taskcal.errors import ReachError
from taskcal.geometry import se3
from taskcal.identification.calibration import Calibration
from taskcal.kinematics.inverse import find_posture, follow
from taskcal.planning.expected_error import Design
from taskcal.robot.error_model import ErrorModel
from taskcal.task.task import Task, reach_task

MAP_POINTS, PARAMETER_MAP_POINTS = 21, 15
"""Points along an edge of a map, odd so that one is in the middle; fewer where there is a map for each parameter, to keep a page
small. A convention."""

Maps = Sequence[Float[np.ndarray, "v u"]]
"""One for each slice."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Slice:
    """A plane through the middle of a workspace, in one of its orientations."""

    plane: str
    """``xy``, ``xz`` or ``yz`` of the workspace's own axes."""
    u: Float[np.ndarray, " u"]
    """Along the first axis, from the centre, metres."""
    v: Float[np.ndarray, " v"]
    """Along the second."""
    q: Float[np.ndarray, "v u joints"]
    """Radians."""
    reached: Bool[np.ndarray, "v u"]
    """Where the robot gets to."""

    def spread(self, values: Float[np.ndarray, " reached"]) -> Float[np.ndarray, "v u"]:
        """Values at the reached points as a map, NaN elsewhere."""
        out = np.full(self.reached.shape, np.nan)
        out[self.reached] = values
        return out


def slice_workspace(model: ErrorModel, task: Task, points: int = MAP_POINTS) -> tuple[Slice, ...]:
    """Three planes through the middle of a task's workspace.

    Raises:
        ReachError: the task has no workspace, or the robot does not reach its middle.
    """
    space = task.workspace
    if space is None:
        raise ReachError(
            f"task '{task.name}' is a list of poses, which has no slices; its poses themselves can be shown"
        )
    middle = space.middle()[0]
    start = find_posture(model, middle)
    axes = space.T_base_frame[:3, :3] @ space.turned
    out: list[Slice] = []
    for first, second in ((0, 1), (0, 2), (1, 2)):
        u = np.linspace(-0.5, 0.5, points) * space.size[first]
        v = np.linspace(-0.5, 0.5, points) * space.size[second]
        p = middle[:3, 3] + u[None, :, None] * axes[:, first] + v[:, None, None] * axes[:, second]
        inside = np.ones((points, points), dtype=bool)
        if space.shape == "cylinder":
            across = np.hypot(u[None], v[:, None]) if (first, second) == (0, 1) else np.abs(u)[None] + 0.0 * v[:, None]
            inside = across <= 0.5 * space.size[0] * (1 + 1e-9)
        found = follow(model, se3.pose(np.broadcast_to(middle[:3, :3], (points**2, 3, 3)), p.reshape(-1, 3)), start)
        out.append(
            Slice(
                plane="xyz"[first] + "xyz"[second],
                u=u,
                v=v,
                q=found.q.reshape(points, points, -1),
                reached=found.reached.reshape(points, points) & inside,
            )
        )
    return tuple(out)


def map_sensitivity(model: ErrorModel, at: Slice) -> Float[np.ndarray, "p v u"]:
    """Effect in space of every parameter's tolerance over a slice, metres; NaN where the robot does not get to."""
    S = model.jacobian(at.q[at.reached], angular=False)
    effect = np.linalg.norm(S, axis=1) * model.tolerances
    return np.stack([at.spread(effect[:, k]) for k in range(len(model))])


def map_tolerance(model: ErrorModel, at: Slice) -> Float[np.ndarray, "v u"]:
    """Expected error of the nominal robot in its own base, all tolerances together, metres."""
    S = model.jacobian(at.q[at.reached], angular=False) * model.tolerances
    return at.spread(np.sqrt((S**2).sum(axis=(1, 2))))


def map_expected(design: Design, at: Slice, kept: Int[np.ndarray, " k"] | None = None) -> Float[np.ndarray, "v u"]:
    """Expected error over a slice in the tracker frame, metres: with a kept set identified, or before (no set)."""
    return at.spread(design.expected_at(at.q[at.reached], kept))


def map_uncertainty(calibration: Calibration, at: Slice) -> Float[np.ndarray, "v u"]:
    """Standard deviation in space of the calibrated TCP over a slice, tracker frame, metres."""
    covariance = calibration.tool_covariance(at.q[at.reached])
    return at.spread(np.sqrt(np.trace(covariance[:, :3, :3], axis1=1, axis2=2)))


# Where in a task the errors are to be expected: over slices of a workspace, or pose by pose.


@dataclass(frozen=True, eq=False, kw_only=True)
class TaskMaps:
    """Maps over slices of a workspace, metres."""

    slices: tuple[Slice, ...]
    coarse: tuple[Slice, ...]
    """Of the single parameters."""
    effects: Mapping[str, Sequence[Float[np.ndarray, "coarse_v coarse_u"]]]
    """Effect of each parameter's tolerance."""
    tolerance: Maps
    """All tolerances together, in the robot's base."""
    before: Maps
    """Expected error with the frames alone found."""
    after: Maps
    """Expected error with parameters identified."""


@dataclass(frozen=True, eq=False, kw_only=True)
class TaskCurves:
    """The same pose by pose, for a list or a path, metres."""

    tolerance: Float[np.ndarray, " n"]
    before: Float[np.ndarray, " n"]
    after: Float[np.ndarray, " n"]


def map_task(
    model: ErrorModel, task: Task, made: Design, kept: Iterable[str] | None = None, seed: int = 0
) -> TaskMaps | TaskCurves:
    """Errors over slices of a task's workspace; pose by pose for a list or a path.

    Args:
        model: the model.
        task: the task.
        made: design of the measured poses.
        kept: the parameters that are identified; all by default.
        seed: of the spread over the task.
    """
    columns = model.indices(model.names if kept is None else kept)
    if task.workspace is None:
        reached = reach_task(model, task, seed=seed)
        effect = model.jacobian(reached.q, angular=False) * model.tolerances
        return TaskCurves(
            tolerance=np.sqrt((effect**2).sum(axis=(1, 2))),
            before=made.expected_at(reached.q),
            after=made.expected_at(reached.q, columns),
        )
    slices = slice_workspace(model, task, MAP_POINTS)
    coarse = slice_workspace(model, task, PARAMETER_MAP_POINTS)
    each = [map_sensitivity(model, at) for at in coarse]
    return TaskMaps(
        slices=slices,
        coarse=coarse,
        effects={p.name: tuple(maps[k] for maps in each) for k, p in enumerate(model.parameters)},
        tolerance=tuple(map_tolerance(model, at) for at in slices),
        before=tuple(map_expected(made, at) for at in slices),
        after=tuple(map_expected(made, at, columns) for at in slices),
    )


# How well a calibrated TCP is known over a task.


@dataclass(frozen=True, eq=False, kw_only=True)
class TaskUncertainty:
    """Uncertainty of the TCP over a task, before and after, metres."""

    task: str
    unreachable: float
    """Share of the task's poses that the robot does not reach."""
    before: float
    """Standard deviation in space by the tolerances alone, rms over the task."""
    after: float
    """Of the calibrated tool."""
    target: float
    """Of the first measured target."""
    deviations: Mapping[str, Float[np.ndarray, "n 3"]]
    """Standard deviations pose by pose in the axes of the robot's base."""
    slices: tuple[Slice, ...]
    """Of the workspace; none for a list of poses or a path."""
    maps: Mapping[str, Maps]
    """Standard deviations in space over the slices."""


def uncertainty_over(calibration: Calibration, task: Task, seed: int = 0) -> TaskUncertainty:
    """Uncertainty of the tool over a task: by the tolerances alone, and calibrated.

    Args:
        calibration: the calibration.
        task: what the robot has to do.
        seed: of the spread over its workspace.

    Raises:
        ReachError: the robot does not reach the task.
    """
    model = calibration.model
    poses = reach_task(model, task, seed=seed, known=calibration.q)
    effect = model.jacobian(poses.q, angular=False) * model.tolerances
    turn = calibration.T_tracker_base[:3, :3]

    def target(q: np.ndarray) -> np.ndarray:
        return calibration.predict_covariance(q)[:, 0, :3, :3]

    def per_axis(covariance: np.ndarray) -> np.ndarray:
        in_base = turn.T @ covariance[:, :3, :3] @ turn
        return np.sqrt(np.maximum(np.diagonal(in_base, axis1=1, axis2=2), 0.0))

    def in_space(deviation: np.ndarray) -> float:
        return float(np.sqrt(np.sum(poses.weights[:, None] * deviation**2)))

    before = np.sqrt((effect**2).sum(axis=2))
    after, point = per_axis(calibration.tool_covariance(poses.q)), per_axis(target(poses.q))
    slices = () if task.workspace is None else slice_workspace(model, task)
    return TaskUncertainty(
        task=task.name,
        unreachable=float(poses.unreachable.mean()),
        before=in_space(before),
        after=in_space(after),
        target=in_space(point),
        deviations={
            "tool, by the tolerances": before,
            "tool, calibrated": after,
            f"target {calibration.targets[0]}": point,
        },
        slices=slices,
        maps={
            "target": tuple(at.spread(np.sqrt(np.trace(target(at.q[at.reached]), axis1=1, axis2=2))) for at in slices),
            "tool": tuple(map_uncertainty(calibration, at) for at in slices),
            "by the tolerances": tuple(map_tolerance(model, at) for at in slices),
        },
    )


# What a task's accuracy leaves to the identified geometry, beside the model error of each single pose.


def allow_geometry(accuracy: float | None, model_error: float) -> float | None:
    """The largest error of the geometry with which a single pose still meets the accuracy.

    The model error is taken for white: at a pose of the task it is as large as at a measured one, and independent of what
    identification leaves, so that both add in squares.

    Args:
        accuracy: rms in space at a single pose, metres; None where none is stated.
        model_error: standard deviation per axis, metres.

    Returns:
        rms in space, metres; zero if the model error alone takes the whole accuracy; None where none is stated.
    """
    return None if accuracy is None else math.sqrt(max(accuracy**2 - 3.0 * model_error**2, 0.0))
