"""Errors of nested models on rows that they were not fitted to.

The rows are linearised once, about a fit of the whole model; the rows of a fold are taken out of the normal equations, and each
nested model is a solve of its own. A parameter that is dropped is held at zero.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float, Int

from taskcal.identification.belief import frame_precision
from taskcal.identification.calibration import Calibration
from taskcal.identification.linearisation import linearise_rows
from taskcal.identification.observation_layout import problem_of
from taskcal.identification.row_errors import RowErrors, whiteners
from taskcal.measurement.campaign import Campaign
from taskcal.measurement.tracker import TrackerNoise


def left_out_errors(
    whole: Calibration,
    campaign: Campaign,
    nested: Sequence[Int[np.ndarray, " _"]],
    prior: Float[np.ndarray, " p"],
    parts: Sequence[Int[np.ndarray, " _"]],
    noise: TrackerNoise | None,
) -> list[Float[np.ndarray, "n targets"]]:
    """Errors of position where a row was not fitted, metres, for each nested model; NaN where a beam was lost.

    Args:
        whole: a fit of the whole model to the campaign; rows that it left out are predicted, and not fitted.
        campaign: the measurements.
        nested: parameters that each model keeps.
        prior: standard deviation of every parameter.
        parts: rows of each fold.
        noise: the tracker's.
    """
    problem = problem_of(whole.layout, campaign, noise)
    at = linearise_rows(problem, whole.z)
    W = whiteners(_row_errors(whole).covariance(at, problem.noise))
    p = len(whole.model)
    scale = np.concatenate([prior, np.full(len(whole.z) - p, 1e-3)])
    J = at.by_entry * scale
    y = at.residual + np.einsum("nij,j->ni", J, (whole.z - problem.frames.start()) / scale)
    A, b = W @ J, np.einsum("nij,nj->ni", W, y)
    wrong = np.isin(campaign.ids, [row.id for row in whole.left_out])
    from scipy.linalg import cho_factor, cho_solve

    A[wrong], b[wrong] = 0.0, 0.0
    precision = np.eye(len(scale))
    if len(scale) > p:
        precision[p:, p:] = frame_precision(problem.frames) * 1e-6
    H, h = np.tensordot(A, A, ((0, 1), (0, 1))) + precision, np.tensordot(A, b, ((0, 1), (0, 1)))
    out = [np.full(problem.seen.valid.shape, np.nan) for _ in nested]
    frames, targets = np.arange(p, len(scale)), len(whole.targets)
    for part in parts:
        rest_H = H - np.tensordot(A[part], A[part], ((0, 1), (0, 1)))
        rest_h = h - np.tensordot(A[part], b[part], ((0, 1), (0, 1)))
        for errors, kept in zip(out, nested, strict=True):
            own = np.concatenate([kept, frames]).astype(np.int64)
            x = cho_solve(cho_factor(rest_H[np.ix_(own, own)]), rest_h[own])
            left = y[part] - J[part][:, :, own] @ x
            errors[part] = np.linalg.norm(left.reshape(len(part), targets, -1)[:, :, :3], axis=2)
    for errors in out:
        errors[~problem.seen.valid] = np.nan
    return out


def _row_errors(whole: Calibration) -> RowErrors:
    """What single poses add, as the calibration found it."""
    joints = len(whole.model.robot.joints)
    return RowErrors(
        position=whole.model_error[0] ** 2,
        rotation=whole.model_error[1] ** 2 if whole.layout.pose else None,
        joints=np.square(whole.joint_error) if whole.joint_error else np.zeros(joints),
    )
