"""How poses were reached: what their joint positions do not tell."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int


@dataclass(frozen=True, eq=False, kw_only=True)
class Conditions:
    """What is known of the way to each pose."""

    approach: Float[np.ndarray, "n joints"] | None = None
    """Way in which each joint's drive turned last: 1 where the joint's value grew, −1 where it fell, 0 where unknown."""
    move: Float[np.ndarray, "n joints"] | None = None
    """How far each joint's drive turned on the last way to the pose, radians (metres where it slides); 0 where unknown."""

    def take(self, rows: Int[np.ndarray, " k"] | slice) -> "Conditions":
        """The conditions of some of the poses."""
        return Conditions(
            approach=None if self.approach is None else self.approach[rows],
            move=None if self.move is None else self.move[rows],
        )
