"""A robot that grows, and a base that drifts, with the temperature."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from jaxtyping import Shaped

from taskcal.errors import TaskcalError
from taskcal.geometry import se3
from taskcal.geometry.expressions import or_zero
from taskcal.kernels.chain import Fixed, Joint, Step
from taskcal.robot.conditions import Conditions
from taskcal.robot.effects.base import Effect, LinearTerm
from taskcal.robot.robot import Robot

# Lengths that grow, and a base that moves, with something that is told of each pose.

STAND = 1.0
"""Height that stands for what carries the robot and the tracker, metres."""

DRIFT = ("tx", "ty", "tz", "rx", "ry", "rz")
MIN_LENGTH = 1e-9
"""Length under which there is nothing to grow, metres."""


@dataclass(frozen=True, kw_only=True)
class ThermalExpansion(Effect, abstract=True):
    """Common part of `Thermal` and `WarmUp`; a model has one of them.

    All lengths between the axes grow in one proportion; or, if joints are named, those behind each of them in a proportion
    of their own, and the others do not. What carries the base moves and tilts as something of 1 m height, of which one
    side grows.
    """

    per: ClassVar[str]
    """What a unit's name has behind it."""
    least: ClassVar[float]
    """Between the lowest and the highest of what it needs, over the rows of a campaign, from which on it competes."""

    def is_told(self, conditions: Conditions) -> bool:
        """Whether every row tells what it needs, and the rows differ by enough to prove it."""
        if not super().is_told(conditions):
            return False
        return all(float(np.ptp(getattr(conditions, quantity))) >= self.least for quantity in self.needs)

    def rise(self, conditions: Conditions) -> Shaped[np.ndarray, " n"] | None:
        """Rise of each pose above the reference; NaN where unknown, None where nothing is known."""
        raise TaskcalError(f"{type(self).__name__} must override rise()")

    def term(self, robot: Robot) -> LinearTerm:
        """Parameters ``thermal.expansion``, or ``J2.expansion`` …, metres per metre, and ``thermal.tx`` … of the base.

        Raises:
            UnknownName: a joint that the robot does not have.
            TaskcalError: a named joint has no length behind it.
        """
        grown, first = self._grown(robot), len(robot.joints)
        if self.joints is None:
            names, own = ["thermal.expansion"], [0] * len(grown)
        else:
            names, own = [f"{robot.joint_names[j]}.expansion" for j, _ in grown], list(range(len(grown)))
        pairs = [(first + c, len(names) + c) for c in range(len(DRIFT))]
        pairs += [(first + len(DRIFT) + i, parameter) for i, parameter in enumerate(own)]
        gain = np.array([1.0] * len(DRIFT) + [float(np.linalg.norm(link)) for _, link in grown])

        def at_reference(q: Shaped[np.ndarray, "n joints"]) -> Shaped[np.ndarray, "n pairs"]:
            return np.zeros((len(q), len(gain)))

        def given(q: Shaped[np.ndarray, "n joints"], conditions: Conditions) -> Shaped[np.ndarray, "n pairs"]:
            rise = self.rise(conditions)
            if rise is None:
                return at_reference(q)
            return (or_zero(rise) if rise.dtype == object else np.nan_to_num(rise))[:, None] * gain

        units = [*["m/m"] * len(names), *["m"] * 3, *["rad"] * 3]
        return LinearTerm(
            names=(*names, *(f"thermal.{c}" for c in DRIFT)),
            units=tuple(unit + self.per for unit in units),
            tolerances=(*[self.tolerance] * len(names), *[self.tolerance * STAND] * 3, *[self.tolerance] * 3),
            pairs=np.array(pairs),
            coordinates=first + len(gain),
            basis=at_reference,
            by_joint=lambda q: np.zeros((len(q), len(gain), q.shape[1])),
            given=given,
        )

    def extend(self, robot: Robot, steps: Sequence[Step]) -> tuple[Step, ...]:
        """Six joints that move the base, then a slide along each length that grows, where the length begins."""
        number = len(robot.joints)
        out: list[Step] = []
        for c in range(len(DRIFT)):
            out += _along(np.eye(3)[c % 3], Joint("prismatic" if c < 3 else "revolute", number + c))
        number += len(DRIFT)
        slides = {j: _along(link, Joint("prismatic", number + i)) for i, (j, link) in enumerate(self._grown(robot))}
        out += slides.get(-1, [])
        joint = -1
        for step in steps:
            out.append(step)
            if isinstance(step, Joint):
                joint += 1
                out += slides.get(joint, [])
        return tuple(out)

    def _grown(self, robot: Robot) -> list[tuple[int, Shaped[np.ndarray, " 3"]]]:
        """Lengths that grow: number of the joint before, −1 for the base, and the way to the next, in the joint's frame."""
        links = _links(robot)
        if self.joints is None:
            return [(j, link) for j, link in links if np.linalg.norm(link) > MIN_LENGTH]
        chosen = self.chosen(robot)
        for j, link in links:
            if j in chosen and np.linalg.norm(link) <= MIN_LENGTH:
                raise TaskcalError(f"behind {robot.joint_names[j]} of {robot.name} there is no length that could grow")
        return [(j, link) for j, link in links if j in chosen]


def _links(robot: Robot) -> list[tuple[int, Shaped[np.ndarray, " 3"]]]:
    """The way from the base (−1) and from each joint to the next, or to the TCP, in the frame where it begins."""
    poses = [np.eye(4)]
    for step in robot.steps():
        if isinstance(step, Fixed):
            poses[-1] = poses[-1] @ step.transform
        else:
            poses.append(np.eye(4))
    return [(i - 1, T[:3, 3]) for i, T in enumerate(poses)]


def _along(direction: Shaped[np.ndarray, " 3"], joint: Joint) -> list[Step]:
    """A joint along, or about, a direction instead of the z axis."""
    z = direction / np.linalg.norm(direction)
    across = np.cross(z, np.eye(3)[np.argmin(np.abs(z))])
    x = across / np.linalg.norm(across)
    turned = se3.pose(np.stack([x, np.cross(z, x), z], axis=1), np.zeros(3))
    return [Fixed(turned), joint, Fixed(se3.inverse(turned))]


ALUMINIUM_EXPANSION = 2.4e-5
"""Expansion coefficient of aluminium, per kelvin; steel and cast iron have half of it."""

MIN_WARMING_K = 1.0
"""Between the coldest and the warmest row, kelvin, from which on an effect of the temperature competes: a metre grows by a
hundredth of a millimetre."""


@dataclass(frozen=True, kw_only=True)
class Thermal(ThermalExpansion):
    """Lengths that grow with the temperature, and a base that moves against the tracker with it.

    All lengths between the axes grow in one proportion; or, if joints are named, those behind each of them in a proportion
    of their own, and the others do not. Without temperatures, a pose is taken for one at the reference temperature, where
    all its parameters are without effect.
    """

    key = "thermal"
    label = "thermal expansion"
    summary = "expansion of lengths and drift of the base with temperature"
    needs = ("temperature",)

    tolerance: float = ALUMINIUM_EXPANSION
    """Expansion per kelvin (1σ); what carries the base moves and tilts as one of 1 m height that grows so on one side."""
    reference: float = 20.0
    """Temperature at which the other parameters of the model hold, °C."""
    spread: float = 3.0
    """Standard deviation about the reference of temperatures that are not told, kelvin: a hall, over a week."""
    per: ClassVar[str] = "/K"
    least: ClassVar[float] = MIN_WARMING_K

    @classmethod
    def candidates(cls, robot: Robot, conditions: Conditions) -> "Sequence[Thermal]":
        """One that refers to the mean temperature, where temperatures differ."""
        return [cls().referred(conditions)] if cls().is_told(conditions) else []

    def referred(self, conditions: Conditions) -> "Thermal":
        """The effect with the mean temperature as its reference, and temperatures that are not told spread as those are."""
        reference = conditions.mean_temperature
        if conditions.temperature is None:
            return replace(self, reference=reference)
        spread = float(np.sqrt(np.nanmean((conditions.temperature - reference) ** 2)))
        return replace(self, reference=reference, spread=round(spread, 2))

    def off_reference(self, count: int) -> Conditions:
        """Poses that are warmer by `spread`."""
        return Conditions(temperature=np.full(count, self.reference + self.spread))

    def rise(self, conditions: Conditions) -> Shaped[np.ndarray, " n"] | None:
        """Kelvins above the reference."""
        return None if conditions.temperature is None else conditions.temperature - self.reference


# A robot that warms up at work.

MIN_DURATION_S = 600.0
"""Between the first and the last row, seconds, from which on warming up competes."""

TIME_CONSTANTS_S = 1200.0, 3600.0, 10800.0
"""That compete, seconds: drives take minutes, castings hours."""

_MINUTES = re.compile(r"warmup:([1-9]\d{0,3})$")


@dataclass(frozen=True, kw_only=True)
class WarmUp(ThermalExpansion):
    """Lengths that grow, and a base that moves, as 1 − exp(−t/τ) with the time at work; for where no temperature is known.

    All lengths between the axes grow in one proportion; or, if joints are named, those behind each of them in a proportion
    of their own, and the others do not. Without a time, a pose is taken for one at the reference, where all its parameters
    are without effect.
    """

    key = "warmup"
    label = "warming up"
    needs = ("time",)

    tolerance: float = 2.4e-4
    """Expansion of a cold robot until it is warm (1σ): aluminium that warms by 10 K."""
    time_constant: float = 3600.0
    """τ, seconds."""
    reference: float | None = None
    """Time at which the other parameters of the model hold, seconds; by default when the robot is warm."""
    spread: float = 0.3
    """Standard deviation of how much colder than at the reference poses are that tell no time, as a share of the whole way."""
    per: ClassVar[str] = ""
    least: ClassVar[float] = MIN_DURATION_S

    @classmethod
    def candidates(cls, robot: Robot, conditions: Conditions) -> "Sequence[WarmUp]":
        """Several time constants that refer to the end of the campaign, where it took long enough."""
        if not cls().is_told(conditions):
            return []
        return [cls(time_constant=constant).referred(conditions) for constant in TIME_CONSTANTS_S]

    @classmethod
    def spellings(cls) -> Mapping[str, str]:
        """Spellings with and without a time constant in minutes."""
        growing = "expansion of lengths and drift of the base during warm-up"
        return {"warmup": f"{growing}, time constant 60 min", "warmup:20": f"{growing}, time constant in minutes"}

    @classmethod
    def parse(cls, text: str) -> "WarmUp | None":
        """``warmup``, or with its time constant in minutes, ``warmup:20``."""
        minutes = _MINUTES.match(text)
        if minutes is not None:
            return cls(time_constant=60.0 * int(minutes[1]))
        return cls() if text == cls.key else None

    @property
    def details(self) -> str:
        """The time constant."""
        return f" in {self.time_constant / 60.0:g} min"

    def referred(self, conditions: Conditions) -> "WarmUp":
        """The effect with the end of the campaign as its reference, when the robot was warmest, and untold times as the campaign's.

        Raises:
            TaskcalError: there are no times.
        """
        if conditions.time is None:
            raise TaskcalError("the end of a campaign without times cannot be a reference; give Conditions a time")
        at_end = replace(self, reference=float(np.nanmax(conditions.time)))
        rise = at_end.rise(conditions)
        return at_end if rise is None else replace(at_end, spread=round(float(np.sqrt(np.nanmean(rise**2))), 3))

    def off_reference(self, count: int) -> Conditions:
        """Poses that are colder by `spread`, or as cold as the robot ever is."""
        left = 0.0 if self.reference is None else np.exp(-self.reference / self.time_constant)
        return Conditions(time=np.full(count, -self.time_constant * np.log(min(left + self.spread, 1.0))))

    def rise(self, conditions: Conditions) -> Shaped[np.ndarray, " n"] | None:
        """Warming above the reference, as a share of that from cold to warm."""
        if conditions.time is None:
            return None
        left = 0.0 if self.reference is None else np.exp(-self.reference / self.time_constant)
        return left - np.exp(-conditions.time / self.time_constant)
