"""Where in a task the errors are to be expected: over slices of a workspace, or pose by pose."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from taskcal.adaptation.expected_error import Design
from taskcal.adaptation.task_map import Maps, Slice, map_expected, map_sensitivity, map_tolerance, slice_workspace
from taskcal.robot.error_model import ErrorModel
from taskcal.task.task import Task, reach_task

MAPPED, WITH_PARAMETERS = 21, 15
"""Points along an edge of a map; fewer where there is one for each parameter."""


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
    slices = slice_workspace(model, task, MAPPED)
    coarse = slice_workspace(model, task, WITH_PARAMETERS)
    each = [map_sensitivity(model, at) for at in coarse]
    return TaskMaps(
        slices=slices,
        coarse=coarse,
        effects={p.name: tuple(maps[k] for maps in each) for k, p in enumerate(model.parameters)},
        tolerance=tuple(map_tolerance(model, at) for at in slices),
        before=tuple(map_expected(made, at) for at in slices),
        after=tuple(map_expected(made, at, columns) for at in slices),
    )
