"""What poses that nobody chose would give: random ones, and ones spread evenly over the task's own workspace."""

import numpy as np
from jaxtyping import Float

from taskcal.adaptation.candidates import Measurable, keep_measurable
from taskcal.adaptation.experiment import Experiment
from taskcal.errors import ReachError
from taskcal.measurement.station import Station
from taskcal.robot.error_model import ErrorModel
from taskcal.task.task import Task, reach_task

RANDOM_PLANS = 20


def random_plan_errors(
    model: ErrorModel,
    experiment: Experiment,
    task: Task,
    station: Station | None,
    measurable: Measurable,
    count: int,
    seed: int,
) -> Float[np.ndarray, " plans"]:
    """Expected error of random poses from the task's own workspace."""
    pool = _own_poses(model, task, station, measurable, max(10 * count, 600), seed + 77, count)
    rng = np.random.default_rng(seed)
    picks = [rng.permutation(len(pool.q))[:count] for _ in range(RANDOM_PLANS)]
    return np.array([experiment.error(pool.q[pick], pool.visible[pick]) for pick in picks])


def even_plan_error(
    model: ErrorModel, experiment: Experiment, task: Task, station: Station | None, measurable: Measurable, count: int
) -> float:
    """Expected error of as many poses spread evenly over the task's own workspace."""
    pool = _own_poses(model, task, station, measurable, 3 * count, 0, count)
    pick = np.linspace(0, len(pool.q) - 1, min(count, len(pool.q))).astype(int)
    return experiment.error(pool.q[pick], pool.visible[pick])


def _own_poses(
    model: ErrorModel, task: Task, station: Station | None, measurable: Measurable, tried: int, seed: int, needed: int
) -> Measurable:
    """Measurable poses of the task itself; of the candidates, where the tracker does not see enough of the task."""
    try:
        own = keep_measurable(model, reach_task(model, task, tried, seed), station)
    except ReachError:
        return measurable
    return own if len(own.q) >= needed else measurable
