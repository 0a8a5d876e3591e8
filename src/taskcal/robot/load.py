"""What the tool carries, and what pushes at it."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from taskcal.errors import TaskcalError
from taskcal.robot.statics import Body
from taskcal.short_repr import short_repr

Vector = tuple[float, float, float]


@short_repr
@dataclass(frozen=True, kw_only=True)
class Load:
    """A payload and a constant force and moment at the tool point, such as those of a cut.

    Raises:
        TaskcalError: a value that is not a finite number, a mass below zero, or axes that do not exist.
    """

    mass: float | None = None
    """Of the payload, tool included, kilograms; that of the robot file by default."""
    centre: Vector = (0.0, 0.0, 0.0)
    """Centre of the payload's mass in the controller's flange frame, metres."""
    force: Vector = (0.0, 0.0, 0.0)
    """On the tool, at the tool point, newtons."""
    moment: Vector = (0.0, 0.0, 0.0)
    """On the tool, newton metres."""
    axes: Literal["base", "tool"] = "base"
    """Of force and moment: those of the robot's base, or those of the tool frame, which turn with it."""

    def __post_init__(self) -> None:
        """Refuse what is not a load; lists and arrays become tuples."""
        for name in ("centre", "force", "moment"):
            value = getattr(self, name)
            if len(value) != 3 or not np.isfinite(value).all():
                raise TaskcalError(f"the load's {name} is {value}; it must be three finite numbers")
            object.__setattr__(self, name, tuple(map(float, value)))
        if self.mass is None and any(self.centre):
            raise TaskcalError("the load has a centre but no mass; state both, or neither for the robot file's payload")
        if self.mass is not None and not 0.0 <= self.mass < np.inf:
            raise TaskcalError(f"the load's mass is {self.mass:g} kg; it must be finite and not below zero")
        if self.axes not in ("base", "tool"):
            raise TaskcalError(f"the load's axes are '{self.axes}'; give 'base' or 'tool'")

    def payload(self, stated: Body) -> Body:
        """The payload, where the robot file states one."""
        return stated if self.mass is None else Body(mass=self.mass, centre=self.centre)
