"""Where in a task the errors are, for the pages of several commands."""

from typing import TYPE_CHECKING

import numpy as np

from taskcal.adaptation.expected_error import Design
from taskcal.adaptation.task_map import map_expected, map_sensitivity, map_tolerance, slice_workspace
from taskcal.presentation.task_section import TaskCurves, TaskMaps
from taskcal.robot.error_model import ErrorModel
from taskcal.task.task import Task, reach_task

if TYPE_CHECKING:
    from collections.abc import Iterable

MAPPED, WITH_PARAMETERS = 21, 15
"""Points along an edge of a map; fewer where there is one for each parameter."""


def map_task(
    model: ErrorModel, task: Task, made: Design, kept: "Iterable[str] | None" = None, seed: int = 0
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
