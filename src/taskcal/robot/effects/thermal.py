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
    per: ClassVar[str] = "/K"
    least: ClassVar[float] = MIN_WARMING_K

    @classmethod
    def candidates(cls, robot: Robot, conditions: Conditions) -> "Sequence[Thermal]":
        """One that refers to the mean temperature, where temperatures differ."""
        return [cls().referred(conditions)] if cls().is_told(conditions) else []

    def referred(self, conditions: Conditions) -> "Thermal":
        """The effect with the mean temperature as its reference."""
        return replace(self, reference=conditions.mean_temperature)

    def rise(self, conditions: Conditions) -> Float[np.ndarray, " n"] | None:
        """Kelvins above the reference."""
        return None if conditions.temperature is None else conditions.temperature - self.reference
