"""Eccentricity of gears and encoders."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from taskcal.errors import TaskcalError
from taskcal.robot.conditions import Conditions
from taskcal.robot.effects.effect import Effect
from taskcal.robot.effects.linear_term import LinearTerm, at_joints
from taskcal.robot.robot import Robot

_ORDERS = re.compile(r"harmonics:(\d+)(?:-(\d+))?$")
_HIGHEST = 200
"""Order that can be named."""


@dataclass(frozen=True, kw_only=True)
class Harmonics(Effect):
    """Gear and encoder eccentricity: cosine and sine of each joint's own angle and its multiples."""

    key = "harmonics"
    label = "gear harmonics"
    asks_for = "no joint turns"

    orders: tuple[int | float, ...] = (1, 2)
    """Periods in a turn of the joint; whole numbers, but for what recurs with the turns of a motor or a gear in between."""
    falling: bool = False
    """Expect amplitudes that fall as 1/order, of which `tolerance` is the first, instead of equal ones."""

    @classmethod
    def candidates(cls, robot: Robot, conditions: Conditions) -> "Sequence[Harmonics]":
        """All orders to 30 with amplitudes that fall."""
        return (SPECTRUM,) if SPECTRUM.suits(robot) else ()

    @classmethod
    def ways_to_write(cls) -> Mapping[str, str]:
        """Some orders by a word, others by their numbers."""
        return {
            "harmonics": "gears and encoders that err once and twice in a turn of the joint: orders 1 and 2",
            "harmonics:1-4": "the same for these orders",
            "periodic": "orders 3 to 30, each small",
        }

    @classmethod
    def parse(cls, text: str) -> "Harmonics | None":
        """``harmonics``, with one order or a range of them, ``harmonics:1-4``, or ``periodic``.

        Raises:
            TaskcalError: orders that do not exist.
        """
        match = _ORDERS.match(text)
        if match is None:
            return {cls.key: cls(), "periodic": PERIODIC}.get(text)
        first, last = int(match[1]), int(match[2] or match[1])
        if not 1 <= first <= last <= _HIGHEST:
            raise TaskcalError(
                f"'{text}': orders count periods in a turn; write harmonics:1-4, between 1 and {_HIGHEST}"
            )
        return cls(orders=tuple(range(first, last + 1)))

    @property
    def details(self) -> str:
        """The first and the last of its orders."""
        first, last = min(self.orders), max(self.orders)
        return f" of order {first:g}" if first == last else f" of orders {first:g} to {last:g}"

    def term(self, robot: Robot) -> LinearTerm:
        """Parameters ``J2.cos1``, ``J2.sin1`` …, radians."""
        turning = [j for j in self.chosen(robot) if not robot.prismatic[j]]
        shapes = [(j, order, part) for j in turning for order in self.orders for part in ("cos", "sin")]
        columns = np.array([j for j, _, _ in shapes], dtype=np.int64)
        orders = np.array([order for _, order, _ in shapes])
        phases = np.array([0.0 if part == "cos" else 0.5 * np.pi for _, _, part in shapes])
        turns = robot.joint_map.matrix[columns] * orders[:, None]
        return at_joints(
            [f"{robot.joint_names[j]}.{part}{order:g}" for j, order, part in shapes],
            robot,
            columns,
            [self.tolerance / order if self.falling else self.tolerance for order in orders],
            lambda q: np.cos(robot.joint_map(q)[:, columns] * orders - phases),
            by_joint=lambda q: -np.sin(robot.joint_map(q)[:, columns] * orders - phases)[:, :, None] * turns,
        )


SPECTRUM = Harmonics(orders=tuple(range(1, 31)), tolerance=1e-4, falling=True)
"""What `identify` looks for beside the geometry by default: twenty seconds of arc once in a turn, and less the more often."""

PERIODIC = Harmonics(orders=tuple(range(3, 31)), tolerance=2e-5)
"""Errors of gears and encoders that recur several times in a turn; each is small, the right ones are not known before."""

GEARS = Harmonics(tolerance=5e-5)
"""What gears of industrial robots are made to: ten seconds of arc."""
