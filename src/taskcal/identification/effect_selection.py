"""What geometry cannot explain: effects and a residual field, each only where the data prove it.

Every candidate effect competes by the logarithm of its marginal likelihood, which counts what its parameters cost; the best
one enters if its gain is well beyond what the best of all worthless candidates shows by chance, and the search goes on.
Cross-validation on rows that were not fitted tells in millimetres what each step was worth.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from functools import partial
from typing import Unpack

import numpy as np
from jaxtyping import Float, Int

from taskcal.analysis.collinearity import Collinearity
from taskcal.analysis.identifiability import identifiability
from taskcal.arguments import expect_kinds
from taskcal.errors import CampaignError, TaskcalError
from taskcal.estimation.blas import single_threaded
from taskcal.identification.calibration import Calibration
from taskcal.identification.cross_validation import mean_over_rows, predict_left_out, split_postures
from taskcal.identification.explanation import Explanation, Stage
from taskcal.identification.field import MIN_FIELD_ROWS, learn_field
from taskcal.identification.fit_options import FitChoices, FitOptions
from taskcal.identification.identify import identify
from taskcal.measurement.campaign import Campaign
from taskcal.robot.effects import Effect
from taskcal.robot.effects import candidates as default_candidates
from taskcal.robot.error_model import ErrorModel
from taskcal.short_repr import short_repr

MIN_EVIDENCE_GAIN = 3.0
"""Gain of log evidence that an effect must show, odds of 20 to 1. Log evidence counts what useless parameters cost: of all
candidates on 200 virtual robots that have no effect the best gained 2.9, and more than 1 in 8 of them only."""

MIN_SIGMAS = 2.0
"""A residual field must lower the cross-validated error by so many standard errors of the paired difference."""


@short_repr
@dataclass(frozen=True, kw_only=True)
class EffectSearch:
    """What may be added to the geometry, and how it is put to the proof."""

    effects: Sequence[Effect] | None = None
    """Those to add without proof; None to try the candidates."""
    candidates: Sequence[Effect] | None = None
    """Effects that compete; None for what every effect that is defined proposes for the robot (`Effect.candidates`)."""
    field: bool = False
    """Try a residual field."""
    folds: int = 5
    """Of the cross-validation."""
    seed: int = 0
    """Of its folds."""


class ExplainChoices(FitChoices, total=False):
    """Keywords of `explain`: those of `EffectSearch`, and of `identify`."""

    effects: Sequence[Effect] | None
    candidates: Sequence[Effect] | None
    field: bool
    folds: int
    seed: int


def _silent(_: str) -> None:
    """Say nothing."""


def explain(
    model: ErrorModel,
    campaign: Campaign,
    *,
    progress: Callable[[str], None] = _silent,
    **choices: Unpack[ExplainChoices],
) -> Explanation:
    """`select_effects` by keywords.

    Args:
        model: the geometric model, possibly with effects that are certain, or expected whatever the data say.
        campaign: the measurements.
        progress: told what is being done.
        **choices: ``effects`` to add without proof; by default the candidates are tried. ``field``, to try a residual field.
            ``candidates``, effects that compete; by default what every effect that is defined proposes for the robot
            (`Effect.candidates`). ``folds`` of the cross-validation (5), ``seed`` of its folds (0). All others are those of
            `identify`.

    Raises:
        CampaignError: too few rows.
        FitError: a fit did not converge.
        TaskcalError: effects are to be found by evidence, without a prior.
    """
    names = [f.name for f in fields(EffectSearch)]
    search = EffectSearch(**{name: value for name, value in choices.items() if name in names})  # pyright: ignore[reportArgumentType]
    options = FitOptions.of(**{name: value for name, value in choices.items() if name not in names})  # pyright: ignore[reportArgumentType]
    return select_effects(model, campaign, search, options=options, progress=progress)


@single_threaded
def select_effects(
    model: ErrorModel,
    campaign: Campaign,
    search: EffectSearch | None = None,
    *,
    options: FitOptions | None = None,
    progress: Callable[[str], None] = _silent,
) -> Explanation:
    """Identify geometry, then the effects that the data prove, then a residual field if it proves itself.

    Candidates compete where the campaign tells what they need and use (`Effect.is_told`): backlash, settling and overshoot where
    it has the ways to its rows, thermal expansion where all rows have temperatures, or times, that differ enough. Of two that have
    parameters in common, such as a compliance of two tolerances, the model gets one.

    Args:
        model: the geometric model, possibly with effects that are certain, or expected whatever the data say.
        campaign: the measurements.
        search: what may be added.
        options: of every fit.
        progress: told what is being done.

    Raises:
        CampaignError: too few rows.
        FitError: a fit did not converge.
        TaskcalError: effects are to be found by evidence, without a prior.
    """
    expect_kinds({"model": ErrorModel, "campaign": Campaign}, model=model, campaign=campaign)
    expect_kinds({"search": EffectSearch | None, "options": FitOptions | None}, search=search, options=options)
    search, options = search or EffectSearch(), options or FitOptions()
    if search.effects is None and options.prior is None:
        raise TaskcalError(
            "effects are found by their evidence, which needs a prior; name the effects, or keep the prior"
        )
    progress("geometry")
    best = identify(model, campaign, options=options)
    # rows that are wrong for the geometry are wrong for all that is tried beside it
    left_out, said = best.left_out, best.remarks[:1] if best.left_out else ()
    campaign = campaign.without(np.isin(campaign.ids, [row.id for row in left_out]))
    options = replace(options, gross_errors="keep")
    parts = _split(campaign, search.folds, search.seed, MIN_FIELD_ROWS if search.field else 0)
    trial = _Trial(campaign=campaign, parts=parts, progress=progress)
    errors = trial.errors_left_out(model, options)
    start = _stage("geometry", best, None, errors, None, accepted=True, reason="the start")
    selection = _Selection(model=model, options=options, calibration=best, errors=errors, stages=(start,))
    if search.effects is None:
        conditions = campaign.conditions
        competing = default_candidates(model.robot, conditions) if search.candidates is None else search.candidates
        able = [effect for effect in competing if effect.is_told(conditions)]
        selection = _search(selection, _beside(model, able), trial)
    elif search.effects:
        selection = _add(selection, search.effects, trial)
    if search.field:
        selection = _try_field(selection, search.seed, trial)
    noise = campaign.covariances(options.noise)[campaign.valid][:, :3, :3]
    # mean length of an isotropic normal vector: √(8/π) standard deviations
    tracker = float(np.sqrt(8.0 / np.pi) * np.sqrt(np.trace(noise, axis1=1, axis2=2).mean() / 3.0))
    calibration = selection.calibration
    if calibration is not best:
        calibration = replace(calibration, left_out=left_out, remarks=(*said, *calibration.remarks))
    return Explanation(
        calibration=calibration,
        effects=selection.effects,
        stages=selection.stages,
        tracker=tracker,
        collinearities=_repeated_by_geometry(selection.calibration, campaign),
    )


@dataclass(frozen=True, eq=False, kw_only=True)
class _Trial:
    """On what models are tried, and how."""

    campaign: Campaign
    parts: list[Int[np.ndarray, " _"]]
    """Rows of each fold."""
    progress: Callable[[str], None]

    def fit(self, model: ErrorModel, options: FitOptions) -> Calibration:
        """The fit of all rows."""
        return identify(model, self.campaign, options=options)

    def errors_left_out(self, model: ErrorModel, options: FitOptions) -> Float[np.ndarray, "rows targets"]:
        """Errors where a row was not fitted, metres."""
        return predict_left_out(partial(identify, model, options=options), self.campaign, self.parts)


@dataclass(frozen=True, eq=False, kw_only=True)
class _Selection:
    """The model so far, its fit, and how it came about."""

    model: ErrorModel
    options: FitOptions
    calibration: Calibration
    errors: Float[np.ndarray, "rows targets"]
    """Where a row was not fitted, metres."""
    effects: tuple[Effect, ...] = ()
    """Those that were added."""
    stages: tuple[Stage, ...]


def _add(selection: _Selection, effects: Sequence[Effect], trial: _Trial) -> _Selection:
    """Effects that were asked for, all at once."""
    model, options = selection.model, selection.options
    for effect in effects:
        model, options = _with(model, effect, options)
    trial.progress("effects that were asked for")
    calibration, errors = trial.fit(model, options), trial.errors_left_out(model, options)
    name = ", ".join(effect.name for effect in effects)
    reason = "asked for, not put to the proof"
    stage = _stage(name, calibration, selection.calibration, errors, selection.errors, accepted=True, reason=reason)
    return _Selection(
        model=model,
        options=options,
        calibration=calibration,
        errors=errors,
        effects=tuple(effects),
        stages=(*selection.stages, stage),
    )


def _try_field(selection: _Selection, seed: int, trial: _Trial) -> _Selection:
    """A residual field, if it lowers the error where it was not learned."""
    trial.progress("residual field")
    calibration = with_field(selection.calibration, trial.campaign, seed)

    def fit(rest: Campaign) -> Calibration:
        return with_field(identify(selection.model, rest, options=selection.options), rest, seed)

    errors = predict_left_out(fit, trial.campaign, trial.parts)
    gain, error = mean_over_rows(selection.errors - errors)
    accepted = bool(gain > MIN_SIGMAS * error)
    change = -gain / max(error, 1e-12)
    reason = f"changes the cross-validated error by {change:+.1f} standard errors; −{MIN_SIGMAS:g} is asked for"
    stage = _stage("residual field", calibration, None, errors, selection.errors, accepted=accepted, reason=reason)
    best = calibration if accepted else selection.calibration
    return replace(selection, calibration=best, stages=(*selection.stages, stage))


def _repeated_by_geometry(calibration: Calibration, campaign: Campaign) -> tuple[Collinearity, ...]:
    """Parameters of effects that the fitted geometry, tracker frame and target nearly repeat at the campaign's poses."""
    model = calibration.model
    effects = [name for name in model.effect_names if name in calibration.kept]
    if not effects:
        return ()
    analysis = identifiability(model, campaign.q[campaign.valid.any(axis=1)], frames=True)
    fitted = {*calibration.kept, *(analysis.names[len(model) :] if not calibration.layout.fixed_frames else ())}
    return analysis.collinear(effects, against=sorted(fitted - set(effects)))


def with_field(calibration: Calibration, campaign: Campaign, seed: int = 0) -> Calibration:
    """The calibration with a field learned from its residuals on a campaign.

    Raises:
        CampaignError: too few rows.
    """
    seen = campaign.valid.any(axis=1)
    residual = np.nanmean(calibration.residuals_on(campaign, frame="base")[seen], axis=1)
    return replace(calibration, field=learn_field(campaign.q[seen], residual, seed))


def _search(selection: _Selection, candidates: list[Effect], trial: _Trial) -> _Selection:
    """Forward selection by log evidence."""
    while candidates:
        beside = ", ".join(["geometry", *(effect.name for effect in selection.effects)])
        trial.progress(f"{len(candidates)} candidates beside {beside}")
        extended = [_with(selection.model, effect, selection.options) for effect in candidates]
        fits = [trial.fit(model, options) for model, options in extended]
        gains = [_evidence(fit) - _evidence(selection.calibration) for fit in fits]
        k = int(np.argmax(gains))
        of, effect, (model, options) = len(candidates), candidates.pop(k), extended[k]
        errors = trial.errors_left_out(model, options)
        gain, _ = mean_over_rows(selection.errors - errors)
        likelier, worse = gains[k] > MIN_EVIDENCE_GAIN, gain < 0.0
        gained = f"log evidence {gains[k]:+.1f} against {MIN_EVIDENCE_GAIN:.1f}"
        if of > 1:
            gained = f"best of {of}: {gained}"
        reason = f"{gained}, but worse where it was not fitted" if likelier and worse else gained
        accepted = bool(likelier and not worse)
        stage = _stage(
            effect.name, fits[k], selection.calibration, errors, selection.errors, accepted=accepted, reason=reason
        )
        selection = replace(selection, stages=(*selection.stages, stage))
        if accepted:
            effects = (*selection.effects, effect)
            selection = replace(
                selection, model=model, options=options, calibration=fits[k], errors=errors, effects=effects
            )
            candidates = _beside(model, candidates)
        elif not likelier:
            break
    return selection


def _beside(model: ErrorModel, candidates: Sequence[Effect]) -> list[Effect]:
    """Candidates that have no parameter of the model's."""
    return [effect for effect in candidates if not set(effect.term(model.robot).names) & set(model.names)]


def _with(model: ErrorModel, effect: Effect, options: FitOptions) -> tuple[ErrorModel, FitOptions]:
    """The model with an effect, and the options that keep its parameters where not all are kept."""
    more = model + effect
    return more, options.keeping(more.names[len(model) :])


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
