"""Units that a file does not state, told by what the robot can have done."""

import itertools

import numpy as np
from jaxtyping import Float

from taskcal.errors import TaskcalError
from taskcal.measurement.campaign import Campaign
from taskcal.measurement.registration import register
from taskcal.measurement.units import ANGLES, LENGTHS
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot import Robot

_TWO_TURNS = 4 * np.pi + 0.01
_LIKELY = ("mm", "m", "in")
_WINDOW = 1.8
"""Largest factor between the scatter of points and that of the flange, which a tool's length can explain over many poses. Inches,
millimetres and metres lie further apart."""
_MIN_POSES = 4
_FARTHEST = 50.0
"""Scatter of points that one instrument measures, metres, at most."""
_FAR_BETTER = 0.2
"""Of two misfits: a nominal robot misses by hundredths of the points' scatter with the right units, by tenths with others."""


def infer_units(
    robot: Robot,
    q: Float[np.ndarray, "n joints"],
    angle: str | None,
    points: Float[np.ndarray, "n 3"] | None,
    length: str | None,
) -> list[tuple[str, str]]:
    """The units of joints and points under which points scatter as the nominal flange does.

    Args:
        robot: the robot.
        q: joint positions, in the unit of `angle` where it is known.
        angle: unit of the joints that turn, where it is known.
        points: measured positions of one target, NaN where it was not seen; None where there are none.
        length: their unit, where it is known.

    Returns:
        Every pair of units under which they fit; one where it can be told.
    """
    angles = [angle] if angle else [unit for unit in ("deg", "rad") if _possible(robot, q, unit)]
    lengths = [length] if length else list(_LIKELY)
    if points is None:
        return list(itertools.product(angles, ["mm"]))
    seen = ~np.isnan(points[:, 0])
    if seen.sum() < _MIN_POSES:
        return list(itertools.product(angles, lengths))
    measured = _scatter(points[seen])
    out: list[tuple[str, str]] = []
    for unit in angles:
        flange = _scatter(ErrorModel(robot).poses(_in_radians(robot, q[seen], unit))[:, :3, 3])
        out += [
            (unit, other)
            for other in lengths
            if flange > 0 and 1 / _WINDOW < measured * LENGTHS[other] / flange < _WINDOW
        ]
    return out if len(out) < 2 else _clearly_best(robot, q[seen], points[seen], out)


def infer_length(robot: Robot, points: Float[np.ndarray, "n 3"]) -> str | None:
    """Millimetres or metres, where only one of them spreads the points over a plausible part of the robot's reach, or of a hall.

    Args:
        robot: that reached them.
        points: of unknown unit, NaN where a target was not seen.
    """
    seen = points[~np.isnan(points[:, 0])]
    if len(seen) < 2:
        return None
    scatter = _scatter(seen)
    reached = [unit for unit in ("mm", "m") if 0.01 < scatter * LENGTHS[unit] / robot.reach < 2.0]
    measured = [unit for unit in ("mm", "m") if 1e-3 < scatter * LENGTHS[unit] < _FARTHEST]
    return next((units[0] for units in (reached, measured) if len(units) == 1), None)


def _clearly_best(
    robot: Robot, q: np.ndarray, points: np.ndarray, pairs: list[tuple[str, str]]
) -> list[tuple[str, str]]:
    """The pair under which the nominal robot fits far better than under any other; all where there is none."""
    misfits = sorted((_misfit(robot, q, points, *pair), pair) for pair in pairs)
    return [misfits[0][1]] if misfits[0][0] < _FAR_BETTER * misfits[1][0] else pairs


def _misfit(robot: Robot, q: np.ndarray, points: np.ndarray, angle: str, length: str) -> float:
    """Root mean square misfit of the nominal robot, over the scatter of the points; infinite where it cannot be registered."""
    scaled = points * LENGTHS[length]
    ids = tuple(map(str, range(len(q))))
    campaign = Campaign(ids=ids, q=_in_radians(robot, q, angle), targets=("tool",), points=scaled[:, None])
    try:
        return register(ErrorModel(robot), campaign).rms / _scatter(scaled)
    except TaskcalError:
        return np.inf


def _in_radians(robot: Robot, q: np.ndarray, unit: str) -> np.ndarray:
    return np.where(robot.prismatic, q, q * ANGLES[unit])


def _possible(robot: Robot, q: np.ndarray, unit: str) -> bool:
    """Whether no joint turns further than its limits, or two turns."""
    turned = _in_radians(robot, q, unit)
    return bool((np.abs(turned[:, ~np.array(robot.prismatic)]) <= _TWO_TURNS).all()) and not robot.outside_limits(
        turned
    )


def _scatter(points: np.ndarray) -> float:
    """Root mean square distance from the mean."""
    return float(np.sqrt(np.mean(np.sum((points - points.mean(axis=0)) ** 2, axis=1))))
