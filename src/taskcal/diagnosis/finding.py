"""One mistake that was found."""

from dataclasses import dataclass
from typing import Any

IDS = (
    "too-few-rows", "points-in-metres", "points-in-other-unit", "joints-in-radians", "joint-sign", "joint-zero", "coupling",
    "joint-order", "dh-convention", "left-handed", "quaternion-order", "inverse-poses", "rows-shuffled", "rows-shifted",
    "target-swapped", "target-slipped", "station-moved", "drift", "duplicate-poses", "gross-rows", "other-robot",
    "small-workspace", "few-orientations",
)  # fmt: skip
"""All mistakes that are looked for."""


@dataclass(frozen=True, kw_only=True)
class Finding:
    """A mistake, what it concerns, and what mends it."""

    id: str
    """One of `IDS`."""
    subject: tuple[str, ...]
    """The joints, targets, rows (by their id) or robots."""
    error_before: float | None
    """Median distance between measured points and the registered robot as given, metres; of what happened in the course of the
    campaign the root mean square, the geometry free within its tolerances. None where there are too few rows."""
    error_after: float | None
    """The same without the mistake, and those found with it; None where nothing that was tried lowers it."""
    confidence: float
    """0 to 1; see `diagnose`."""
    fix: str
    """One line that mends it."""

    def as_json(self) -> dict[str, Any]:
        """As ``taskcal doctor --json`` gives it."""
        return {
            "id": self.id,
            "subject": list(self.subject),
            "error_before_mm": None if self.error_before is None else self.error_before * 1e3,
            "error_after_mm": None if self.error_after is None else self.error_after * 1e3,
            "confidence": self.confidence,
            "fix": self.fix,
        }
