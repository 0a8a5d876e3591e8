"""Lengths that grow, and a base that moves, with something that is told of each pose."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from jaxtyping import Float

from taskcal.errors import TaskcalError
from taskcal.geometry import se3
from taskcal.geometry.chain import Fixed, Joint, Step
from taskcal.robot.conditions import Conditions
from taskcal.robot.effects.effect import Effect
from taskcal.robot.effects.linear_term import LinearTerm
from taskcal.robot.robot import Robot

STAND = 1.0
"""Height that stands for what carries the robot and the tracker, metres."""

DRIFT = ("tx", "ty", "tz", "rx", "ry", "rz")
MIN_LENGTH = 1e-9
"""Length under which there is nothing to grow, metres."""


@dataclass(frozen=True, kw_only=True)
class ThermalExpansion(Effect, abstract=True):
    """What `Thermal` and `WarmUp` share; a model has one of them.

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

    def rise(self, conditions: Conditions) -> Float[np.ndarray, " n"] | None:
        """How far each pose is from the reference; NaN where unknown, None where nothing is known."""
        raise TaskcalError(f"{type(self).__name__} does not say what it grows with")

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

        def at_reference(q: Float[np.ndarray, "n joints"]) -> Float[np.ndarray, "n pairs"]:
            return np.zeros((len(q), len(gain)))

        def given(q: Float[np.ndarray, "n joints"], conditions: Conditions) -> Float[np.ndarray, "n pairs"]:
            rise = self.rise(conditions)
            return at_reference(q) if rise is None else np.nan_to_num(rise)[:, None] * gain

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

    def _grown(self, robot: Robot) -> list[tuple[int, Float[np.ndarray, " 3"]]]:
        """Lengths that grow: number of the joint before, −1 for the base, and the way to the next, in the joint's frame."""
        links = _links(robot)
        if self.joints is None:
            return [(j, link) for j, link in links if np.linalg.norm(link) > MIN_LENGTH]
        chosen = self.chosen(robot)
        for j, link in links:
            if j in chosen and np.linalg.norm(link) <= MIN_LENGTH:
                raise TaskcalError(f"behind {robot.joint_names[j]} of {robot.name} there is no length that could grow")
        return [(j, link) for j, link in links if j in chosen]


def _links(robot: Robot) -> list[tuple[int, Float[np.ndarray, " 3"]]]:
    """The way from the base (−1) and from each joint to the next, or to the tool point, in the frame where it begins."""
    poses = [np.eye(4)]
    for step in robot.steps():
        if isinstance(step, Fixed):
            poses[-1] = poses[-1] @ step.transform
        else:
            poses.append(np.eye(4))
    return [(i - 1, T[:3, 3]) for i, T in enumerate(poses)]


def _along(direction: Float[np.ndarray, " 3"], joint: Joint) -> list[Step]:
    """A joint along, or about, a direction instead of the z axis."""
    z = direction / np.linalg.norm(direction)
    across = np.cross(z, np.eye(3)[np.argmin(np.abs(z))])
    x = across / np.linalg.norm(across)
    turned = se3.pose(np.stack([x, np.cross(z, x), z], axis=1), np.zeros(3))
    return [Fixed(turned), joint, Fixed(se3.inverse(turned))]
