"""Which effects may be added to the geometry, and how they are put to the proof."""

from collections.abc import Sequence
from dataclasses import dataclass

from taskcal.identification.fit_options import FitChoices
from taskcal.robot.effects import Effect
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
