"""What a selection of effects found: a calibration with what the data prove, and the proof, step by step."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from taskcal.analysis.collinearity import Collinearity
from taskcal.arguments import warn_renamed
from taskcal.errors import shortened
from taskcal.identification.calibration import Calibration
from taskcal.public_names import FormerName
from taskcal.robot.effects import Effect


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
    """A calibration with the effects and the field that the data prove, and the proof."""

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
        """What each effect is worth among all others that were fitted with it, the most first."""
        return tuple(stage for stage in self.stages if stage.among_others)

    def __repr__(self) -> str:
        taken = ", ".join(stage.name for stage in self.stages if stage.accepted)
        return f"Explanation({shortened(taken, 150)}: {self.calibration!r})"

    @property
    def alike(self) -> tuple[Collinearity, ...]:
        """Former name of `collinearities`."""
        warn_renamed("Explanation.alike", "collinearities", stacklevel=2)
        return self.collinearities

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

    to_json = FormerName("summary")
