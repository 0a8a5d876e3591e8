"""The same posture with joints turned by whole turns."""

from itertools import product

import numpy as np
from jaxtyping import Float

from taskcal.robot.robot import Robot

MAX_TURNS = 4
"""Whole turns of a joint among which its period is looked for."""


def turned(robot: Robot, q: Float[np.ndarray, " joints"]) -> Float[np.ndarray, "k joints"]:
    """All postures inside the limits that differ from q by whole turns of revolute joints, the nearest to q first.

    They bring the tool to the same pose: a joint that moves an axis by a ratio is turned until all its axes have made
    whole turns. A joint without limits is turned once either way.

    Args:
        robot: the robot.
        q: joint positions, radians; they may lie outside the limits.
    """
    choices = [_positions(robot, j, float(q[j])) for j in range(len(q))]
    postures = np.array(list(product(*choices))).reshape(-1, len(q))
    postures = postures[robot.inside_limits(postures)]
    return postures[np.argsort(np.abs(postures - q).sum(axis=1), kind="stable")]


def _positions(robot: Robot, j: int, value: float) -> list[float]:
    """What joint j may be turned to."""
    period = _period(robot, j)
    if period is None:
        return [value]
    limits = robot.limits[j]
    low, high = np.where(np.isinf(limits), (value - period, value + period), limits)
    first, last = np.ceil((low - value) / period - 1e-9), np.floor((high - value) / period + 1e-9)
    return [value + k * period for k in np.arange(first, last + 1)]


def _period(robot: Robot, j: int) -> float | None:
    """The turn of joint j after which the tool is where it was, radians; None for a joint that has none."""
    if robot.prismatic[j]:
        return None
    ratios = [robot.joint_map.matrix[:, j]]
    if robot.four_bar is not None:
        ratios.append(np.array([robot.four_bar.arm[j], robot.four_bar.crank[j]]))
    ratio = np.concatenate(ratios)
    driven = [joint.kind == "prismatic" for joint in robot.driven]
    slides = np.array([*robot.prismatic, *driven, *[False] * (len(ratio) - len(robot.prismatic) - len(driven))])
    if ratio[slides].any():
        return None
    for turns in range(1, MAX_TURNS + 1):
        if np.allclose(turns * ratio, np.round(turns * ratio), rtol=0.0, atol=1e-9):
            return 2.0 * np.pi * turns
    return None
