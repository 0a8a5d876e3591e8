"""What measuring without a tracker would say of a task, as an experiment that plans are chosen and judged by."""

from dataclasses import replace

import numpy as np
from jaxtyping import Bool, Float

from taskcal.adaptation.candidates import Measurable
from taskcal.adaptation.experiment import Experiment, span
from taskcal.adaptation.measuring_way import MeasuringWay
from taskcal.adaptation.observed_linearisation import ObservedLinearisation, layout_of_way, task_rows
from taskcal.adaptation.smooth_field import SmoothField
from taskcal.estimation.scaled import pseudo_invert_scaled
from taskcal.identification.hyperparameters import Hyperparameters
from taskcal.robot.error_model import ErrorModel
from taskcal.task.task import TaskPoses

SMOOTH_SHARE = 0.5
"""Of the model error's variance. With all of it smooth, plans of 60 postures are up to 30 % worse where the error is white, and
with none of it up to 15 % worse where it is smooth (two robots; sockets, wire, camera); with half of it 10 % and 2 %."""

AT_ONCE = 500
"""Postures whose sensitivities to everything are held in memory at a time."""


def make_observed_experiment(
    model: ErrorModel,
    goal: TaskPoses,
    measurable: Measurable,
    way: MeasuringWay,
    hyper: Hyperparameters,
    *,
    smooth: bool = False,
) -> Experiment:
    """Prior, task and basis for choosing postures, the kind's own unknowns and the target's place among what is unknown.

    The error is that of the target's predicted position, its mean over the task, wherever the robot's base may stand.

    Args:
        model: the model to be identified.
        goal: poses of the task.
        measurable: postures that can be measured, and of which thing.
        way: of measuring.
        hyper: model error and prior scale.
        smooth: take half of the model error for a smooth field over the joints instead of white noise.
    """
    layout, error = layout_of_way(model, way), hyper.model_error[0]
    own = [kind.deviations for kind in layout.kinds]
    frames = np.ones(len(layout.names) - len(layout.kept) - sum(map(len, own)))
    share = SMOOTH_SHARE if smooth and error > 0.0 else 0.0
    field = SmoothField.over(error * np.sqrt(share), goal.q, measurable.q.std(axis=0)) if share else None
    linear = ObservedLinearisation(
        way=way,
        layout=layout,
        deviations=np.concatenate([hyper.deviations(model)[layout.kept], frames, *own]),
        white=error * np.sqrt(1.0 - share),
        field=field,
    )
    J_task = task_rows(linear, goal)
    parts = [slice(first, first + AT_ONCE) for first in range(0, len(measurable.q), AT_ONCE)]
    rows = np.concatenate([linear.rows(measurable.q[part], measurable.visible[part]) for part in parts])
    basis = span(rows.reshape(-1, rows.shape[2]), J_task)
    known = np.zeros((len(basis), len(basis)))
    z = len(layout.names)
    known[:z, :z] = linear.stated
    signal = basis.T @ known @ basis
    in_task = J_task @ basis
    return Experiment(
        linear=linear,
        basis=basis,
        prior=np.eye(basis.shape[1]) + signal,
        signal=signal,
        task=in_task.T @ in_task,
    )


def nominal_error(
    experiment: Experiment,
    goal: TaskPoses,
    q: Float[np.ndarray, "n joints"],
    visible: Bool[np.ndarray, "n things"],
) -> float:
    """Expected error when the measurements only serve to find what stands and what the tool carries, metres."""
    linear = experiment.linear
    assert isinstance(linear, ObservedLinearisation)
    white = replace(linear, field=None, white=linear.white)
    rows, J_task = white.rows(q, visible), task_rows(white, goal)
    flat = rows.reshape(-1, rows.shape[2])
    A, W = flat.T @ flat + white.stated, J_task.T @ J_task
    m, f = np.split(np.arange(len(A)), [len(linear.layout.kept)])
    # directions that these postures do not see stay where they are stated
    inverse = pseudo_invert_scaled(A[np.ix_(f, f)], rcond=1e-10)
    follow = inverse @ A[np.ix_(f, m)]
    moved = W[np.ix_(m, f)] @ follow
    left = np.trace(W[np.ix_(m, m)] - moved - moved.T + follow.T @ W[np.ix_(f, f)] @ follow)
    return float(np.sqrt(left + np.sum(W[np.ix_(f, f)] * inverse)))
