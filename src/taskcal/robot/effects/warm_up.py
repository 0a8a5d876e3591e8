"""A robot that warms up at work."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from jaxtyping import Float

from taskcal.errors import TaskcalError
from taskcal.robot.conditions import Conditions
from taskcal.robot.effects.thermal_expansion import ThermalExpansion
from taskcal.robot.robot import Robot

MIN_DURATION_S = 600.0
"""Between the first and the last row, seconds, from which on warming up competes."""

TIME_CONSTANTS_S = 1200.0, 3600.0, 10800.0
"""That compete, seconds: drives take minutes, castings hours."""

_MINUTES = re.compile(r"warmup:([1-9]\d{0,3})$")


@dataclass(frozen=True, kw_only=True)
class WarmUp(ThermalExpansion):
    """Lengths that grow, and a base that moves, as 1 − exp(−t/τ) with the time at work; for where no temperature is known.

    All lengths between the axes grow in one proportion; or, if joints are named, those behind each of them in a proportion
    of their own, and the others do not. Without a time, a pose is taken for one at the reference, where all its parameters
    are without effect.
    """

    key = "warmup"
    label = "warming up"
    needs = ("time",)

    tolerance: float = 2.4e-4
    """Expansion of a cold robot until it is warm (1σ): aluminium that warms by 10 K."""
    time_constant: float = 3600.0
    """τ, seconds."""
    reference: float | None = None
    """Time at which the other parameters of the model hold, seconds; by default when the robot is warm."""
    spread: float = 0.3
    """Standard deviation of how much colder than at the reference poses are that tell no time, as a share of the whole way."""
    per: ClassVar[str] = ""
    least: ClassVar[float] = MIN_DURATION_S

    @classmethod
    def candidates(cls, robot: Robot, conditions: Conditions) -> "Sequence[WarmUp]":
        """Several time constants that refer to the end of the campaign, where it took long enough."""
        if not cls().is_told(conditions):
            return []
        return [cls(time_constant=constant).referred(conditions) for constant in TIME_CONSTANTS_S]

    @classmethod
    def ways_to_write(cls) -> Mapping[str, str]:
        """With or without minutes."""
        growing = "lengths that grow, and a base that drifts, while the robot warms up"
        return {"warmup": f"{growing} in an hour", "warmup:20": f"{growing} in so many minutes"}

    @classmethod
    def parse(cls, text: str) -> "WarmUp | None":
        """``warmup``, or with its time constant in minutes, ``warmup:20``."""
        minutes = _MINUTES.match(text)
        if minutes is not None:
            return cls(time_constant=60.0 * int(minutes[1]))
        return cls() if text == cls.key else None

    @property
    def details(self) -> str:
        """Its time constant."""
        return f" in {self.time_constant / 60.0:g} min"

    def referred(self, conditions: Conditions) -> "WarmUp":
        """The effect with the end of the campaign as its reference, when the robot was warmest, and untold times as the campaign's.

        Raises:
            TaskcalError: there are no times.
        """
        if conditions.time is None:
            raise TaskcalError("the end of a campaign without times cannot be a reference; give Conditions a time")
        at_end = replace(self, reference=float(np.nanmax(conditions.time)))
        rise = at_end.rise(conditions)
        return at_end if rise is None else replace(at_end, spread=round(float(np.sqrt(np.nanmean(rise**2))), 3))

    def off_reference(self, count: int) -> Conditions:
        """Poses that are colder by `spread`, or as cold as the robot ever is."""
        left = 0.0 if self.reference is None else np.exp(-self.reference / self.time_constant)
        return Conditions(time=np.full(count, -self.time_constant * np.log(min(left + self.spread, 1.0))))

    def rise(self, conditions: Conditions) -> Float[np.ndarray, " n"] | None:
        """How much warmer than at the reference, as a share of the whole way."""
        if conditions.time is None:
            return None
        left = 0.0 if self.reference is None else np.exp(-self.reference / self.time_constant)
        return left - np.exp(-conditions.time / self.time_constant)
