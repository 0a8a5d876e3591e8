"""Under what conditions poses were reached: what their joint positions do not tell."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from taskcal.errors import TaskcalError
from taskcal.short_repr import short_repr


@short_repr
@dataclass(frozen=True, eq=False, kw_only=True)
class Conditions:
    """What is known of the way to each pose, and of how warm the robot was there."""

    approach: Float[np.ndarray, "n joints"] | None = None
    """Way in which each joint's drive turned last: 1 where the joint's value grew, −1 where it fell, 0 where unknown."""
    move: Float[np.ndarray, "n joints"] | None = None
    """How far each joint's drive turned on the last way to the pose, radians (metres where it slides); 0 where unknown."""
    temperature: Float[np.ndarray, " n"] | None = None
    """Of the robot, °C; NaN where unknown, which counts as the reference of a `Thermal` effect."""
    time: Float[np.ndarray, " n"] | None = None
    """Since the robot began to work, seconds; NaN where unknown, which counts as the reference of a `WarmUp` effect."""

    def __post_init__(self) -> None:
        for name, array in (("approach", self.approach), ("move", self.move)):
            if array is not None and not np.isfinite(array).all():
                row = int(np.flatnonzero(~np.isfinite(array).all(axis=1))[0])
                raise TaskcalError(f"{name} of pose {row} is not a number; give 0 where the way to it is not known")

    @property
    def mean_temperature(self) -> float:
        """Mean over the poses whose temperature is known, to a tenth of a degree, °C.

        Raises:
            TaskcalError: none is.
        """
        if self.temperature is None or not np.isfinite(self.temperature).any():
            raise TaskcalError("no pose has a temperature, so that there is no mean of them")
        return round(float(np.nanmean(self.temperature)), 1)

    def take(self, rows: Int[np.ndarray, " k"] | slice) -> "Conditions":
        """The conditions of some of the poses."""
        return Conditions(
            approach=None if self.approach is None else self.approach[rows],
            move=None if self.move is None else self.move[rows],
            temperature=None if self.temperature is None else self.temperature[rows],
            time=None if self.time is None else self.time[rows],
        )
