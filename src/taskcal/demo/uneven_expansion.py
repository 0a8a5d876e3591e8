"""A robot whose links warm up each in its own time and by its own share."""

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from jaxtyping import Float

from taskcal.robot.conditions import Conditions
from taskcal.robot.effects.effect import Quantity
from taskcal.robot.effects.linear_term import LinearTerm
from taskcal.robot.effects.thermal_expansion import DRIFT, ThermalExpansion
from taskcal.robot.robot import Robot


@dataclass(frozen=True, kw_only=True)
class UnevenExpansion(ThermalExpansion, abstract=True):
    """Each named joint's length grows towards its own end, in its own time; the stand under the base is the slowest.

    For virtual robots only: it is not registered, so that no fit ever tries it.
    """

    tolerance: float = 8e-5
    """Expansion of every length until it is warm (1σ), metres per metre; the stand moves and tilts as much per metre."""
    time_constants: tuple[float, ...]
    """Of the stand, then of each named joint's length, seconds."""
    needs: ClassVar[tuple[Quantity, ...]] = ("time",)
    per: ClassVar[str] = ""
    least: ClassVar[float] = 0.0

    def term(self, robot: Robot) -> LinearTerm:
        """Parameters of `ThermalExpansion`, each with its own course."""
        term = super().term(robot)
        gain = (
            term.given(np.zeros((1, len(robot.joints))), Conditions(time=np.array([np.inf])))[0] if term.given else 0.0
        )
        constants = np.array([*[self.time_constants[0]] * len(DRIFT), *self.time_constants[1:]])

        def given(q: Float[np.ndarray, "n joints"], conditions: Conditions) -> Float[np.ndarray, "n pairs"]:
            if conditions.time is None:
                return term.basis(q)
            return gain * (1.0 - np.exp(-conditions.time[:, None] / constants))

        return replace(term, given=given)

    def rise(self, conditions: Conditions) -> Float[np.ndarray, " n"] | None:
        """Of a robot that is warm throughout."""
        return None if conditions.time is None else np.ones(len(conditions.time))
