"""What a selection of effects found: a calibration with what the data prove, and the proof, step by step."""

from dataclasses import dataclass
from typing import Any

from taskcal.analysis.collinearity import Collinearity
from taskcal.arguments import warn_renamed
from taskcal.errors import shortened
from taskcal.identification.calibration import Calibration
from taskcal.robot.effects import Effect


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
    collinearities: tuple[Collinearity, ...]
    """Parameters of effects that geometry nearly repeats at the fitted poses, the most repeated first."""

    def __repr__(self) -> str:
        taken = ", ".join(stage.name for stage in self.stages if stage.accepted)
        return f"Explanation({shortened(taken, 150)}: {self.calibration!r})"

    @property
    def alike(self) -> tuple[Collinearity, ...]:
        """Former name of `collinearities`."""
        warn_renamed("Explanation.alike", "collinearities", stacklevel=2)
        return self.collinearities

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
