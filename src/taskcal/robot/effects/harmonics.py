"""Eccentricity of gears and encoders."""

from dataclasses import dataclass

import numpy as np

from taskcal.robot.effects.effect import Effect
from taskcal.robot.effects.linear_term import LinearTerm, at_joints
from taskcal.robot.robot import Robot


@dataclass(frozen=True, kw_only=True)
class Harmonics(Effect):
    """Gear and encoder eccentricity: cosine and sine of each joint's own angle and its multiples."""

    orders: tuple[int, ...] = (1, 2)

    def term(self, robot: Robot) -> LinearTerm:
        """Parameters ``J2.cos1``, ``J2.sin1`` …, radians."""
        turning = [j for j in self.chosen(robot) if not robot.prismatic[j]]
        shapes = [(j, order, part) for j in turning for order in self.orders for part in ("cos", "sin")]
        columns = np.array([j for j, _, _ in shapes], dtype=np.int64)
        orders = np.array([order for _, order, _ in shapes])
        phases = np.array([0.0 if part == "cos" else 0.5 * np.pi for _, _, part in shapes])
        return at_joints(
            [f"{robot.joint_names[j]}.{part}{order}" for j, order, part in shapes],
            robot,
            columns,
            [self.tolerance] * len(shapes),
            lambda q: np.cos(robot.joint_map(q)[:, columns] * orders - phases),
        )
