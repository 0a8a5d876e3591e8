"""Poses that could be measured: reachable, clear, seen by the tracker."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int

from taskcal.errors import ReachError
from taskcal.kinematics.clearance import Links, clear_of_boxes, clear_of_itself, place_links
from taskcal.robot.error_model import ErrorModel
from taskcal.task.task import Task, TaskPoses, reach_task
from taskcal.task.workspace import Orientation, Workspace
from taskcal.virtual.station import Station

ROOM, TURN = 1.5, np.radians(45.0)
"""Measured poses may lie in a box 1.5 times the task's, with the tool up to 45° from the task's orientations."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Measurable:
    """Poses that can be measured."""

    q: Float[np.ndarray, "n joints"]
    """Radians."""
    rows: Int[np.ndarray, " n"]
    """Which of the reached poses they are."""
    visible: Bool[np.ndarray, "n targets"]
    """Which reflectors the tracker sees."""
    lost: Mapping[str, int]
    """How many of the poses tried fell away, by reason."""


def enlarge(task: Task, model: ErrorModel) -> Task:
    """A task's workspace with the room that measuring poses may take; around the poses of a list or a path."""
    if task.workspace is not None:
        space = task.workspace
        turned = tuple(
            Orientation(rotation=o.rotation, cone=max(o.cone, TURN), spin=max(o.spin, TURN)) for o in space.orientations
        )
        return replace(task, workspace=replace(space, size=ROOM * space.size, orientations=turned))
    assert task.poses is not None
    low, high = task.poses[:, :3, 3].min(axis=0), task.poses[:, :3, 3].max(axis=0)
    # a flat or narrow path still needs room in every direction
    size = np.maximum(ROOM * (high - low), 0.1 * model.robot.reach)
    middle = task.poses[len(task.poses) // 2, :3, :3]
    space = Workspace(
        T_base_frame=np.eye(4),
        shape="box",
        center=0.5 * (low + high),
        size=size,
        turned=np.eye(3),
        orientations=(Orientation(rotation=middle, cone=TURN, spin=TURN),),
    )
    return Task(name=task.name, workspace=space, accuracy=task.accuracy)


def measuring_task(model: ErrorModel, task: Task) -> Task:
    """Where to measure without a plan: the task's own workspace; for poses or a path, which may lie on one line, around it."""
    return task if task.workspace is not None else enlarge(task, model)


def find_measurable(model: ErrorModel, task: Task, station: Station | None, count: int, seed: int) -> Measurable:
    """Poses spread over the enlarged task that the robot reaches clear of itself and of boxes, and the tracker sees.

    Raises:
        ReachError: none is left; the message counts why.
    """
    reached = reach_task(model, enlarge(task, model), count, seed)
    return keep_measurable(model, reached, station)


def keep_measurable(model: ErrorModel, reached: TaskPoses, station: Station | None) -> Measurable:
    """Those of some poses that can be measured.

    Raises:
        ReachError: none can; the message counts why.
    """
    links = place_links(model, reached.q)
    ok, seen = check(model, reached.q, links, station)
    clear = clear_of_itself(links)
    boxes = clear_of_boxes(links, station.keep_out) if station else np.ones(len(reached), dtype=bool)
    lost = {
        "not reached": int(reached.unreachable.sum()),
        "links too near each other": int((~clear).sum()),
        "in a keep-out box": int((clear & ~boxes).sum()),
        "no reflector visible": int((clear & boxes & ~seen.any(axis=1)).sum()),
    }
    if not ok.any():
        reasons = ", ".join(f"{number} {reason}" for reason, number in lost.items() if number)
        raise ReachError(
            f"none of {len(reached.unreachable)} candidate poses can be measured: {reasons}; move the tracker, turn the "
            "reflectors or widen their acceptance, or move the keep-out boxes"
        )
    return Measurable(q=reached.q[ok], rows=np.flatnonzero(ok), visible=seen[ok], lost=lost)


def check(
    model: ErrorModel, q: Float[np.ndarray, "n joints"], links: Links, station: Station | None
) -> tuple[Bool[np.ndarray, " n"], Bool[np.ndarray, "n targets"]]:
    """Whether each pose can be measured, and which reflectors are seen there."""
    ok = clear_of_itself(links)
    if station is None:
        return ok, np.ones((len(q), 1), dtype=bool)
    ok &= clear_of_boxes(links, station.keep_out)
    seen = station.visible(model.poses(q), links)
    return ok & seen.any(axis=1), seen
