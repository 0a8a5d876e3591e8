"""What a robot weighs, how stiff its drives are, the spring that holds an axis up, and which way is down."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

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

    def torque(self, turn: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
        """Torque on the joint at its turns (radians), newton metres: −∂U/∂φ of U = ½ c (l − l₀)², l² = r² + a² − 2 r a cos φ."""
        phi = turn - self.aligned
        r, a = self.crank, self.anchor
        length = np.sqrt((r - a) ** 2 + 2.0 * r * a * (1.0 - np.cos(phi)))
        return -self.rate * (length - self.free_length) * r * a * np.sin(phi) / length

    def torque_by_turn(self, turn: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
        """∂(torque)/∂φ, newton metres per radian: of −c r a sin φ (1 − l₀/l), where ∂l/∂φ = r a sin φ / l."""
        phi = turn - self.aligned
        r, a = self.crank, self.anchor
        length = np.sqrt((r - a) ** 2 + 2.0 * r * a * (1.0 - np.cos(phi)))
        pulled = 1.0 - self.free_length / length
        return -self.rate * r * a * (np.cos(phi) * pulled + self.free_length * r * a * np.sin(phi) ** 2 / length**3)


@dataclass(frozen=True, eq=False, kw_only=True)
class Statics:
    """What the robot file says of loads and stiffness."""

    links: tuple[Body, ...] | None
    """What moves with each joint, in the frame of its row; None where the file does not say."""
    payload: Body
    """At the flange, in the controller's flange frame."""
    stiffness: tuple[float | None, ...]
    """Of each drive, seen at its joint, newton metres per radian (newtons per metre); None where not stated."""
    gravity: Float[np.ndarray, " 3"]
    """Direction of gravity in the base, of unit length."""
    spring: CoilSpring | None
