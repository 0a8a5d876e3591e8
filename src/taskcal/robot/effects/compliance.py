"""Drives that yield under what they carry."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from taskcal.robot.effects.effect import Effect
from taskcal.robot.effects.linear_term import LinearTerm
from taskcal.robot.effects.load_path import LoadPath, drive
from taskcal.robot.robot import Robot

SAME = 1e-6
"""Share of a column under which what is left of it is nothing of its own."""


@dataclass(frozen=True, kw_only=True)
class Compliance(Effect):
    """Drives that yield under the weight of what they carry.

    The torque that unit weights at the later joints and at the tool point put on a motor is, by virtual work, their
    downward movement for a turn of that motor alone. That follows the true load path: through a parallelogram's rod the
    forearm's moment goes to the motor of its crank, whose absolute angle yields, and the lower arm's motor carries its
    weight but not its moment. A coupling without a four-bar is the controller's way of counting, and each drive yields
    about its own axis. Each parameter is the product of compliance and weight at one point, so neither must be known.
    """

    def term(self, robot: Robot) -> LinearTerm:
        """Parameters ``J2.sag_J4`` (weight at the origin of joint 4) … ``J2.sag_tool``, radians per metre of lever."""
        joints = len(robot.joints)
        levers = LoadPath.of(robot)
        rng = np.random.default_rng(0)
        limits = np.clip(robot.limits, -1.5, 1.5)
        sample = rng.uniform(limits[:, 0], limits[:, 1], (64, joints))
        closing = levers.at(_closing(robot, sample))
        kept: list[tuple[int, int]] = []
        for j in self.chosen(robot):
            own: list[np.ndarray] = []
            for point in range(closing.shape[1]):
                column = closing[:, point, j]
                if _is_new(column, own):
                    own.append(column)
                    kept.append((j, point))
        labels = [*robot.joint_names, "tool"]
        motor = np.array([j for j, _ in kept], dtype=np.int64)
        point = np.array([p for _, p in kept], dtype=np.int64)
        turned = drive(robot)
        moved = [(c, k) for k, j in enumerate(motor) for c in np.flatnonzero(turned[:, j])]
        coordinate, parameter = (np.array(column, dtype=np.int64) for column in zip(*moved, strict=True))
        gear = turned[coordinate, motor[parameter]]
        return LinearTerm(
            names=tuple(f"{robot.joint_names[j]}.sag_{labels[p]}" for j, p in kept),
            units=("rad",) * len(kept),
            tolerances=(self.tolerance,) * len(kept),
            pairs=np.stack([coordinate, parameter], axis=1),
            coordinates=joints,
            basis=lambda q: levers.at(q)[:, point[parameter], motor[parameter]] * gear,
        )


def _closing(robot: Robot, q: Float[np.ndarray, "n joints"]) -> Float[np.ndarray, "k joints"]:
    """Those of some positions that are inside the limits, where loops close."""
    inside = q[robot.inside_limits(q)]
    return inside if len(inside) > 16 else q


def _is_new(column: Float[np.ndarray, " n"], others: list[Float[np.ndarray, " n"]]) -> bool:
    """Whether a column says something that a combination of the others does not."""
    size = float(np.linalg.norm(column))
    if size < SAME * np.sqrt(len(column)):
        return False
    if not others:
        return True
    basis = np.stack(others, axis=1)
    rest = column - basis @ np.linalg.lstsq(basis, column, rcond=None)[0]
    return float(np.linalg.norm(rest)) > SAME * size
