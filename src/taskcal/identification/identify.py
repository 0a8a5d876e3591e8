"""The fit: a campaign and a model in, a Calibration out."""

import json
from collections.abc import Iterable, Mapping
from dataclasses import asdict
from typing import Any, Literal

import numpy as np

from taskcal.estimation.blas import single_threaded
from taskcal.estimation.loss import Loss, Squared
from taskcal.estimation.prior import GaussianPrior
from taskcal.identification.belief import Belief, belief_of
from taskcal.identification.calibration import Calibration, Provenance
from taskcal.identification.hyperparameters import MAX_ROUNDS, Fitted, fit_with_hyperparameters
from taskcal.identification.outlier import studentise
from taskcal.identification.problem import FrameLayout, Problem, observe
from taskcal.measurement.campaign import Campaign
from taskcal.measurement.registration import Registration, check_plausible, check_rows, nominal_poses, register
from taskcal.measurement.tracker import TrackerNoise
from taskcal.robot.error_model import ErrorModel

Estimate = Literal["estimate"]

WIDE = 5.0
"""A prior scale above this calls for a look at the robot file."""


@single_threaded
def identify(
    model: ErrorModel,
    campaign: Campaign,
    *,
    keep: Iterable[str] | None = None,
    prior: GaussianPrior | Literal["tolerances"] | None = "tolerances",
    loss: Loss | None = None,
    noise: TrackerNoise | None = None,
    registration: Registration | None = None,
    frames: Literal["fit", "fixed"] = "fit",
    model_error: float | tuple[float, float] | Estimate = "estimate",
    prior_scale: float | Estimate = "estimate",
    outlier_level: float = 0.01,
) -> Calibration:
    """Identify the model's parameters from a campaign, the tracker frame and the targets with them.

    The estimate minimises the whitened residuals with a Gaussian prior on every parameter, so that parameters that
    repeat each other share what is found instead of running away. Real robots deviate from any geometry by far more than
    the tracker's noise, and by their own amounts: a model error beside the noise, and one common scale of the prior, are
    those of the largest marginal likelihood.

    Args:
        model: the model.
        campaign: the measurements.
        keep: names of the parameters to estimate, the others staying nil; all by default.
        prior: ``tolerances`` for the robot's own; a prior over the kept parameters; or None, when only Levenberg's
            damping holds undetermined directions, and the fit ends as soon as the objective falls by less than 10⁻⁶ of
            itself or the Newton decrement is below 10⁻².
        loss: `Squared` (default), `Huber` or `Cauchy`.
        noise: the tracker's, where the campaign does not state uncertainties.
        registration: tracker frame and targets to start from, or to hold; found from the data by default.
        frames: ``fit`` refines tracker frame and targets with the parameters, ``fixed`` holds them as registered.
        model_error: standard deviation of what the model cannot explain, metres (and radians, for poses); or estimated.
        prior_scale: common factor of the prior's standard deviations; or estimated.
        outlier_level: chance of naming any outlier where there is none.

    Returns:
        the calibration: estimate, covariance, residuals, and predictions with their uncertainty.

    Raises:
        CampaignError: too few rows, a row at which the nominal robot's closed loop does not close, joints and points that do
            not belong together, or a model that depends on temperature or time and a row without.
        UnknownName: a name in `keep` that the model does not have.
        FitError: the fit did not converge.
    """
    loss = loss or Squared()
    check_options(prior, frames, model_error, prior_scale)
    kept = np.arange(len(model)) if keep is None else model.indices(keep)
    check_rows(campaign)
    for effect in model.effects:
        campaign.check_told(effect.needs, effect.key)
    poses = nominal_poses(model, campaign)
    if registration is None:
        registration = register(model, campaign, poses)
        check_plausible(registration, model, campaign)
    layout = FrameLayout(
        model=model,
        kept=kept,
        registration=registration,
        targets=campaign.targets,
        pose=campaign.rotations is not None,
        fixed_frames=frames == "fixed",
    )
    problem = Problem(
        frames=layout,
        q=np.ascontiguousarray(campaign.q),
        seen=observe(campaign),
        noise=campaign.covariances(noise),
        conditions=campaign.conditions,
    )
    belief = belief_of(layout, prior)
    found = fit_with_hyperparameters(problem, belief, loss, model_error, 1.0 if prior is None else prior_scale)
    options = {
        "keep": "all" if len(kept) == len(model) else [model.names[i] for i in kept],
        "prior": "given" if isinstance(prior, GaussianPrior) else prior,
        "loss": {"kind": "squared"}
        if isinstance(loss, Squared)
        else {"kind": type(loss).__name__.lower(), **asdict(loss)},
        "noise": "stated" if campaign.uncertainty is not None else asdict(noise or TrackerNoise()),
        "frames": frames,
        "model_error": model_error,
        "prior_scale": prior_scale,
        "outlier_level": outlier_level,
    }
    # as the file will hold them: lists for tuples
    return _conclude(found, problem, belief, campaign, json.loads(json.dumps(options)))


def check_options(prior: object, frames: object, model_error: object, prior_scale: object) -> None:
    """Refuse what would otherwise silently mean something else."""
    if not (prior is None or prior == "tolerances" or isinstance(prior, GaussianPrior)):
        raise ValueError(f"prior is {prior!r}; give 'tolerances', None, or a GaussianPrior")
    if frames not in ("fit", "fixed"):
        raise ValueError(f"frames is {frames!r}; give 'fit' or 'fixed'")
    errors = model_error if isinstance(model_error, tuple) else (model_error,)
    if model_error != "estimate" and not all(isinstance(e, int | float) and e >= 0.0 for e in errors):
        raise ValueError(f"model_error is {model_error!r}; give 'estimate', or metres, zero or more")
    if prior_scale != "estimate" and not (isinstance(prior_scale, int | float) and prior_scale > 0.0):
        raise ValueError(f"prior_scale is {prior_scale!r}; give 'estimate', or a factor above zero")


def _conclude(
    found: Fitted,
    problem: Problem,
    belief: Belief,
    campaign: Campaign,
    options: Mapping[str, Any],
) -> Calibration:
    """Everything that is reported, from the converged fit."""
    frames, z = problem.frames, found.solution.z
    T_tracker_base, T_tool_target = frames.frames(z)
    studentised, outliers = studentise(found, problem, campaign, options["outlier_level"])
    deviations = np.sqrt(found.hyper.variances)
    return Calibration(
        model=frames.model,
        layout=frames,
        z=z,
        z_covariance=found.posterior,
        T_tracker_base=T_tracker_base,
        T_tool_target=T_tool_target,
        residuals=found.residual,
        studentised=studentised,
        outliers=outliers,
        ids=campaign.ids,
        model_error=tuple(float(d) for d in deviations),
        prior_scale=float(np.sqrt(found.hyper.prior_factor)) if belief.prior is not None else None,
        log_evidence=found.log_evidence if belief.prior is not None else None,
        field=None,
        iterations=found.solution.iterations,
        rounds=found.rounds,
        reason=found.solution.reason,
        remarks=_remarks(found, frames, campaign, belief.prior is not None),
        provenance=Provenance.of(frames.model, campaign, options),
    )


def _remarks(found: Fitted, frames: FrameLayout, campaign: Campaign, has_prior: bool) -> tuple[str, ...]:
    """What is unusual about a fit, in words."""
    out: list[str] = []
    scale = float(np.sqrt(found.hyper.prior_factor))
    if has_prior and len(frames.kept) and scale > WIDE:
        out.append(
            f"the robot deviates {scale:.0f} times as much as its tolerances say: check the joints' order, signs and zero "
            "positions and the lengths in the robot file, or state wider tolerances"
        )
    measured = int(campaign.valid.sum()) * found.residual.shape[2]
    if measured < 2 * len(frames.names):
        out.append(
            f"{measured} measured numbers for {len(frames.names)} unknowns: residuals of the fitted rows say little; hold rows out"
        )
    if found.rounds > MAX_ROUNDS:
        out.append("model error and prior scale had not settled when the search for them ended")
    if found.hyper.variances[0] == 0.0 and measured < 2 * len(frames.names):
        out.append("no model error could be told from so few rows, so the stated uncertainty leaves it out")
    errors = np.sqrt(np.diag(found.posterior))
    estimates = {name: (float(z), float(e)) for name, z, e in zip(frames.names, found.solution.z, errors, strict=True)}
    model = frames.model
    return (*out, *(remark for effect in model.effects for remark in effect.remarks(model.robot, estimates)))
