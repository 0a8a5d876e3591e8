"""Which effects may be added to the geometry, and how they are put to the proof."""

from collections.abc import Sequence
from dataclasses import dataclass

from taskcal.identification.fit_options import FitChoices
from taskcal.measurement.campaign import Campaign
from taskcal.robot.effects import Effect, JointField, kinds
from taskcal.robot.effects import candidates as default_candidates
from taskcal.robot.error_model import ErrorModel
from taskcal.short_repr import short_repr


@short_repr
@dataclass(frozen=True, kw_only=True)
class EffectSearch:
    """What may be added to the geometry, and how it is put to the proof."""

    effects: Sequence[Effect] | None = None
    """Those to add without proof; None to try the candidates."""
    candidates: Sequence[Effect] | None = None
    """Effects that compete; None for what every effect that is defined proposes for the robot (`Effect.candidates`)."""
    field: bool = False
    """Let the smooth field of all joints (`JointField`) take part, too."""
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
            "all effects": f"{robot.name} has joints that others drive ({robot.driven[0].name}), and how effects pass through "
            "their linkage is not modelled"
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
