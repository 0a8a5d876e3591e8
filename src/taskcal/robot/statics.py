"""Masses, drive stiffness, spring and gravity of a robot."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float, Shaped

from taskcal.errors import TaskcalError
from taskcal.short_repr import short_repr

STANDARD_GRAVITY = 9.80665
"""Metres per second squared (BIPM, The International System of Units)."""


@dataclass(frozen=True, kw_only=True)
class Body:
    """A mass and where it is."""

    mass: float
    """Kilograms."""
    centre: tuple[float, float, float]
    """Centre of mass in the frame that carries it, metres."""


@dataclass(frozen=True, kw_only=True)
class CoilSpring:
    """A spring between a point on the arm and an anchor on the link before it.

    Both points turn about the joint's axis, in one plane: the arm's at the crank's radius, the anchor at its distance.
    """

    joint: int
    """Number of the joint that it helps, counted from 0."""
    rate: float
    """Newtons per metre."""
    free_length: float
    """Length without force, metres; zero where it pulls in proportion to its length."""
    crank: float
    """From the axis to its end on the arm, metres."""
    anchor: float
    """From the axis to its anchor, metres."""
    aligned: float
    """Turn of the joint from its zero position, coupling included, at which the crank points at the anchor, radians."""

    def torque(self, turn: Shaped[np.ndarray, " n"]) -> Shaped[np.ndarray, " n"]:
        """Torque on the joint at its turns (radians), newton metres: −∂U/∂φ of U = ½ c (l − l₀)², l² = r² + a² − 2 r a cos φ."""
        phi = turn - self.aligned
        r, a = self.crank, self.anchor
        length = np.sqrt((r - a) ** 2 + 2.0 * r * a * (1.0 - np.cos(phi)))
        return -self.rate * (length - self.free_length) * r * a * np.sin(phi) / length

    def torque_by_turn(self, turn: Shaped[np.ndarray, " n"]) -> Shaped[np.ndarray, " n"]:
        """∂(torque)/∂φ, newton metres per radian: of −c r a sin φ (1 − l₀/l), where ∂l/∂φ = r a sin φ / l."""
        phi = turn - self.aligned
        r, a = self.crank, self.anchor
        length = np.sqrt((r - a) ** 2 + 2.0 * r * a * (1.0 - np.cos(phi)))
        pulled = 1.0 - self.free_length / length
        return -self.rate * r * a * (np.cos(phi) * pulled + self.free_length * r * a * np.sin(phi) ** 2 / length**3)


@dataclass(frozen=True, eq=False, kw_only=True)
class Statics:
    """Loads and stiffness stated by the robot file."""

    links: tuple[Body, ...] | None
    """What moves with each joint, in the frame of its row; None where the file does not say."""
    payload: Body
    """At the flange, in the controller's flange frame."""
    stiffness: tuple[float | None, ...]
    """Of each drive, seen at its joint, newton metres per radian (newtons per metre); None where not stated."""
    gravity: Float[np.ndarray, " 3"]
    """Direction of gravity in the base, of unit length."""
    spring: CoilSpring | None


# What the tool carries, and what pushes at it.

Vector = tuple[float, float, float]


@short_repr
@dataclass(frozen=True, kw_only=True)
class Load:
    """A payload and a constant force and moment at the TCP, such as those of a cut.

    Raises:
        TaskcalError: a value that is not a finite number, a mass below zero, or axes that do not exist.
    """

    mass: float | None = None
    """Of the payload, tool included, kilograms; that of the robot file by default."""
    centre: Vector = (0.0, 0.0, 0.0)
    """Centre of the payload's mass in the controller's flange frame, metres."""
    force: Vector = (0.0, 0.0, 0.0)
    """On the tool, at the TCP, newtons."""
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
