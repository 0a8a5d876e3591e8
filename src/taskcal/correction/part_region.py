"""Where a part may be put: a grid of shifts and turns from where it stands."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from taskcal.errors import TaskcalError
from taskcal.short_repr import short_repr

MOST_PLACEMENTS = 5000


@short_repr
@dataclass(frozen=True, eq=False, kw_only=True)
class Region:
    """How far a part may be moved from where it stands.

    Raises:
        TaskcalError: a bound is not a number or above the other one, or the grid has no or too many placements.
    """

    low: Float[np.ndarray, " 3"]
    """Along the axes of the robot's base, metres."""
    high: Float[np.ndarray, " 3"]
    turn: tuple[float, float] = (0.0, 0.0)
    """About the vertical through the middle of the targets, radians."""
    steps: tuple[int, int] = (5, 3)
    """Placements along each axis along which it may be moved, and turns, where it may be turned."""

    def __post_init__(self) -> None:
        for low, high in (*zip(self.low, self.high, strict=True), self.turn):
            if not (np.isfinite(low) and np.isfinite(high) and low <= high):
                raise TaskcalError(f"a region goes from {low:g} to {high:g}; give the smaller number first")
        if min(self.steps) < 1:
            raise TaskcalError(f"a region has {self.steps[0]} steps and {self.steps[1]} turns; give 1 or more of each")
        if len(self.grid()) > MOST_PLACEMENTS:
            raise TaskcalError(
                f"a region has {len(self.grid())} placements; give fewer steps, for {MOST_PLACEMENTS} at most"
            )

    def grid(self) -> Float[np.ndarray, "n 4"]:
        """Shifts and turns, metres and radians."""
        bounds = [*zip(self.low, self.high, strict=True), self.turn]
        counts = [self.steps[0]] * 3 + [self.steps[1]]
        axes = [np.linspace(a, b, n if b > a else 1) for (a, b), n in zip(bounds, counts, strict=True)]
        return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 4)
