"""Poses of a plan moved a little, each to the best of some variations."""

import numpy as np
from jaxtyping import Bool, Float

from taskcal.adaptation.candidates import check, enlarge
from taskcal.adaptation.experiment import Experiment
from taskcal.kinematics.clearance import place_links
from taskcal.kinematics.inverse import closes
from taskcal.measurement.station import Station
from taskcal.robot.error_model import ErrorModel
from taskcal.task.task import Task

VARIATIONS = 24
"""Tried of each pose in a round."""


def refine(
    model: ErrorModel,
    experiment: Experiment,
    task: Task,
    station: Station | None,
    q: Float[np.ndarray, "count joints"],
    visible: Bool[np.ndarray, "count targets"],
    *,
    scale: float,
    seed: int,
) -> tuple[Float[np.ndarray, "count joints"], Bool[np.ndarray, "count targets"]]:
    """Move each pose in turn to the best of some variations, if that lowers the expected error.

    Args:
        model: the model.
        experiment: of the plan.
        task: whose enlarged workspace the poses stay in.
        station: of the plan.
        q: the poses, radians.
        visible: which reflectors are seen at each.
        scale: standard deviation of the variations, radians or metres.
        seed: of the variations.
    """
    rng = np.random.default_rng(seed)
    q, visible = q.copy(), visible.copy()
    moved = (q[:, None] + scale * rng.normal(size=(len(q), VARIATIONS, q.shape[1]))).reshape(-1, q.shape[1])
    ok = model.robot.inside_limits(moved) & closes(model, moved)
    room = enlarge(task, model).workspace
    assert room is not None
    ok[ok] = room.contains(model.poses(moved[ok]))
    sees = np.zeros((len(moved), visible.shape[1]), dtype=bool)
    able, seen = check(model, moved[ok], place_links(model, moved[ok]), station)
    ok[np.flatnonzero(ok)] = able
    sees[ok] = seen[able]
    rows = np.zeros((len(moved), experiment.rows(q[:1], visible[:1]).shape[1], experiment.basis.shape[1]))
    rows[ok] = experiment.rows(moved[ok], sees[ok])
    own = experiment.rows(q, visible)
    M = experiment.prior + np.einsum("nbi,nbj->ij", own, own)
    for k in range(len(q)):
        near = k * VARIATIONS + np.flatnonzero(ok[k * VARIATIONS : (k + 1) * VARIATIONS])
        without = np.linalg.inv(M - own[k].T @ own[k])
        trials = np.concatenate([own[k][None], rows[near]])
        U = trials @ without
        S = np.eye(trials.shape[1]) + U @ np.swapaxes(trials, 1, 2)
        gain = np.trace(np.linalg.solve(S, U @ experiment.task @ np.swapaxes(U, 1, 2)), axis1=1, axis2=2)
        best = int(np.argmax(gain))
        if best:
            M = M - own[k].T @ own[k] + trials[best].T @ trials[best]
            own[k], q[k], visible[k] = trials[best], moved[near[best - 1]], sees[near[best - 1]]
    return q, visible
