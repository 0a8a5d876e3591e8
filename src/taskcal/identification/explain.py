"""What geometry cannot explain: effects and a residual field, each only where the data prove it.

Every candidate effect competes by the logarithm of its marginal likelihood, which counts what its parameters cost; the best
one enters if its gain is well beyond what the best of all worthless candidates shows by chance, and the search goes on.
Cross-validation on rows that were not fitted tells in millimetres what each step was worth.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from taskcal.analysis.identifiability import identifiability
from taskcal.analysis.near_dependence import NearDependence
from taskcal.arguments import expect_kinds
from taskcal.errors import CampaignError, TaskcalError, shortened
from taskcal.estimation.blas import single_threaded
from taskcal.identification.calibration import Calibration
from taskcal.identification.cross_validation import mean_over_rows, predict_left_out, split_postures
from taskcal.identification.field import FEWEST, learn_field
from taskcal.identification.identify import identify
from taskcal.measurement.campaign import Campaign
from taskcal.robot.effects import Effect
from taskcal.robot.effects import candidates as default_candidates
from taskcal.robot.error_model import ErrorModel

PROOF = 3.0
"""Gain of log evidence that an effect must show, odds of 20 to 1. Log evidence counts what useless parameters cost: of all
candidates on 200 virtual robots that have no effect the best gained 2.9, and more than 1 in 8 of them only."""

SIGNIFICANT = 2.0
"""A residual field must lower the cross-validated error by so many standard errors of the paired difference."""


@dataclass(frozen=True, kw_only=True)
class Stage:
    """One step of the explanation."""

    name: str
    parameters: int
    log_evidence: float | None
    """Gain over the stage before; None for the first, and for the field."""
    cross_validated: float
    """Mean error in space on rows left out, metres."""
    standard_error: float
    """Of the change against the stage before, metres."""
    accepted: bool
    reason: str
    """Why."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Explanation:
    """A calibration with the effects and the field that the data prove, and the proof."""

    calibration: Calibration
    effects: tuple[Effect, ...]
    stages: tuple[Stage, ...]
    tracker: float
    """What the tracker's noise alone would leave, metres in space."""
    alike: tuple[NearDependence, ...]
    """Parameters of effects that geometry nearly repeats at the fitted poses, the most repeated first."""

    def __repr__(self) -> str:
        taken = ", ".join(stage.name for stage in self.stages if stage.accepted)
        return f"Explanation({shortened(taken, 150)}: {self.calibration!r})"

    def to_json(self) -> list[dict[str, Any]]:
        """The table, in millimetres."""
        return [
            {
                "stage": stage.name,
                "parameters": stage.parameters,
                "log_evidence_gain": stage.log_evidence,
                "cross_validated_mm": stage.cross_validated * 1e3,
                "standard_error_mm": stage.standard_error * 1e3,
                "accepted": stage.accepted,
                "reason": stage.reason,
            }
            for stage in self.stages
        ]


@single_threaded
def explain(
    model: ErrorModel,
    campaign: Campaign,
    *,
    effects: Sequence[Effect] | None = None,
    field: bool = False,
    candidates: Sequence[Effect] | None = None,
    folds: int = 5,
    seed: int = 0,
    progress: Callable[[str], None] = lambda _: None,
    **options: Any,
) -> Explanation:
    """Identify geometry, then the effects that the data prove, then a residual field if it proves itself.

    Args:
        model: the geometric model, possibly with effects that are certain, or expected whatever the data say.
        campaign: the measurements.
        effects: those to add without proof; by default the candidates are tried.
        field: try a residual field.
        candidates: effects that compete; by default what every effect that is defined proposes for the robot
            (`Effect.candidates`). They compete where the campaign tells what they need and use (`Effect.is_told`): backlash,
            settling and overrun where it has the ways to its rows, growth where all rows have temperatures, or times, that
            differ enough. Of two that have parameters in common, such as a compliance of two tolerances, the model gets one.
        folds: of the cross-validation.
        seed: of its folds.
        progress: told what is being done.
        **options: of `identify`.

    Raises:
        CampaignError: too few rows.
        FitError: a fit did not converge.
        TaskcalError: effects are to be found by evidence, without a prior.
    """
    expect_kinds({"model": ErrorModel, "campaign": Campaign}, model=model, campaign=campaign)
    if effects is None and options.get("prior", "tolerances") is None:
        raise TaskcalError(
            "effects are found by their evidence, which needs a prior; name the effects, or keep the prior"
        )
    parts = _split(campaign, folds, seed, FEWEST if field else 0)
    progress("geometry")
    best = identify(model, campaign, **options)
    left = predict_left_out(partial(identify, model, **options), campaign, parts)
    stages = [_stage("geometry", best, None, left, None, accepted=True, reason="the start")]
    added: list[Effect] = []
    if effects is not None:
        for effect in effects:
            model, options = _with(model, effect, options)
            added.append(effect)
        if added:
            progress("effects that were asked for")
            trial = identify(model, campaign, **options)
            errors = predict_left_out(partial(identify, model, **options), campaign, parts)
            name = ", ".join(effect.name for effect in added)
            stages.append(
                _stage(name, trial, best, errors, left, accepted=True, reason="asked for, not put to the proof")
            )
            best, left = trial, errors
    else:
        conditions = campaign.conditions
        competing = default_candidates(model.robot, conditions) if candidates is None else candidates
        able = [effect for effect in competing if effect.is_told(conditions)]
        found = _search(model, campaign, _beside(model, able), parts, best, left, options, progress)
        best, left, model, options, added, tried = found
        stages += tried
    if field:
        progress("residual field")
        trial = with_field(best, campaign, seed)
        errors = predict_left_out(
            lambda rest: with_field(identify(model, rest, **options), rest, seed), campaign, parts
        )
        gain, error = mean_over_rows(left - errors)
        accepted = bool(gain > SIGNIFICANT * error)
        change = -gain / max(error, 1e-12)
        reason = f"changes the cross-validated error by {change:+.1f} standard errors; −{SIGNIFICANT:g} is asked for"
        stages.append(_stage("residual field", trial, None, errors, left, accepted=accepted, reason=reason))
        best = trial if accepted else best
    noise = campaign.covariances(options.get("noise"))[campaign.valid][:, :3, :3]
    # mean length of an isotropic normal vector: √(8/π) standard deviations
    tracker = float(np.sqrt(8.0 / np.pi) * np.sqrt(np.trace(noise, axis1=1, axis2=2).mean() / 3.0))
    return Explanation(
        calibration=best,
        effects=tuple(added),
        stages=tuple(stages),
        tracker=tracker,
        alike=_repeated_by_geometry(best, campaign),
    )


def _repeated_by_geometry(calibration: Calibration, campaign: Campaign) -> tuple[NearDependence, ...]:
    """Parameters of effects that the fitted geometry, tracker frame and target nearly repeat at the campaign's poses."""
    model = calibration.model
    effects = [name for name in model.effect_names if name in calibration.kept]
    if not effects:
        return ()
    found = identifiability(model, campaign.q[campaign.valid.any(axis=1)], frames=True)
    fitted = {*calibration.kept, *(found.names[len(model) :] if not calibration.layout.fixed_frames else ())}
    return found.near(effects, against=sorted(fitted - set(effects)))


def with_field(calibration: Calibration, campaign: Campaign, seed: int = 0) -> Calibration:
    """The calibration with a field learned from its residuals on a campaign.

    Raises:
        CampaignError: too few rows.
    """
    seen = campaign.valid.any(axis=1)
    residual = np.nanmean(calibration.residuals_on(campaign, frame="base")[seen], axis=1)
    return replace(calibration, field=learn_field(campaign.q[seen], residual, seed))


def _search(
    model: ErrorModel,
    campaign: Campaign,
    candidates: list[Effect],
    parts: list[Int[np.ndarray, " _"]],
    best: Calibration,
    left: Float[np.ndarray, "rows targets"],
    options: dict[str, Any],
    progress: Callable[[str], None],
) -> tuple[Calibration, Float[np.ndarray, "rows targets"], ErrorModel, dict[str, Any], list[Effect], list[Stage]]:
    """Forward selection by log evidence."""
    added: list[Effect] = []
    stages: list[Stage] = []
    while candidates:
        progress(f"{len(candidates)} candidates beside {', '.join(['geometry', *(effect.name for effect in added)])}")
        extended = [_with(model, effect, options) for effect in candidates]
        trials = [identify(more, campaign, **kept) for more, kept in extended]
        gains = [_evidence(trial) - _evidence(best) for trial in trials]
        k = int(np.argmax(gains))
        of, effect, (more, kept) = len(candidates), candidates.pop(k), extended[k]
        errors = predict_left_out(partial(identify, more, **kept), campaign, parts)
        gain, _ = mean_over_rows(left - errors)
        likelier, worse = gains[k] > PROOF, gain < 0.0
        gained = f"log evidence {gains[k]:+.1f} against {PROOF:.1f}"
        if of > 1:
            gained = f"best of {of}: {gained}"
        reason = f"{gained}, but worse where it was not fitted" if likelier and worse else gained
        accepted = bool(likelier and not worse)
        stages.append(_stage(effect.name, trials[k], best, errors, left, accepted=accepted, reason=reason))
        if accepted:
            model, options, best, left = more, kept, trials[k], errors
            added.append(effect)
            candidates = _beside(model, candidates)
        elif not likelier:
            break
    return best, left, model, options, added, stages


def _beside(model: ErrorModel, candidates: Sequence[Effect]) -> list[Effect]:
    """Candidates that have no parameter of the model's."""
    return [effect for effect in candidates if not set(effect.term(model.robot).names) & set(model.names)]


def _with(model: ErrorModel, effect: Effect, options: dict[str, Any]) -> tuple[ErrorModel, dict[str, Any]]:
    """The model with an effect, and the options that keep its parameters where not all are kept."""
    more = model + effect
    if options.get("keep") is None:
        return more, options
    return more, {**options, "keep": [*options["keep"], *more.names[len(model) :]]}


def _evidence(calibration: Calibration) -> float:
    return -np.inf if calibration.log_evidence is None else calibration.log_evidence


def _split(campaign: Campaign, folds: int, seed: int, fewest: int) -> list[Int[np.ndarray, " _"]]:
    """Rows of each fold.

    Raises:
        CampaignError: without a fold too few rows would be left.
    """
    parts = split_postures(campaign.q, folds, seed)
    left = len(campaign) - max(map(len, parts))
    if left < fewest:
        raise CampaignError(
            f"{len(campaign)} rows are too few to prove a residual field: it is learned from {fewest} at least, and leaving out "
            f"one part of {folds} after another leaves {left}; measure {-(-fewest * folds // (folds - 1))} or more, better 100"
        )
    return parts


def _stage(
    name: str,
    calibration: Calibration,
    before: Calibration | None,
    errors: Float[np.ndarray, "rows targets"],
    left: Float[np.ndarray, "rows targets"] | None,
    *,
    accepted: bool,
    reason: str,
) -> Stage:
    gain = None
    if before is not None and before.log_evidence is not None and calibration.log_evidence is not None:
        gain = calibration.log_evidence - before.log_evidence
    return Stage(
        name=name,
        parameters=len(calibration.kept),
        log_evidence=gain,
        cross_validated=mean_over_rows(errors)[0],
        standard_error=(mean_over_rows(errors) if left is None else mean_over_rows(left - errors))[1],
        accepted=accepted,
        reason=reason,
    )
