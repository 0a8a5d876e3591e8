"""Gears and encoders: scale errors, harmonics of joints and motors, and a smooth field of no known form."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Shaped

from taskcal.errors import TaskcalError
from taskcal.robot.conditions import Conditions
from taskcal.robot.effects.base import Effect, LinearTerm, at_joints
from taskcal.robot.effects.drives import turn_of
from taskcal.robot.effects.load_path import LoadPath, at_motors
from taskcal.robot.robot import Robot
from taskcal_groundwork.said import Said


@dataclass(frozen=True, kw_only=True)
class EncoderGain(Effect):
    """A scale error of each joint: the joint turns a little more or less than the controller says."""

    key = "gain"
    label = "encoder gain"
    summary = "encoder scale error"

    def term(self, robot: Robot) -> LinearTerm:
        """Parameters ``J2.gain``, radians per radian."""
        joints = np.array(self.chosen(robot), dtype=np.int64)
        turn, turn_by_joint = turn_of(robot, joints)
        return at_joints(
            [f"{robot.joint_names[j]}.gain" for j in joints],
            robot,
            joints,
            [self.tolerance] * len(joints),
            turn,
            by_joint=turn_by_joint,
            share=True,
        )


# Eccentricity: errors that recur with the turns of a joint.

_ORDERS = re.compile(r"harmonics:(\d+)(?:-(\d+))?$")
_MAX_ORDER = 200
"""Highest order that can be named."""


def _waves(joints: Sequence[int], orders: Sequence[int | float]) -> list[tuple[int, int | float, str, float]]:
    """Cosine and sine of every order at every joint: joint, order, name, and phase of a cosine."""
    parts = (("cos", 0.0), ("sin", 0.5 * np.pi))
    return [(j, order, part, phase) for j in joints for order in orders for part, phase in parts]


MIN_PARTICIPATION = 0.01
"""Share of its tolerance, at least, with which an order competes. A convention: next to nothing, and still a tolerance."""

WIDE_RAD = 1.0
"""Range of a joint, radians, from which on orders compete by the share of their period alone: over a radian what geometry has of a
joint, 1, cos θ and sin θ, is no longer a parabola. Chosen among such laws by measured robots (docs/decisions/0029-one-model.md)."""


@dataclass(frozen=True, kw_only=True)
class Harmonics(Effect):
    """Gear and encoder eccentricity: cosine and sine of each joint's own angle and its multiples."""

    key = "harmonics"
    label = "gear harmonics"
    asks_for = Said("no joint turns")

    orders: tuple[int | float, ...] = (1, 2)
    """Periods in a turn of the joint; whole numbers, but for what recurs with the turns of a motor or a gear in between."""
    falling: bool = False
    """Expect amplitudes that fall as 1/order, of which `tolerance` is the first, instead of equal ones."""

    @classmethod
    def candidates(cls, robot: Robot, conditions: Conditions) -> "Sequence[Harmonics]":
        """All orders to 30 with amplitudes that fall."""
        return (SPECTRUM,) if SPECTRUM.suits(robot) else ()

    @classmethod
    def spellings(cls) -> Mapping[str, str]:
        """Some orders by a word, others by their numbers."""
        return {
            "harmonics": "gear and encoder errors of orders 1 and 2 per turn of the joint",
            "harmonics:1-4": "the same with the given orders",
            "periodic": "gear errors of orders 3 to 30, each with a small tolerance",
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
        if not 1 <= first <= last <= _MAX_ORDER:
            raise TaskcalError(
                f"'{text}': orders count periods in a turn; write harmonics:1-4, between 1 and {_MAX_ORDER}"
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
        waves = _waves(turning, self.orders)
        columns = np.array([j for j, *_ in waves], dtype=np.int64)
        orders, phases = np.array([wave[1] for wave in waves]), np.array([wave[3] for wave in waves])
        turns = robot.joint_map.matrix[columns] * orders[:, None]
        return at_joints(
            [f"{robot.joint_names[j]}.{part}{order:g}" for j, order, part, _ in waves],
            robot,
            columns,
            [self.tolerance / order if self.falling else self.tolerance for order in orders],
            lambda q: np.cos(robot.joint_map(q)[:, columns] * orders - phases),
            by_joint=lambda q: -np.sin(robot.joint_map(q)[:, columns] * orders - phases)[:, :, None] * turns,
        )

    def participation(self, robot: Robot, q: Shaped[np.ndarray, "n joints"]) -> Shaped[np.ndarray, " p"]:
        """A power of the share of each order's period that the joint's range covers, 1 at most.

        Orders of which a joint went through a part of a period are a polynomial together: among the rows that follows everything,
        beyond them it runs away. Over less than a radian geometry has constant, slope and curvature in every joint, and what a part
        of a wave adds to these falls with the third power of that part: orders that are free to be more take from geometry what
        goes on beyond the rows. The power therefore grows from 1, of joints that moved a radian, to 3.
        """
        turning = [j for j in self.chosen(robot) if not robot.prismatic[j]]
        ranges = np.ptp(robot.joint_map(q), axis=0)
        powers = np.clip(WIDE_RAD / np.maximum(ranges, MIN_PARTICIPATION), 1.0, 3.0)
        covered = [(order * ranges[j] / (2.0 * np.pi)) ** powers[j] for j, order, *_ in _waves(turning, self.orders)]
        return np.clip(covered, MIN_PARTICIPATION, 1.0)


SPECTRUM = Harmonics(orders=tuple(range(1, 31)), tolerance=1e-4, falling=True)
"""What `identify` looks for beside the geometry by default: twenty seconds of arc once in a turn, and less the more often."""

PERIODIC = Harmonics(orders=tuple(range(3, 31)), tolerance=2e-5)
"""Errors of gears and encoders that recur several times in a turn; each is small, the right ones are not known before."""

GEARS = Harmonics(tolerance=5e-5)
"""What gears of industrial robots are made to: ten seconds of arc."""


# Errors of gears that recur with the turns of the motor.


@dataclass(frozen=True, kw_only=True)
class MotorHarmonics(Effect):
    """Cosine and sine of each motor's own angle and its multiples: strain-wave gears err twice in a turn of the motor.

    It takes the joints' gear ratios from the robot file. Behind a four-bar the motor turns with its crank.
    """

    key = "motor"
    label = "motor harmonics"
    asks_for = Said("the robot file states no gear ratio")
    summary = "gear errors of orders 1 and 2 per turn of the motor, for joints with `gear_ratio` in the robot file"

    orders: tuple[int, ...] = (1, 2)
    """Periods in a turn of the motor."""
    tolerance: float = 1e-4
    """Largest deflection expected of each parameter (1σ), at the joint, radians."""

    def suits(self, robot: Robot) -> bool:
        """Whether the robot file states a gear ratio."""
        return any(robot.joints[j].gear_ratio is not None for j in self.chosen(robot))

    def term(self, robot: Robot) -> LinearTerm:
        """Parameters ``J2.motor_cos1``, ``J2.motor_sin1`` …, radians at the joint, for joints whose ratio is stated.

        Raises:
            TaskcalError: no joint has a gear ratio, or one that was named has none.
        """
        ratios = [joint.gear_ratio for joint in robot.joints]
        geared = [j for j in self.chosen(robot) if ratios[j] is not None]
        missing = [name for name in self.joints or () if robot.joints[robot.joint_names.index(name)].gear_ratio is None]
        if missing or not geared:
            whose = f"joint {missing[0]}" if missing else "any joint"
            raise TaskcalError(
                f"{robot.name}: the robot file states no gear_ratio of {whose}; add it, or use Harmonics"
            )
        waves = _waves(geared, self.orders)
        motors, phases = [j for j, *_ in waves], np.array([phase for *_, phase in waves])
        periods = np.array([order * (ratios[j] or 0.0) for j, order, *_ in waves])

        def turns(path: LoadPath) -> Shaped[np.ndarray, "n p"]:
            return np.cos(path.motors[:, motors] * periods - phases)

        def turns_by_joint(path: LoadPath) -> Shaped[np.ndarray, "n p joints"]:
            by_angle = -np.sin(path.motors[:, motors] * periods - phases) * periods
            return by_angle[:, :, None] * path.motors_by_joint[motors]

        return at_motors(
            robot,
            [f"{robot.joint_names[j]}.motor_{part}{order}" for j, order, part, _ in waves],
            motors,
            [self.tolerance] * len(waves),
            turns,
            turns_by_joint,
        )


# A smooth function of all joints for each joint.


@dataclass(frozen=True, kw_only=True)
class JointField(Effect):
    """A smooth random function of all joints that turns each joint: loads, cables and friction that no other effect has.

    Each is a Gaussian process with the squared exponential as its correlation, in random Fourier features (Rahimi and Recht
    2008, Advances in Neural Information Processing Systems 20): cosines and sines of random directions in joint space.
    """

    key = "field"
    label = "smooth field"
    summary = "smooth field: each joint turns by a smooth function of all joint values"

    tolerance: float = 3e-5
    """Standard deviation expected of each function, radians (metres where the joint slides)."""
    length: float = 1.5
    """Change of the joints at which it becomes another, radians; lengths in metres count alike."""
    features: int = 20
    """Cosines, and as many sines, of each joint."""
    seed: int = 0
    """Of the directions."""

    def term(self, robot: Robot) -> LinearTerm:
        """Parameters ``J2.field_cos1``, ``J2.field_sin1`` …, radians."""
        joints = self.chosen(robot)
        rng = np.random.default_rng(self.seed)
        direction = rng.standard_normal((self.features, len(robot.joints))) / self.length
        waves = _waves(joints, range(self.features))
        feature, phase = np.array([wave[1] for wave in waves], dtype=np.int64), np.array([wave[3] for wave in waves])

        def basis(q: np.ndarray) -> np.ndarray:
            return np.cos((q @ direction.T)[:, feature] - phase)

        def by_joint(q: np.ndarray) -> np.ndarray:
            return -np.sin((q @ direction.T)[:, feature] - phase)[:, :, None] * direction[feature]

        return at_joints(
            [f"{robot.joint_names[j]}.field_{part}{k + 1}" for j, k, part, _ in waves],
            robot,
            np.array([j for j, *_ in waves], dtype=np.int64),
            [self.tolerance / np.sqrt(self.features)] * len(waves),
            basis,
            by_joint=by_joint,
        )
