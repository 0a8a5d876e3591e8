"""The error to be expected along a corrected program, and what it comes from."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from taskcal.identification.uncertainty_budget import UNEXPLAINED, Evaluation, UncertaintyBudget, budget_of_parts

SOURCES = ("geometry", "model error", "tool", "part")

_REMEDIES = {
    "geometry": "the geometry is known too badly where the program works: measure more poses there (taskcal plan --calibration)",
    "model error": "it is what the model cannot explain: accept it, or identify with effects where that was not done "
    "(--effects auto)",
    "tool": "measure the tool against the reflectors, and state it in a cell file (--cell: reflectors_mm or flange)",
    "part": "measure the part with the tracker, or touch it with the robot, and state it in a cell file (--cell: tracker or "
    "touched_deg)",
}


@dataclass(frozen=True, eq=False, kw_only=True)
class ErrorBudget:
    """Mean squares over the targets of a program, in space, metres²."""

    correction: float
    """Of the error that is predicted for the program as it was given."""
    left: float
    """Of the error that is predicted for the corrected program."""
    variances: Mapping[str, float]
    """Of what the calibration must expect beyond its prediction, by `SOURCES`."""

    @property
    def uncertainty(self) -> float:
        """What the calibration must expect beyond its prediction, rms in space, metres."""
        return float(np.sqrt(sum(self.variances.values())))

    @property
    def before(self) -> float:
        """Error to be expected of the program as it was given, rms in space, metres."""
        return float(np.sqrt(self.correction + self.uncertainty**2))

    @property
    def after(self) -> float:
        """Error to be expected of the corrected program, rms in space, metres."""
        return float(np.sqrt(self.left + self.uncertainty**2))

    @property
    def uncertain(self) -> bool:
        """Whether the uncertainty is larger than the correction, so that nobody can tell if it makes the program better."""
        return bool(self.uncertainty > np.sqrt(self.correction))

    @property
    def shares(self) -> dict[str, float]:
        """What part of the variance each source has."""
        total = sum(self.variances.values())
        return {name: value / total if total else 0.0 for name, value in self.variances.items()}

    @property
    def remedy(self) -> str:
        """What would lower the largest share."""
        return _REMEDIES[max(self.variances, key=lambda name: self.variances[name])]

    def of_targets(self, model_error: Evaluation) -> UncertaintyBudget:
        """How far the tool may be from a corrected target, one line for each source (JCGM 100:2008, GUM).

        Args:
            model_error: whether what the model cannot explain was estimated (A) or given (B).
        """
        return budget_of_parts(
            [
                ("parameters and tracker frame, as the data tell them", "A", self.variances["geometry"]),
                (UNEXPLAINED, model_error, self.variances["model error"]),
                ("where the tool is on the flange", "B", self.variances["tool"]),
                ("where the part is", "B", self.variances["part"]),
                (
                    "what is left of the predicted error: digits of the numbers, motions that stay as they are",
                    "B",
                    self.left,
                ),
            ]
        )

    def summary(self) -> dict[str, object]:
        """In millimetres."""
        return {
            "before_mm": self.before * 1e3,
            "after_mm": self.after * 1e3,
            "correction_mm": float(np.sqrt(self.correction)) * 1e3,
            "uncertainty_mm": self.uncertainty * 1e3,
            "shares": self.shares,
        }


def budget_of(
    before: Float[np.ndarray, " b"], after: Float[np.ndarray, " a"], variances: Float[np.ndarray, "m sources"]
) -> ErrorBudget:
    """The budget over a program.

    Args:
        before: lengths of the predicted errors at its targets, metres.
        after: the same, corrected.
        variances: by source at every target, metres²; NaN where it is not known.
    """
    known = variances[np.isfinite(variances).all(axis=1)]
    means = known.mean(axis=0) if len(known) else np.zeros(len(SOURCES))
    return ErrorBudget(
        correction=float(np.mean(before**2)) if len(before) else 0.0,
        left=float(np.mean(after**2)) if len(after) else 0.0,
        variances=dict(zip(SOURCES, means.tolist(), strict=True)),
    )
