"""External axes of a cell: what they carry, and where that is at their positions."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float

from taskcal.geometry import se3
from taskcal.short_repr import short_repr

Carries = Literal["nothing", "robot", "part"]

AXES = 6
"""External axes of a target, in RAPID (eax_a … eax_f) as in KRL (E1 … E6)."""


@short_repr
@dataclass(frozen=True, eq=False, kw_only=True)
class ExternalAxis:
    """One external axis, as the controller counts it."""

    number: int
    """1 for eax_a and E1."""
    carries: Carries
    turns: bool = False
    """It turns, and its positions are degrees; otherwise it slides, and they are millimetres."""
    direction: Float[np.ndarray, " 3"] | None = None
    """In which it slides, or about which it turns, of unit length in its frame; None of an axis that carries nothing."""
    T_frame: Float[np.ndarray, "4 4"] | None = None
    """Where its frame is with all axes at zero: in the world, or in what the axis before it carries; None for the same place."""
    unit: str = ""
    """Name of its mechanical unit, by which RAPID's work objects call it; empty for whichever they name."""

    @property
    def name(self) -> str:
        """As both languages call it."""
        return f"external axis {self.number} (eax_{'abcdef'[self.number - 1]}, E{self.number})"

    def motion(self, position: float) -> Float[np.ndarray, "4 4"]:
        """What it carries at a position, against where that is at zero, in its frame."""
        if self.direction is None:
            return np.eye(4)
        if self.turns:
            return se3.pose(se3.exp(self.direction * np.radians(position)), np.zeros(3))
        return se3.pose(np.eye(3), self.direction * position * 1e-3)


def carried_robot(axes: Sequence[ExternalAxis], positions: Float[np.ndarray, " axes"]) -> Float[np.ndarray, "4 4"]:
    """Motion of the robot's base in the world, against where it stands with all axes at zero."""
    T, frame = np.eye(4), np.eye(4)
    for axis in axes:
        frame = frame if axis.T_frame is None else frame @ axis.T_frame
        T = T @ frame @ axis.motion(float(positions[axis.number - 1])) @ se3.inverse(frame)
    return T


def carried_part(axes: Sequence[ExternalAxis], positions: Float[np.ndarray, " axes"]) -> Float[np.ndarray, "4 4"]:
    """Pose in the world of what axes that carry each other, in this order, carry."""
    T = np.eye(4)
    for axis in axes:
        T = (T if axis.T_frame is None else T @ axis.T_frame) @ axis.motion(float(positions[axis.number - 1]))
    return T
