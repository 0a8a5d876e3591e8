"""A robot that grows, and a base that drifts, with the temperature."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from jaxtyping import Float

from taskcal.robot.conditions import Conditions
from taskcal.robot.effects.growth import Growth

EXPANSION = 2.4e-5
"""Expansion coefficient of aluminium, per kelvin; steel and cast iron have half of it."""


@dataclass(frozen=True, kw_only=True)
class Thermal(Growth):
    """Lengths that grow with the temperature, and a base that moves against the tracker with it.

    All lengths between the axes grow in one proportion; or, if joints are named, those behind each of them in a proportion
    of their own, and the others do not. Without temperatures, a pose is taken for one at the reference temperature, where
    all its parameters are without effect.
    """

    tolerance: float = EXPANSION
    """Growth per kelvin (1σ); what carries the base moves and tilts as one of 1 m height that grows so on one side."""
    reference: float = 20.0
    """Temperature at which the other parameters of the model hold, °C."""
    per: ClassVar[str] = "/K"

    def rise(self, conditions: Conditions) -> Float[np.ndarray, " n"] | None:
        """Kelvins above the reference."""
        return None if conditions.temperature is None else conditions.temperature - self.reference
