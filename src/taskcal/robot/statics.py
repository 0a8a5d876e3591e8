"""What a robot weighs, how stiff its drives are, and which way is down."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from taskcal.robot.coil_spring import CoilSpring

STANDARD_GRAVITY = 9.80665
"""Metres per second squared (BIPM, The International System of Units)."""


@dataclass(frozen=True, kw_only=True)
class Body:
    """A mass and where it is."""

    mass: float
    """Kilograms."""
    centre: tuple[float, float, float]
    """Centre of mass in the frame that carries it, metres."""


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
