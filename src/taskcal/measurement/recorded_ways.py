"""How each row of a campaign was reached, as its file tells."""

import re

import numpy as np
from jaxtyping import Bool

from taskcal.measurement.readings import Readings
from taskcal.robot.approach import conditions_in_order
from taskcal.robot.conditions import Conditions
from taskcal.robot.robot import Robot

_COUNT = re.compile(r"[0-9]{1,15}")


def recorded_ways(readings: Readings, robot: Robot, q: np.ndarray) -> Conditions:
    """How each row was reached: by columns, or else by the order of the rows."""
    if readings.approach is None and readings.move is None:
        return conditions_in_order(robot, q, _follows(readings.ids))
    approach = readings.approach
    if approach is None and readings.move is not None:
        approach = np.sign(readings.move)
    return Conditions(approach=approach, move=readings.move)


def _follows(ids: tuple[str, ...] | None) -> Bool[np.ndarray, " n"] | None:
    """Whether each row was measured after the one before it, as far as ids that count tell."""
    if ids is None or len(ids) < 3 or not all(_COUNT.fullmatch(text) for text in ids):
        return None
    steps = np.diff([int(text) for text in ids])
    return None if steps.min() <= 0 else np.concatenate([[False], steps <= np.median(steps)])
