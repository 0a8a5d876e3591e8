"""A robot that grows, and a base that drifts, with the temperature."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from jaxtyping import Float

from taskcal.robot.conditions import Conditions
from taskcal.robot.effects.thermal_expansion import ThermalExpansion
from taskcal.robot.robot import Robot

ALUMINIUM_EXPANSION = 2.4e-5
"""Expansion coefficient of aluminium, per kelvin; steel and cast iron have half of it."""

MIN_WARMING_K = 1.0
"""Between the coldest and the warmest row, kelvin, from which on an effect of the temperature competes: a metre grows by a
hundredth of a millimetre."""


@dataclass(frozen=True, kw_only=True)
class Thermal(ThermalExpansion):
    """Lengths that grow with the temperature, and a base that moves against the tracker with it.

    All lengths between the axes grow in one proportion; or, if joints are named, those behind each of them in a proportion
    of their own, and the others do not. Without temperatures, a pose is taken for one at the reference temperature, where
    all its parameters are without effect.
    """

    key = "thermal"
    label = "thermal expansion"
    summary = "lengths that grow, and a base that drifts, with the temperature"
    needs = ("temperature",)

    tolerance: float = ALUMINIUM_EXPANSION
    """Expansion per kelvin (1σ); what carries the base moves and tilts as one of 1 m height that grows so on one side."""
    reference: float = 20.0
    """Temperature at which the other parameters of the model hold, °C."""
    spread: float = 3.0
    """Standard deviation about the reference of temperatures that are not told, kelvin: a hall, over a week."""
    per: ClassVar[str] = "/K"
    least: ClassVar[float] = MIN_WARMING_K

    @classmethod
    def candidates(cls, robot: Robot, conditions: Conditions) -> "Sequence[Thermal]":
        """One that refers to the mean temperature, where temperatures differ."""
        return [cls().referred(conditions)] if cls().is_told(conditions) else []

    def referred(self, conditions: Conditions) -> "Thermal":
        """The effect with the mean temperature as its reference, and temperatures that are not told spread as those are."""
        reference = conditions.mean_temperature
        if conditions.temperature is None:
            return replace(self, reference=reference)
        spread = float(np.sqrt(np.nanmean((conditions.temperature - reference) ** 2)))
        return replace(self, reference=reference, spread=round(spread, 2))

    def off_reference(self, count: int) -> Conditions:
        """Poses that are warmer by `spread`."""
        return Conditions(temperature=np.full(count, self.reference + self.spread))

    def rise(self, conditions: Conditions) -> Float[np.ndarray, " n"] | None:
        """Kelvins above the reference."""
        return None if conditions.temperature is None else conditions.temperature - self.reference
