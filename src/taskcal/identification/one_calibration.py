"""The calibration that the one model gives: estimate, covariance with the sizes' own uncertainty, residuals."""

from dataclasses import replace

import numpy as np
from jaxtyping import Float

from taskcal.estimation.group_variances import log_integrated
from taskcal.identification.calibration import Calibration
from taskcal.identification.fit_options import FitOptions
from taskcal.identification.linearisation import linearise_rows
from taskcal.identification.one_model import GEOMETRY, MOST_ROUNDS, OneFit
from taskcal.identification.outlier import studentise
from taskcal.identification.packed_covariance import spread_of
from taskcal.identification.provenance import Provenance
from taskcal.identification.row_errors import log_weights, of_targets
from taskcal.measurement.campaign import Campaign

DRAWS = 12
"""Of the sizes of the groups, over which the covariance is averaged."""


def calibrate(
    fitted: OneFit, campaign: Campaign, options: FitOptions, stretch: float, rng: np.random.Generator
) -> Calibration:
    """The calibration of a fit.

    Args:
        fitted: the fit.
        campaign: what was fitted.
        options: how.
        stretch: factor of all covariances but the instrument's.
        rng: for the draws of the sizes.
    """
    one, errors = fitted.one, fitted.errors
    layout, model = one.problem.frames, one.problem.frames.model
    x, S = fitted.found.averaged(DRAWS, rng)
    S = _considered(fitted, S) * np.outer(one.scale, one.scale)
    z = layout.start() + one.scale * x
    at = linearise_rows(one.problem, z)
    n, targets = one.problem.seen.valid.shape
    residual = at.residual.reshape(n, targets, -1).copy()
    residual[~one.problem.seen.valid] = np.nan
    R = errors.covariance(at, one.problem.noise)
    followed = at.by_entry @ S @ np.swapaxes(at.by_entry, 1, 2)
    single, tracker = of_targets(R, targets), one.problem.noise
    # stretched beside the tracker's noise; where there is more than was predicted, all of it, so that none is negative
    known = max(1.0 - stretch, 0.0) * tracker
    noise, own = known + stretch * single, known + stretch * (single - of_targets(followed, targets))
    studentised, outliers = studentise(residual, own, noise, campaign, options.outlier_level)
    T_tracker_base, T_tool_target = layout.frames(z)
    white = [errors.position] if errors.rotation is None else [errors.position, errors.rotation]
    estimated = np.flatnonzero(one.kept[: len(model)])
    scales = [
        v for label, v in zip(one.labels, fitted.found.evidence.log_variances, strict=True) if label.effect == GEOMETRY
    ]
    return Calibration(
        model=model,
        layout=replace(layout, kept=np.arange(len(model))),
        estimated=estimated,
        z=z,
        z_spread=spread_of(0.5 * stretch * (S + S.T)),
        T_tracker_base=T_tracker_base,
        T_tool_target=T_tool_target,
        residuals=residual,
        studentised=studentised,
        outliers=outliers,
        left_out=(),
        ids=campaign.ids,
        q=campaign.q,
        model_error=tuple(float(d) for d in np.sqrt(stretch * np.array(white))),
        joint_error=tuple(float(d) for d in np.sqrt(stretch * errors.joints)),
        prior_scale=float(np.exp(0.5 * np.mean(scales))) if scales else 1.0,
        group_deviations=_group_deviations(fitted),
        log_evidence=log_evidence(fitted),
        field=None,
        iterations=fitted.rounds,
        rounds=fitted.rounds,
        reason="geometry, effects and their sizes stand still"
        if fitted.rounds < MOST_ROUNDS
        else "geometry, effects and their sizes hardly move",
        remarks=_remarks(fitted, z, S),
        provenance=Provenance.of(model, campaign, options.described(model, campaign)),
    )


def log_evidence(fitted: OneFit) -> float:
    """Log marginal likelihood of the fit, but for a constant of the campaign, as of an `identify`; sizes integrated out."""
    reduced = fitted.found.reduced
    whitened = np.log(np.abs(np.diagonal(fitted.whitener, axis1=1, axis2=2))).sum()
    weighed = log_weights(fitted.weights[fitted.at.seen.any(axis=1)])
    return float(whitened + weighed + reduced.log_alone + log_integrated(fitted.found))


def _group_deviations(fitted: OneFit) -> Float[np.ndarray, " p"]:
    """Prior standard deviation of every parameter at the likeliest sizes."""
    p = len(fitted.one.problem.frames.model)
    sizes = np.exp(0.5 * fitted.found.evidence.log_variances)
    return fitted.one.scale[:p] * sizes[fitted.one.group[:p]]


def _considered(fitted: OneFit, S: Float[np.ndarray, "z z"]) -> Float[np.ndarray, "z z"]:
    """Covariance with what is not estimated, but varies all the same: C + G·Σ·Gᵀ, G what it does to the estimate."""
    left = np.flatnonzero(~fitted.one.kept)
    if not len(left):
        return S
    scale = fitted.one.scale[left]
    columns = np.einsum("nij,njk->nik", fitted.whitener, fitted.at.by_entry[:, :, left]) * scale
    pull = np.einsum("nip,nik->pk", fitted.A, columns)
    G = -S @ pull
    C = S.copy()
    variance = np.diag(S)[left]
    C[:, left] += G * variance
    C[left] += (G * variance).T
    return C + (G * variance) @ G.T


def _remarks(fitted: OneFit, z: Float[np.ndarray, " z"], S: Float[np.ndarray, "z z"]) -> tuple[str, ...]:
    """What is unusual about the effects' estimates."""
    model = fitted.one.problem.frames.model
    deviation = np.sqrt(np.maximum(np.diag(S), 0.0))
    estimates = {name: (float(z[i]), float(deviation[i])) for i, name in enumerate(model.names) if fitted.one.kept[i]}
    return tuple(remark for effect in model.effects for remark in effect.remarks(model.robot, estimates))
