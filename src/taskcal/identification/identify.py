"""The fit: a campaign and a model in, a Calibration out."""

from dataclasses import replace
from typing import Unpack

import numpy as np
from jaxtyping import Float

from taskcal.arguments import expect_kinds
from taskcal.estimation.blas import single_threaded
from taskcal.identification.belief import belief_of
from taskcal.identification.calibration import Calibration, Provenance
from taskcal.identification.considered import Outcome, consider, fitted_alone, fitted_whole
from taskcal.identification.fit_options import FitChoices, FitOptions
from taskcal.identification.hyperparameters import MAX_ROUNDS, Fitted, fit_with_hyperparameters
from taskcal.identification.outlier import studentise
from taskcal.identification.problem import FrameLayout, Problem, observe
from taskcal.measurement.campaign import Campaign
from taskcal.measurement.registration import Registration, check_plausible, check_rows, nominal_poses, register
from taskcal.robot.error_model import ErrorModel

WIDE = 5.0
"""A prior scale above this calls for a look at the robot file."""


@single_threaded
def identify(model: ErrorModel, campaign: Campaign, **options: Unpack[FitChoices]) -> Calibration:
    """Identify the model's parameters from a campaign, the tracker frame and the targets with them.

    The estimate minimises the whitened residuals with a Gaussian prior on every parameter, so that parameters that
    repeat each other share what is found instead of running away. Real robots deviate from any geometry by far more than
    the tracker's noise, and by their own amounts: a model error beside the noise, and one common scale of the prior, are
    those of the largest marginal likelihood.

    Args:
        model: the model.
        campaign: the measurements.
        **options: those of `FitOptions`, each by its name, and all at once as ``options``; names replace what is in those.

            ``keep``: names of the parameters to estimate; all by default. The others stay nil in the estimate. With the
            tolerances as prior, theirs stay in its covariance: the true robot varies in them all the same (`considered`). A
            prior that is given is taken for all that is believed.

            ``prior``: ``"tolerances"`` for the robot's own; a prior over the kept parameters; or None, when only Levenberg's
            damping holds undetermined directions, and the fit ends as soon as the objective falls by less than 10⁻⁶ of
            itself or the Newton decrement is below 10⁻².

            ``loss``: `Squared` (default), `Huber` or `Cauchy`.

            ``noise``: the tracker's, where the campaign does not state uncertainties.

            ``registration``: tracker frame and targets to start from, or to hold; found from the data by default.

            ``frames``: ``"fit"`` refines tracker frame and targets with the parameters, ``"fixed"`` holds them as registered.

            ``model_error``: standard deviation of what the model cannot explain, metres (and radians, for poses); or
            ``"estimate"``.

            ``prior_scale``: common factor of the prior's standard deviations; or ``"estimate"``.

            ``outlier_level``: chance of naming any outlier where there is none.

    Returns:
        the calibration: estimate, covariance, residuals, and predictions with their uncertainty.

    Raises:
        CampaignError: too few rows, a row at which the nominal robot's closed loop does not close, joints and points that do
            not belong together, or a model that depends on temperature or time and a row without.
        UnknownName: a name in `keep` that the model does not have.
        FitError: the fit did not converge.
        ValueError: an option that would silently mean something else.
    """
    expect_kinds({"model": ErrorModel, "campaign": Campaign}, model=model, campaign=campaign)
    chosen = FitOptions.of(**options)
    kept = np.arange(len(model)) if chosen.keep is None else model.indices(chosen.keep)
    check_rows(campaign)
    for effect in model.effects:
        campaign.check_told(effect.needs, effect.key)
    poses = nominal_poses(model, campaign)
    registration = chosen.registration or _registered(model, campaign, poses)
    whole = Problem(
        frames=FrameLayout(
            model=model,
            kept=np.arange(len(model)),
            registration=registration,
            targets=campaign.targets,
            pose=campaign.rotations is not None,
            fixed_frames=chosen.frames == "fixed",
        ),
        q=np.ascontiguousarray(campaign.q),
        seen=observe(campaign),
        noise=campaign.covariances(chosen.noise),
        conditions=campaign.conditions,
    )
    problem = replace(whole, frames=replace(whole.frames, kept=kept))
    belief = belief_of(problem.frames, chosen.prior)
    found = fit_with_hyperparameters(problem, belief, chosen)
    if len(kept) == len(model):
        outcome = fitted_whole(found, problem)
    elif chosen.prior != "tolerances":
        outcome = fitted_alone(found, problem, whole.frames)
    else:
        believed = belief_of(whole.frames, chosen.prior)
        hyper = fit_with_hyperparameters(whole, believed, chosen).hyper
        outcome = consider(found, problem, belief, whole, believed, hyper)
    return _conclude(found, outcome, campaign, chosen)


def _registered(model: ErrorModel, campaign: Campaign, poses: Float[np.ndarray, "n 4 4"]) -> Registration:
    """The registration that the data give.

    Raises:
        CampaignError: joints and points do not belong together.
    """
    registration = register(model, campaign, poses)
    check_plausible(registration, model, campaign)
    return registration


def _conclude(found: Fitted, outcome: Outcome, campaign: Campaign, options: FitOptions) -> Calibration:
    """Everything that is reported, from the converged fit."""
    layout, has_prior = outcome.layout, options.prior is not None
    T_tracker_base, T_tool_target = layout.frames(outcome.z)
    studentised, outliers = studentise(
        found.residual, outcome.residual_covariance, found.covariance, campaign, options.outlier_level
    )
    return Calibration(
        model=layout.model,
        layout=layout,
        estimated=outcome.estimated,
        z=outcome.z,
        z_covariance=outcome.covariance,
        T_tracker_base=T_tracker_base,
        T_tool_target=T_tool_target,
        residuals=found.residual,
        studentised=studentised,
        outliers=outliers,
        ids=campaign.ids,
        model_error=tuple(float(d) for d in np.sqrt(outcome.hyper.variances)),
        prior_scale=float(np.sqrt(outcome.hyper.prior_factor)) if has_prior else None,
        log_evidence=found.log_evidence if has_prior else None,
        field=None,
        iterations=found.solution.iterations,
        rounds=found.rounds,
        reason=found.solution.reason,
        remarks=_remarks(found, outcome, campaign, has_prior),
        provenance=Provenance.of(layout.model, campaign, options.described(layout.model, campaign)),
    )


def _remarks(found: Fitted, outcome: Outcome, campaign: Campaign, has_prior: bool) -> tuple[str, ...]:
    """What is unusual about a fit, in words."""
    out: list[str] = []
    layout, unknowns = outcome.layout, len(found.solution.z)
    scale = float(np.sqrt(outcome.hyper.prior_factor))
    if has_prior and len(outcome.estimated) and scale > WIDE:
        out.append(
            f"the robot deviates {scale:.0f} times as much as its tolerances say: check the joints' order, signs and zero "
            "positions and the lengths in the robot file, or state wider tolerances"
        )
    measured = int(campaign.valid.sum()) * found.residual.shape[2]
    if measured < 2 * unknowns:
        out.append(
            f"{measured} measured numbers for {unknowns} unknowns: residuals of the fitted rows say little; hold rows out"
        )
    if found.rounds > MAX_ROUNDS:
        out.append("model error and prior scale had not settled when the search for them ended")
    if outcome.hyper.variances[0] == 0.0 and measured < 2 * unknowns:
        out.append("no model error could be told from so few rows, so the stated uncertainty leaves it out")
    errors = np.sqrt(np.diag(outcome.covariance))
    estimates = {layout.names[i]: (float(outcome.z[i]), float(errors[i])) for i in outcome.estimated}
    model = layout.model
    return (*out, *(remark for effect in model.effects for remark in effect.remarks(model.robot, estimates)))
