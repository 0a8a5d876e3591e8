"""What geometry cannot explain: effects and a residual field, each only where the data prove it.

Every candidate effect competes by the logarithm of its marginal likelihood, which counts what its parameters cost; the best
one enters if its gain exceeds what the best of so many worthless candidates would show by chance, and the search goes on.
Cross-validation on rows that were not fitted tells in millimetres what each step was worth.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from taskcal.estimation.blas import single_threaded
from taskcal.geometry import se3
from taskcal.identification.calibration import Calibration
from taskcal.identification.field import learn_field
from taskcal.identification.identify import identify
from taskcal.measurement.campaign import Campaign
from taskcal.robot.effects import Compliance, Effect, EncoderGain, Harmonics
from taskcal.robot.error_model import ErrorModel

PERIODIC = Harmonics(orders=tuple(range(3, 31)), tolerance=2e-5)
"""Errors of gears and encoders that recur several times in a turn; each is small, the right ones are not known before."""

CANDIDATES: tuple[Effect, ...] = (
    EncoderGain(),
    Harmonics(orders=(1,)),
    Harmonics(orders=(2,)),
    Compliance(),
    PERIODIC,
)

PROOF = 5.0
"""Gain of log evidence that an effect must show beyond the logarithm of the number of candidates: odds of 150 to 1."""

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


@dataclass(frozen=True, eq=False, kw_only=True)
class Explanation:
    """A calibration with the effects and the field that the data prove, and the proof."""

    calibration: Calibration
    effects: tuple[Effect, ...]
    stages: tuple[Stage, ...]
    tracker: float
    """What the tracker's noise alone would leave, metres in space."""

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
    candidates: Sequence[Effect] = CANDIDATES,
    folds: int = 5,
    seed: int = 0,
    progress: Callable[[str], None] = lambda _: None,
    **options: Any,
) -> Explanation:
    """Identify geometry, then the effects that the data prove, then a residual field if it proves itself.

    Args:
        model: the geometric model, possibly with effects that are certain.
        campaign: the measurements.
        effects: those to add without proof; by default the candidates are tried.
        field: try a residual field.
        candidates: effects that compete.
        folds: of the cross-validation.
        seed: of its folds.
        progress: told what is being done.
        **options: of `identify`.

    Raises:
        CampaignError: too few rows.
        FitError: a fit did not converge.
    """
    parts = _folds(campaign.q, folds, seed)
    progress("geometry")
    best = identify(model, campaign, **options)
    left = _left_out(model, campaign, parts, options)
    stages = [_stage("geometry", best, None, left, None, accepted=True)]
    added: list[Effect] = []
    if effects is not None:
        for effect in effects:
            model = model + effect
            added.append(effect)
        if added:
            trial, errors = identify(model, campaign, **options), _left_out(model, campaign, parts, options)
            stages.append(_stage(", ".join(map(_label, added)), trial, best, errors, left, accepted=True))
            best, left = trial, errors
    else:
        best, left, model, added, tried = _search(
            model, campaign, list(candidates), parts, best, left, options, progress
        )
        stages += tried
    if field:
        progress("residual field")
        trial = with_field(best, campaign, seed)
        errors = _left_out(model, campaign, parts, options, field=True, seed=seed)
        gain, error = _paired(left, errors)
        accepted = bool(gain > SIGNIFICANT * error)
        stages.append(
            replace(_stage("residual field", trial, None, errors, left, accepted=accepted), log_evidence=None)
        )
        best = trial if accepted else best
    noise = campaign.covariances(options.get("noise"))[campaign.valid][:, :3, :3]
    # mean length of an isotropic normal vector: √(8/π) standard deviations
    tracker = float(np.sqrt(8.0 / np.pi) * np.sqrt(np.trace(noise, axis1=1, axis2=2).mean() / 3.0))
    return Explanation(calibration=best, effects=tuple(added), stages=tuple(stages), tracker=tracker)


def with_field(calibration: Calibration, campaign: Campaign, seed: int = 0) -> Calibration:
    """The calibration with a field learned from its residuals on a campaign.

    Raises:
        CampaignError: too few rows.
    """
    seen = campaign.valid.any(axis=1)
    R = calibration.T_tracker_base[:3, :3]
    ends = calibration.predict_tool(campaign.q)[:, None] @ calibration.T_tool_target
    position = np.nanmean((campaign.points - ends[..., :3, 3])[seen], axis=1) @ R
    residual = position
    if campaign.rotations is not None:
        turn = se3.log(campaign.rotations[seen] @ np.swapaxes(ends[seen, 0, :3, :3], 1, 2)) @ R
        residual = np.concatenate([position, turn], axis=1)
    return replace(calibration, field=learn_field(campaign.q[seen], residual, seed))


def _search(
    model: ErrorModel,
    campaign: Campaign,
    candidates: list[Effect],
    parts: list[Int[np.ndarray, " _"]],
    best: Calibration,
    left: Float[np.ndarray, " rows"],
    options: dict[str, Any],
    progress: Callable[[str], None],
) -> tuple[Calibration, Float[np.ndarray, " rows"], ErrorModel, list[Effect], list[Stage]]:
    """Forward selection by log evidence."""
    added: list[Effect] = []
    stages: list[Stage] = []
    threshold = PROOF + np.log(len(candidates))
    while candidates:
        progress(f"effects: {len(candidates)} candidates")
        trials = [identify(model + effect, campaign, **options) for effect in candidates]
        gains = [(t.log_evidence or -np.inf) - (best.log_evidence or -np.inf) for t in trials]
        k = int(np.argmax(gains))
        effect = candidates.pop(k)
        errors = _left_out(model + effect, campaign, parts, options)
        gain, error = _paired(left, errors)
        # likelier, and not visibly worse where it was not fitted
        accepted = bool(gains[k] > threshold and gain > -SIGNIFICANT * error)
        stages.append(_stage(_label(effect), trials[k], best, errors, left, accepted=accepted))
        if not accepted:
            break
        model, best, left = model + effect, trials[k], errors
        added.append(effect)
    return best, left, model, added, stages


def _label(effect: Effect) -> str:
    named = {"EncoderGain": "encoder gain", "Harmonics": "gear harmonics", "Compliance": "compliance"}
    label = named.get(type(effect).__name__, type(effect).__name__)
    if isinstance(effect, Harmonics):
        first, last = effect.orders[0], effect.orders[-1]
        label += f" of order {first}" if first == last else f" of orders {first} to {last}"
    return label if effect.joints is None else f"{label} of {', '.join(effect.joints)}"


def _folds(q: Float[np.ndarray, "n joints"], folds: int, seed: int) -> list[Int[np.ndarray, " _"]]:
    """Rows of each fold; neighbours in the joints, down to the same pose measured again, stay together."""
    rounded = np.round(q / np.radians(0.5)).astype(int)
    _, group = np.unique(rounded, axis=0, return_inverse=True)
    order = np.random.default_rng(seed).permutation(group.max() + 1)
    return [np.flatnonzero(np.isin(group, order[i::folds])) for i in range(folds)]


def _left_out(
    model: ErrorModel,
    campaign: Campaign,
    parts: list[Int[np.ndarray, " _"]],
    options: dict[str, Any],
    *,
    field: bool = False,
    seed: int = 0,
) -> Float[np.ndarray, " rows"]:
    """Error in space of every point when its fold is left out, metres, in the order of the campaign."""
    out = np.full(campaign.valid.shape, np.nan)
    for part in parts:
        rest = campaign.take(np.setdiff1d(np.arange(len(campaign)), part))
        fitted = identify(model, rest, **options)
        if field:
            fitted = with_field(fitted, rest, seed)
        held = campaign.take(part)
        ends = fitted.predict_tool(held.q)[:, None] @ fitted.T_tool_target
        out[part] = np.linalg.norm(held.points - ends[..., :3, 3], axis=2)
    return out[campaign.valid]


def _paired(before: Float[np.ndarray, " rows"], after: Float[np.ndarray, " rows"]) -> tuple[float, float]:
    """Mean decrease of the error, and its standard error over the points."""
    difference = before - after
    return float(difference.mean()), float(difference.std(ddof=1) / np.sqrt(len(difference)))


def _stage(
    name: str,
    calibration: Calibration,
    before: Calibration | None,
    errors: Float[np.ndarray, " rows"],
    left: Float[np.ndarray, " rows"] | None,
    *,
    accepted: bool,
) -> Stage:
    gain = None
    if before is not None and before.log_evidence is not None and calibration.log_evidence is not None:
        gain = calibration.log_evidence - before.log_evidence
    spread = errors.std(ddof=1) / np.sqrt(len(errors)) if left is None else _paired(left, errors)[1]
    return Stage(
        name=name,
        parameters=len(calibration.kept),
        log_evidence=gain,
        cross_validated=float(errors.mean()),
        standard_error=float(spread),
        accepted=accepted,
    )
