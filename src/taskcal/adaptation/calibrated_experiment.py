"""What measuring more poses would add to a calibration by the one model.

In z − ẑ = L·u, with L·Lᵀ the calibration's covariance, every direction of u has unit variance, and what candidates and task see
of hundreds of them is spanned by few. Plans are chosen and judged in those; of the others, what a measurement sees counts as
noise, and what the task sees as an error that stays. What no pose has in common with others is the calibration's own: a white
error of the target, and one of every joint.
"""

from dataclasses import replace

import numpy as np
from jaxtyping import Float

from taskcal.adaptation.candidates import Measurable
from taskcal.adaptation.experiment import Experiment, Linearisation
from taskcal.identification.calibration import Calibration
from taskcal.measurement.tracker import TrackerNoise
from taskcal.task.task import TaskPoses

JUDGED_BY, CHOSEN_BY = 300, 150
"""Directions in which plans are judged, and in which their poses are chosen."""

SAMPLE = 1000
"""Candidates, evenly among all, that the directions are found from."""


def calibrated_experiments(
    calibration: Calibration, goal: TaskPoses, measurable: Measurable, noise: TrackerNoise | None
) -> tuple[Experiment, Experiment]:
    """Experiments to judge plans by, and to choose their poses by.

    Args:
        calibration: of geometry and all effects at once.
        goal: poses of the task.
        measurable: poses that can be measured.
        noise: the tracker's.
    """
    S = calibration.z_covariance
    deviations = np.sqrt(np.maximum(np.diag(S), 0.0))
    scale = np.where(deviations > 0.0, deviations, 1.0)
    values, vectors = np.linalg.eigh(S / scale / scale[:, None])
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    linear = Linearisation(
        layout=calibration.layout,
        about=calibration.z,
        deviations=scale,
        noise=noise or TrackerNoise(),
        white=calibration.model_error[0],
        field=None,
        joints=np.square(calibration.joint_error),
    )
    sample = np.unique(np.linspace(0, len(measurable.q) - 1, min(SAMPLE, len(measurable.q))).astype(int))
    J_measured, J_task = (linear.sensitivities(q)[0] @ root for q in (measurable.q[sample], goal.q))
    J_task = J_task * np.sqrt(goal.weights / J_task.shape[1])[:, None, None, None]
    measured, task = (J.reshape(-1, J.shape[3]) for J in (J_measured, J_task))
    G = measured.T @ measured / max(np.sum(measured**2), 1e-300) + task.T @ task / max(np.sum(task**2), 1e-300)
    directions = np.linalg.eigh(G)[1][:, ::-1]
    judged, chosen = (
        _in_directions(linear, root, directions[:, :count], measured, task) for count in (JUDGED_BY, CHOSEN_BY)
    )
    return judged, chosen


def _in_directions(
    linear: Linearisation,
    root: Float[np.ndarray, "z z"],
    directions: Float[np.ndarray, "z d"],
    measured: Float[np.ndarray, "rows z"],
    task: Float[np.ndarray, "points z"],
) -> Experiment:
    """The experiment in some directions of the unit variances."""
    in_task = task @ directions
    unseen = (np.sum(measured**2) - np.sum((measured @ directions) ** 2)) / len(measured)
    left = np.sum(task**2) - np.sum(in_task**2)
    d = directions.shape[1]
    return Experiment(
        linear=replace(linear, white=float(np.sqrt(linear.white**2 + max(unseen, 0.0)))),
        basis=root @ directions,
        prior=np.eye(d),
        signal=np.zeros((d, d)),
        task=in_task.T @ in_task,
        left=float(max(left, 0.0)),
    )
