"""Gears that err with the turn of their own drive: eccentric, and with a ripple whose size changes over the turn."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from taskcal.robot.effects.effect import Effect
from taskcal.robot.effects.linear_term import LinearTerm
from taskcal.robot.effects.load_path import motor_matrix
from taskcal.robot.robot import Robot


@dataclass(frozen=True, kw_only=True)
class GearErrors(Effect, abstract=True):
    """Orders 1 and 2 of eccentric wheels, and a ripple of an order of each gear's own, with its double.

    The orders are those of the teeth, and no whole numbers; the ripple's size changes over the turn. The gear errs with
    the angle of its motor's output, which behind a four-bar is not that of the joint. For virtual robots only: it is not
    registered, so that no fit ever tries it.
    """

    orders: tuple[float, ...]
    """Of each gear's ripple, periods in a turn of its output."""
    swell: tuple[float, ...]
    """Where each gear's ripple is largest, radians."""
    depth: float = 0.5
    """By how much of its mean the ripple grows and falls over a turn."""
    eccentricity: float = 5e-5
    """Cosine and sine of orders 1 and 2 (1σ), radians."""
    ripple: float = 1e-5
    """Cosine and sine of the ripple's own order (1σ), radians; its double has half of it."""

    def term(self, robot: Robot) -> LinearTerm:
        """Parameters ``J1.once_cos`` …, ``J1.ripple_sin`` …, radians."""
        gears = len(robot.joints)
        kinds = ("once", "twice", "ripple", "double")
        sizes = (self.eccentricity, self.eccentricity, self.ripple, 0.5 * self.ripple)
        shapes = [(j, k, part) for j in range(gears) for k in range(len(kinds)) for part in (0, 1)]
        parameter, coordinate = np.nonzero(motor_matrix(robot)[:, [j for j, _, _ in shapes]].T)
        geared = motor_matrix(robot)[coordinate, np.array([j for j, _, _ in shapes])[parameter]]

        def basis(q: Float[np.ndarray, "n joints"]) -> Float[np.ndarray, "n pairs"]:
            own = np.array(self.orders)
            multiples = np.stack([np.ones(gears), np.full(gears, 2.0), own, 2.0 * own], axis=1)
            angle = q[:, :, None] * multiples
            size = 1.0 + self.depth * np.cos(q - np.array(self.swell))[:, :, None] * (np.arange(len(kinds)) >= 2)
            waves = np.stack([size * np.cos(angle), size * np.sin(angle)], axis=3)
            return waves.reshape(len(q), -1)[:, parameter] * geared

        return LinearTerm(
            names=tuple(f"{robot.joint_names[j]}.{kinds[k]}_{('cos', 'sin')[part]}" for j, k, part in shapes),
            units=("rad",) * len(shapes),
            tolerances=tuple(sizes[k] for _, k, _ in shapes),
            pairs=np.stack([coordinate, parameter], axis=1),
            coordinates=gears,
            basis=basis,
        )
