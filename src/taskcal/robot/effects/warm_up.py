"""A robot that warms up at work."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from jaxtyping import Float

from taskcal.robot.conditions import Conditions
from taskcal.robot.effects.growth import Growth


@dataclass(frozen=True, kw_only=True)
class WarmUp(Growth):
    """Lengths that grow, and a base that moves, as 1 − exp(−t/τ) with the time at work; for where no temperature is known.

    All lengths between the axes grow in one proportion; or, if joints are named, those behind each of them in a proportion
    of their own, and the others do not. Without a time, a pose is taken for one at the reference, where all its parameters
    are without effect.
    """

    tolerance: float = 2.4e-4
    """Growth of a cold robot until it is warm (1σ): aluminium that warms by 10 K."""
    time_constant: float = 3600.0
    """τ, seconds."""
    reference: float | None = None
    """Time at which the other parameters of the model hold, seconds; by default when the robot is warm."""
    per: ClassVar[str] = ""

    def rise(self, conditions: Conditions) -> Float[np.ndarray, " n"] | None:
        """How much warmer than at the reference, as a share of the whole way."""
        if conditions.time is None:
            return None
        left = 0.0 if self.reference is None else np.exp(-self.reference / self.time_constant)
        return left - np.exp(-conditions.time / self.time_constant)
