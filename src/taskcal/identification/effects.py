"""What geometry cannot explain: effects that are asked for, or all that may be there in one model.

With all of them, each effect of each joint is as large as the data say, which may be nothing (`group_model`). Closed forms tell
what each is worth: how far the log evidence would fall without it, and how far the error where rows were not fitted would
rise. The model is kept only where it predicts held-out rows better than the geometry alone, and where the log
evidence is for it, and for its effects together, as much as for an effect that is called proven.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from taskcal.analysis.identifiability import Collinearity, identifiability
from taskcal.arguments import Named, by_name, checked, chosen_options, converted
from taskcal.campaigns.campaign import Campaign
from taskcal.errors import ClosureError, FitError, TaskcalError, shortened
from taskcal.estimation.matrices import single_threaded
from taskcal.identification.calibration import Calibration
from taskcal.identification.checks.checks import (
    OF_GEOMETRY,
    OF_SIBLING,
    UNUSED_SIBLING,
    Asked,
    Sibling,
    Unused,
    by_tolerances,
    frames_alone,
    hold_scale,
    refuse,
    rows_left_out,
    said_of,
)
from taskcal.identification.fit import Fit
from taskcal.identification.group_search import (
    LEAVING_OUT,
    SHARPENING,
    STARTS,
    TOGETHER,
    GroupModelFound,
    find_group_model,
)
from taskcal.identification.held_out import group_neighbours
from taskcal.identification.holdout import (
    PartErrors,
    about_calibration,
    end_parts,
    errors_of_parts,
    mean_over_rows,
    predict_left_out,
    split_postures,
)
from taskcal.identification.identify import attempt
from taskcal.identification.options import EffectSearch, FitOptions
from taskcal.identification.problem import problem_of
from taskcal.identification.sibling import has_own_sizes
from taskcal.observations.base import UNMEASURED, TrackerNoise
from taskcal.robot.effects import SPECTRUM, Effect, JointField, kinds
from taskcal.robot.effects import candidates as default_candidates
from taskcal.robot.error_model import ErrorModel
from taskcal_groundwork.said import Said, joined, term

# Which effects may be added to the geometry, and how they are put to the proof.


def untried_effects(model: ErrorModel, campaign: Campaign, search: EffectSearch) -> dict[str, str]:
    """Effects that do not compete, each with the reason.

    Args:
        model: the geometric model, possibly with effects.
        campaign: the measurements.
        search: what may be added.
    """
    robot, conditions = model.robot, campaign.conditions
    if robot.driven:
        return {
            "all effects": Said(
                "{robot} has joints that others drive ({joint}), and how effects pass through their linkage is not modelled",
                robot=robot.name,
                joint=robot.driven[0].name,
            )
        }
    competing, instead = competing_effects(model, campaign, search)
    tried = {type(effect) for effect in (*competing, *instead, *model.effects)}
    if search.candidates is not None:
        asked = {type(effect) for effect in search.candidates}
    else:
        asked = set(kinds()) if search.effects is None else {JointField}
    return {kind.label: kind.untried(robot, conditions) for kind in kinds() if kind in asked - tried}


def competing_effects(model: ErrorModel, campaign: Campaign, search: EffectSearch) -> tuple[list[Effect], list[Effect]]:
    """Effects that take part, those that were named or all that the campaign tells of; and those that may replace one.

    Each parameter takes part once: the first effect that has it is taken, a later one may replace it.
    """
    conditions = campaign.conditions
    if model.robot.driven:
        return [], []
    if search.candidates is not None:
        named = list(search.candidates)
    else:
        named = default_candidates(model.robot, conditions) if search.effects is None else []
    if search.field and not any(isinstance(effect, JointField) for effect in named):
        named.append(JointField())
    out: list[Effect] = []
    instead: list[Effect] = []
    taken: set[str] = set()
    for effect in named:
        own = set(effect.term(model.robot).names)
        if not effect.is_told(conditions) or own & set(model.names):
            continue
        (instead if own & taken else out).append(effect)
        taken |= own
    return out, instead


# What a selection of effects found: a calibration with what the data prove, and the proof, step by step.


@dataclass(frozen=True, kw_only=True)
class Stage:
    """One step of the explanation."""

    name: str
    parameters: int
    log_evidence: float | None
    """Gain over the stage before, and of one effect among others what would be lost without it; None for the first."""
    cross_validated: float
    """Mean error in space on rows left out, metres; of one effect among others that without it."""
    standard_error: float
    """Of the change, metres."""
    accepted: bool
    reason: str
    """Why."""
    worth: float | None = None
    """What the error on rows left out falls by, metres; None for the first."""
    among_others: bool = False
    """Whether it is one effect among all that were fitted together, not a step after the one before."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Explanation:
    """A calibration with the supported effects, and the evidence for each."""

    calibration: Calibration
    effects: tuple[Effect, ...]
    stages: tuple[Stage, ...]
    tracker: float
    """What the tracker's noise alone would leave, metres in space."""
    collinearities: tuple[Collinearity, ...]
    """Parameters of effects that geometry nearly repeats at the fitted poses, the most repeated first."""
    untried: Mapping[str, str] = field(default_factory=dict[str, str])
    """Effects that were not tried, each with the reason."""

    @property
    def steps(self) -> tuple[Stage, ...]:
        """Geometry, and what came after it as a whole."""
        return tuple(stage for stage in self.stages if not stage.among_others)

    @property
    def worths(self) -> tuple[Stage, ...]:
        """Contribution of each effect among all others that were fitted with it, the largest first."""
        return tuple(stage for stage in self.stages if stage.among_others)

    def __repr__(self) -> str:
        taken = ", ".join(stage.name for stage in self.stages if stage.accepted)
        return f"Explanation({shortened(taken, 150)}: {self.calibration!r})"

    def summary(self) -> list[dict[str, Any]]:
        """The table, in millimetres."""
        return [
            {
                "stage": stage.name,
                "parameters": stage.parameters,
                "log_evidence_gain": stage.log_evidence,
                "cross_validated_mm": stage.cross_validated * 1e3,
                "standard_error_mm": stage.standard_error * 1e3,
                "worth_mm": None if stage.worth is None else stage.worth * 1e3,
                "accepted": stage.accepted,
                "reason": stage.reason,
            }
            for stage in self.stages
        ]


# The steps of a search for effects, as they are told while it runs.

GEOMETRY = "geometry"
ASKED_FOR = "effects that were asked for"
CHECK = "held-out rows"


def search_steps(model: ErrorModel, campaign: Campaign, search: EffectSearch) -> tuple[str, ...]:
    """Steps that `select_effects` reports to its `progress` one after another; it may pass over some.

    Args:
        model: as given to `select_effects`.
        campaign: as given to it.
        search: as given to it.
    """
    folds = [CHECK] * search.folds
    steps = [GEOMETRY, *folds]
    for effect in search.effects or ():
        model = model + effect
    if search.effects:
        steps += [ASKED_FOR, *folds]
    if search.effects is None or search.field:
        competing, instead = competing_effects(model, campaign, search)
        if competing:
            steps += [TOGETHER, *(effect.name for effect in instead)]
            steps += [SHARPENING] * (STARTS if SPECTRUM in [*competing, *instead] else 0)
            steps.append(LEAVING_OUT)
    return tuple(steps)


MIN_EVIDENCE_GAIN = 3.0
"""Fall of the log evidence without an effect from which on it is called proven: odds of 20 to 1. Decision 0012: effects that
are not there gained 2.9 at most on 200 virtual robots, in the search as it was."""

CLEAR_ERRORS = 2.0
"""Standard errors by which held-out rows are predicted better, at least, where the evidence for the model is not that of its
effects: errors of joints and weights of poses, which geometry alone does not have, may be likelier, too. A convention: by chance in
one of forty."""

MAX_COLLINEAR = 100
"""Parameters of an effect, at most, of which it is asked what geometry repeats of them. A convention: of more the sum counts,
not each."""


def _silent(_: str) -> None:
    """Say nothing."""


@checked
@dataclass(frozen=True, eq=False, kw_only=True)
class ExplainOptions(FitOptions, EffectSearch):
    """Options of `explain`: of the search, and of every fit."""

    progress: Callable[[str], None] = _silent
    """Told what is being done, in the order of `search_steps`."""

    def __post_init__(self) -> None:
        FitOptions.__post_init__(self)
        EffectSearch.__post_init__(self)


@by_name(ExplainOptions)
@checked
def explain(
    _kind: Callable[Named, ExplainOptions],
    model: ErrorModel,
    campaign: Campaign,
    options: FitOptions | EffectSearch | None = None,
    *_args: Named.args,
    **_named: Named.kwargs,
) -> Explanation:
    """`select_effects` by keywords.

    Args:
        model: the geometric model, possibly with effects that are certain, or expected whatever the data say.
        campaign: the measurements.
        options: of the search, and of every fit.

    Raises:
        CampaignError: too few rows.
        FitError: a fit did not converge.
        TaskcalError: effects are to be found by evidence, without a prior or with one that is given.
    """
    chosen = chosen_options(_kind, options, *_args, **_named)
    search, fit = converted(EffectSearch, chosen), converted(FitOptions, chosen)
    return select_effects(model, campaign, search, options=fit, progress=chosen.progress)


@checked
@single_threaded
def select_effects(
    model: ErrorModel,
    campaign: Campaign,
    search: EffectSearch | None = None,
    *,
    options: FitOptions | None = None,
    progress: Callable[[str], None] = _silent,
) -> Explanation:
    """Identify geometry, then geometry and all effects at once, and keep the effects where the data support them.

    Candidates compete where the campaign tells what they need and use (`Effect.is_told`): backlash, settling and overshoot where
    it has the ways to its rows, thermal expansion where all rows have temperatures, or times, that differ enough. Of two that have
    parameters in common the model gets one.

    All effects together are kept where they predict rows better that were not fitted, and neither groups of neighbouring postures
    (`group_neighbours`) nor the ends of the joints' ranges (`end_parts`) clearly worse, and the evidence is for them; else the
    geometry is, or tracker frame and targets alone where no parameter of the geometry explains the rows. The calibration's remarks
    say so.

    Args:
        model: the geometric model, possibly with effects that are certain, or expected whatever the data say.
        campaign: the measurements.
        search: what may be added.
        options: of every fit.
        progress: told what is being done, in the order of `search_steps`.

    Raises:
        CampaignError: too few rows, or what `identify` raises of the geometry alone.
        FitError: geometry explains nothing of the rows, and they are farther off than the robot's tolerances allow.
        TaskcalError: effects are to be found by evidence, without a prior or with one that is given.
    """
    search, options = search or EffectSearch(), options or FitOptions()
    if search.effects is None and options.prior is None:
        raise TaskcalError(
            "effects are found by their evidence, which needs a prior; name the effects, or keep the prior"
        )
    if (search.effects is None or search.field) and options.prior not in (None, "tolerances"):
        raise TaskcalError(
            "effects are found with the robot's tolerances as prior, not with one that is given; name the effects, or leave out "
            "the prior"
        )
    options = hold_scale(Asked(model, campaign, options))
    like = options.like
    if like is not None:
        refuse(Sibling(model, like, effects=search.effects is None or search.field), OF_SIBLING)
        options = replace(options, like=None) if has_own_sizes(like) else options
    progress(GEOMETRY)
    alone = attempt(model, campaign, options)
    best = by_tolerances(alone).calibration
    left_out = best.left_out
    # rows that are wrong for the geometry are wrong for all that is tried beside it, and so is what its checks say: effects
    # explain away what is wrong with robot or joints
    said = said_of(alone, (*OF_GEOMETRY, rows_left_out))
    campaign = campaign.without(np.isin(campaign.ids, [row.id for row in left_out]))
    options = replace(options, gross_errors="keep")
    parts = split_postures(campaign.q, search.folds, search.seed)
    trial = _Trial(campaign=campaign, parts=parts, progress=progress)
    errors = trial.errors_left_out(model, options)
    start = _stage("geometry", best, None, errors, None, accepted=True, reason="baseline")
    selection = _Selection(model=model, options=options, fitted=alone, calibration=best, errors=errors, stages=(start,))
    if search.effects:
        selection = _add(selection, search.effects, trial)
    if search.effects is None or search.field:
        selection = _find_all(selection, trial, search, like)
    fitted = selection.fitted
    calibration = selection.calibration if fitted is None else fitted.with_growth()
    if fitted is alone:
        remarks = (*said, *best.remarks[len(left_out[:1]) :], *selection.remarks)
    else:
        nothing = (Said("geometry alone: {remark}", remark=remark) for remark in said_of(alone, [frames_alone]))
        remarks = (*said, *nothing, *calibration.remarks, *selection.remarks)
    calibration = replace(calibration, left_out=left_out, remarks=remarks)
    if like is not None:
        calibration = _with_unused_sibling(calibration, like)
    return Explanation(
        calibration=calibration,
        effects=selection.effects,
        stages=selection.stages,
        tracker=tracker_error(campaign, options.noise),
        collinearities=_repeated_by_geometry(selection.calibration, selection.effects, campaign),
        untried=untried_effects(model, campaign, search) if search.effects is None or search.field else {},
    )


def _with_unused_sibling(calibration: Calibration, like: Calibration) -> Calibration:
    """A remark where the sizes are of another kind than the sibling's."""
    made = calibration.provenance
    if "taken" in made.options.get("like", {}):
        return calibration
    told = {**like.origin, "taken": False, "log_evidence_gain": 0.0}
    return replace(
        calibration,
        remarks=(*calibration.remarks, *said_of(Unused(calibration, like), UNUSED_SIBLING)),
        provenance=replace(made, options={**made.options, "like": told}),
    )


def tracker_error(campaign: Campaign, noise: TrackerNoise | None = None) -> float:
    """Mean error in space that the tracker's noise alone would leave, metres.

    Args:
        campaign: the measurements.
        noise: the tracker's, where the campaign does not state uncertainties.
    """
    variances = campaign.covariances(noise)[campaign.valid][:, range(3), range(3)]
    # mean length of an isotropic normal vector: √(8/π) standard deviations
    return float(np.sqrt(8.0 / np.pi * variances[variances < UNMEASURED].mean()))


@dataclass(frozen=True, eq=False, kw_only=True)
class _Trial:
    """On what models are tried, and how."""

    campaign: Campaign
    parts: list[Int[np.ndarray, " _"]]
    """Rows of each fold."""
    progress: Callable[[str], None]

    def fit(self, model: ErrorModel, options: FitOptions) -> Fit:
        """The fit of all rows."""
        return attempt(model, self.campaign, options)

    def errors_left_out(self, model: ErrorModel, options: FitOptions) -> Float[np.ndarray, "rows targets"]:
        """Errors where a row was not fitted, metres."""

        def fit(campaign: Campaign) -> Calibration:
            self.progress(CHECK)
            return attempt(model, campaign, options).calibration

        return predict_left_out(fit, self.campaign, self.parts)


@dataclass(frozen=True, eq=False, kw_only=True)
class _Selection:
    """The model so far, its fit, and how it came about."""

    model: ErrorModel
    options: FitOptions
    calibration: Calibration
    fitted: Fit | None
    """By which its growth beyond the measured range is judged in the end; None of the one model, of which it is already."""
    errors: Float[np.ndarray, "rows targets"]
    """Where a row was not fitted, metres."""
    effects: tuple[Effect, ...] = ()
    """Those that were added."""
    stages: tuple[Stage, ...]
    remarks: tuple[str, ...] = ()
    """Why effects are not part of it."""


def _add(selection: _Selection, effects: Sequence[Effect], trial: _Trial) -> _Selection:
    """Effects that were asked for, all at once."""
    model, options = selection.model, selection.options
    for effect in effects:
        model, options = _with(model, effect, options)
    trial.progress(ASKED_FOR)
    name, tried = ", ".join(effect.name for effect in effects), trial.fit(model, options)
    if tried.refusal is not None:
        remark = Said("{name}: asked for, and not fitted: {why}", name=name, why=_shortly(tried.refusal))
        return replace(selection, remarks=(*selection.remarks, remark))
    calibration, errors = tried.calibration, trial.errors_left_out(model, options)
    reason = "asked for, not put to the proof"
    stage = _stage(name, calibration, selection.calibration, errors, selection.errors, accepted=True, reason=reason)
    return _Selection(
        model=model,
        options=options,
        calibration=calibration,
        fitted=tried,
        errors=errors,
        effects=tuple(effects),
        stages=(*selection.stages, stage),
    )


def _find_all(
    selection: _Selection, trial: _Trial, search: EffectSearch, like: Calibration | None = None
) -> _Selection:
    """The one model, where it predicts better than what is there; a sibling's sizes expected of it if there is one."""
    competing, instead = competing_effects(selection.model, trial.campaign, search)
    if not competing:
        why = untried_effects(selection.model, trial.campaign, search)
        reasons = [Said("{name}: {reason}", name=term(name), reason=reason) for name, reason in why.items()]
        remark = Said("no effect was tried: {reasons}", reasons=joined("; ", reasons or [Said("none competes")]))
        return replace(selection, remarks=(*selection.remarks, remark))
    try:
        one = find_group_model(
            selection.calibration,
            trial.campaign,
            competing,
            instead,
            trial.parts,
            replace(selection.options, like=like),
            seed=search.seed,
            progress=trial.progress,
        )
    except (FitError, ClosureError) as refusal:
        remark = Said("effects were tried and are not part of the calibration: {why}", why=_shortly(refusal))
        return replace(selection, remarks=(*selection.remarks, remark))
    whole = one.errors.whole
    gain, error = mean_over_rows(selection.errors - whole)
    after, before = one.calibration.log_evidence, selection.calibration.log_evidence
    for_it = gain > error
    if after is not None and before is not None:
        told = gain > CLEAR_ERRORS * error or _evidence_of(one.effects, one) > MIN_EVIDENCE_GAIN
        for_it = told and after - before > MIN_EVIDENCE_GAIN
    reason = Said("predicts held-out rows better") if gain > 0.0 else Said("predicts held-out rows no better")
    if gain > 0.0 and not for_it:
        reason = Said("{reason}, but without the evidence for it", reason=reason)
    outer = _Outer.of(selection, trial, one, search)
    against = outer.against()
    better = bool(gain > 0.0 and for_it and not against)
    if gain > 0.0 and against:
        reason = Said("{reason}, but {against}", reason=reason, against=against)
    together = _stage(
        "all effects", one.calibration, selection.calibration, whole, selection.errors, accepted=better, reason=reason
    )
    worths = {effect: _worth(effect, one, outer, enters=better) for effect in one.effects}
    stages = sorted(worths.values(), key=lambda stage: stage.cross_validated, reverse=True)
    selection = replace(selection, stages=(*selection.stages, together, *stages))
    if not better:
        remark = Said("effects were tried and are not part of the calibration: their model {reason}", reason=reason)
        return replace(selection, remarks=(*selection.remarks, remark))
    proven = [effect for effect, stage in worths.items() if stage.accepted]
    return replace(
        selection,
        model=one.calibration.model,
        calibration=one.calibration,
        fitted=None,
        errors=whole,
        effects=(*selection.effects, *proven),
    )


@dataclass(frozen=True, eq=False, kw_only=True)
class _Outer:
    """Errors of the one model where rows have no neighbour on one side that was fitted, and of what is there, metres.

    Of two poses side by side, one in the fit tells the other's error: effects that follow the rows closely look good among them,
    and need not be so where the robot was not measured.
    """

    clusters: PartErrors
    """Of groups of neighbouring poses."""
    beside_clusters: Float[np.ndarray, " clusters"]
    """Of what is there."""
    ends: PartErrors
    """At the ends of the joints' ranges."""
    beside_ends: Float[np.ndarray, " ends"]

    @classmethod
    def of(cls, selection: _Selection, trial: _Trial, one: GroupModelFound, search: EffectSearch) -> "_Outer":
        """By the normal equations, no model is fitted again."""
        calibration, options, fitted = selection.calibration, selection.options, one.fitted
        problem = problem_of(calibration.layout, trial.campaign, options.noise)
        there = about_calibration(calibration, problem, options)
        group = group_neighbours(trial.campaign.q, search.folds)
        clusters = [np.flatnonzero(group == number) for number in range(group.max() + 1)]
        return cls(
            clusters=errors_of_parts(fitted, clusters, [effect.name for effect in one.effects]),
            beside_clusters=errors_of_parts(there, clusters).whole,
            ends=one.errors.ends,
            beside_ends=errors_of_parts(there, end_parts(problem)).whole,
        )

    def against(self) -> str:
        """Why the one model is worse than what is there; empty where it is not."""
        there, own = self.beside_clusters, self.clusters.whole
        if _clearly_less(there, own):
            return Said(
                "neighbouring poses left out together worse: {own:.4f} in place of {there:.4f} mm",
                own=float(np.nanmean(own)) * 1e3,
                there=float(np.nanmean(there)) * 1e3,
            )
        there, own = self.beside_ends, self.ends.whole
        if _clearly_less(there, own):
            return Said(
                "ends of the joints' ranges worse: {own:.4f} in place of {there:.4f} mm",
                own=float(np.nanmean(own)) * 1e3,
                there=float(np.nanmean(there)) * 1e3,
            )
        return ""

    def harmed_by(self, effect: str) -> bool:
        """Whether the ends, or the groups of neighbours, are predicted better without an effect."""
        return any(_clearly_less(parts.without[effect], parts.whole) for parts in (self.clusters, self.ends))


def _clearly_less(some: Float[np.ndarray, " parts"], others: Float[np.ndarray, " parts"]) -> bool:
    """Whether errors are smaller in the mean over parts by more than the standard error of that.

    A part counts once: its poses have in common what is wrong there.
    """
    fall = (others - some)[np.isfinite(others - some)]
    return len(fall) > 1 and bool(fall.mean() > fall.std(ddof=1) / np.sqrt(len(fall)))


def _shortly(refusal: TaskcalError) -> str:
    """A refusal without what it advises."""
    return str(refusal).partition(". ")[0].partition("; ")[0]


def _evidence_of(effects: Sequence[Effect], one: GroupModelFound) -> float:
    """Fall of the log evidence without effects, all else as it is."""
    groups = np.concatenate([one.fitted.group_model.of_effect(effect.name) for effect in effects])
    return one.fitted.found.log_integrated() - one.fitted.found.log_integrated(groups)


def _worth(effect: Effect, one: GroupModelFound, outer: _Outer, *, enters: bool) -> Stage:
    """Loss of the model without an effect."""
    fall = _evidence_of([effect], one)
    errors = one.errors.without[effect.name]
    worth, error = mean_over_rows(errors - one.errors.whole)
    gained = Said("Δ log evidence {fall:.1f} (threshold {least:g})", fall=float(fall), least=MIN_EVIDENCE_GAIN)
    harms = outer.harmed_by(effect.name)
    if fall > MIN_EVIDENCE_GAIN and worth <= error:
        gained = Said("{gained}; error increase not significant", gained=gained)
    elif fall > MIN_EVIDENCE_GAIN and harms:
        gained = Said(
            "{gained}; ends of the joints' ranges or neighbouring poses left out together are predicted better without",
            gained=gained,
        )
    return Stage(
        name=effect.name,
        parameters=len(effect.term(one.calibration.model.robot).names),
        log_evidence=float(fall),
        cross_validated=mean_over_rows(errors)[0],
        standard_error=error,
        accepted=bool(enters and fall > MIN_EVIDENCE_GAIN and worth > error and not harms),
        reason=gained,
        worth=worth,
        among_others=True,
    )


def _repeated_by_geometry(
    calibration: Calibration, proven: Sequence[Effect], campaign: Campaign
) -> tuple[Collinearity, ...]:
    """Parameters of effects that the fitted geometry, tracker frame and target nearly repeat at the campaign's poses."""
    robot = calibration.model.robot
    few = [effect for effect in proven if len(effect.term(robot).names) <= MAX_COLLINEAR]
    model = ErrorModel(robot, lengths_only=calibration.model.lengths_only, effects=few)
    effects = [name for name in model.effect_names if name in calibration.kept]
    if not effects:
        return ()
    analysis = identifiability(model, campaign.q[campaign.valid.any(axis=1)], frames=True)
    fitted = {*calibration.kept, *(analysis.names[len(model) :] if not calibration.layout.fixed_frames else ())}
    return analysis.collinear(effects, against=sorted((fitted & set(analysis.names)) - set(effects)))


def _with(model: ErrorModel, effect: Effect, options: FitOptions) -> tuple[ErrorModel, FitOptions]:
    """The model with an effect, and the options that keep its parameters where not all are kept."""
    more = model + effect
    return more, options.keeping(more.names[len(model) :])


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
        worth=None if left is None else mean_over_rows(left - errors)[0],
    )
