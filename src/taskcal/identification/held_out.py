"""What a fit predicted of rows that it had not seen."""

from dataclasses import dataclass
from typing import Any, Literal, get_args

import numpy as np
from jaxtyping import Float, Int

from taskcal.identification.prediction_errors import Validation
from taskcal.measurement.observation import Observation
from taskcal.short_repr import short_repr

Grouping = Literal["neighbours", "blocks", "rows"]
"""What is held out together: neighbouring poses, rows that follow each other, or nothing but the row itself."""

GROUPINGS: tuple[Grouping, ...] = get_args(Grouping)


@short_repr
@dataclass(frozen=True, eq=False, kw_only=True)
class HeldOut:
    """Errors of rows that were not fitted, in parts."""

    by: Grouping | Literal["chosen"]
    """How the parts were made; ``chosen`` where the user named the rows to fit."""
    folds: int
    """Fits that each left a part out, beside the calibration, which knows all rows; 0 where the calibration itself has not
    seen the rows."""
    rows: Int[np.ndarray, " n"]
    """Rows of the whole campaign, counted from 0."""
    part: Int[np.ndarray, " n"]
    """Which part each row belongs to, counted from 0: its fold, or its group of neighbours or block."""
    residuals: Float[np.ndarray, "n targets b"]
    """Measured less predicted in the axes of the robot's base, metres (then radians, for poses); NaN for lost beams."""
    nominal: Float[np.ndarray, "n targets b"]
    """The same of the nominal robot, with tracker frame and targets found from the rows that were fitted."""
    kinds: tuple[type[Observation], ...] = ()
    """Of observation of each target; none where a tracker measured all."""

    def __len__(self) -> int:
        return len(self.rows)

    @property
    def validation(self) -> Validation:
        """The errors of all rows."""
        return Validation.of_residuals(self.residuals, np.eye(3), self.kinds)

    @property
    def nominal_validation(self) -> Validation:
        """The errors of all rows that the nominal robot leaves."""
        return Validation.of_residuals(self.nominal, np.eye(3), self.kinds)

    @property
    def part_means(self) -> Float[np.ndarray, " parts"]:
        """Mean error in space of every part in which anything was seen, metres."""
        sums, counts = self._by_part()
        return (sums / np.maximum(counts, 1))[counts > 0]

    @property
    def standard_error(self) -> float:
        """Of the mean error over all rows, from how much the parts differ, metres; NaN with a single part."""
        sums, counts = self._by_part()
        parts, total = int((counts > 0).sum()), counts.sum()
        if parts < 2:
            return float("nan")
        own = sums - counts * sums.sum() / total
        return float(np.sqrt((own**2).sum() * parts / (parts - 1)) / total)

    def _by_part(self) -> tuple[Float[np.ndarray, " parts"], Int[np.ndarray, " parts"]]:
        """Sum of the errors and number of points of every part."""
        length = np.linalg.norm(self.residuals[..., :3], axis=2)
        seen = np.isfinite(length)
        sums = np.bincount(self.part, weights=np.where(seen, length, 0.0).sum(axis=1))
        return sums, np.bincount(self.part, weights=seen.sum(axis=1)).astype(int)

    def summary(self) -> dict[str, Any]:
        """How the rows were held out, and how much the parts differ, in millimetres."""
        means = self.part_means * 1e3
        return {
            "by": self.by,
            "folds": self.folds,
            "parts": len(means),
            "least_mm": float(means.min()),
            "largest_mm": float(means.max()),
            "standard_error_mm": self.standard_error * 1e3,
            "part_means_mm": means.tolist(),
        }
