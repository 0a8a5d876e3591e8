"""How a pose was reached and how warm the robot was: what its joint positions do not tell."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int


@dataclass(frozen=True, eq=False, kw_only=True)
class Conditions:
    """What is known of each pose beside its joint positions."""

    approach: Float[np.ndarray, "n joints"] | None = None
    """Way in which each joint's drive turned last: 1 where the joint's value grew, −1 where it fell, 0 where unknown."""
    temperature: Float[np.ndarray, " n"] | None = None
    """Degrees Celsius; NaN where unknown."""

    def take(self, rows: Int[np.ndarray, " k"] | slice) -> "Conditions":
        """The conditions of some of the poses."""
        return Conditions(
            approach=None if self.approach is None else self.approach[rows],
            temperature=None if self.temperature is None else self.temperature[rows],
        )
