"""Robots of a fleet one of whose parameters is unlike those of the others, beyond what chance and uncertainty explain.

Of each parameter the fleet has a centre (median) and a spread s: that with which the median of |x − centre|/√(s² + σ²), σ the
standard error of each robot's own estimate, is what it is for a normal distribution (0.6745), so that a robot that was measured
badly neither counts as an outlier nor widens the spread of the others. As few robots tell their spread badly, the quotient z is
held against Student's t with 0.45 (n − 1) degrees of freedom: with that, fleets of 8 to 30 normal robots with 54 parameters
had a false outlier in at most 1 % of cases. Probabilities are multiplied by how many robots and parameters there are (Holm
1979), so that an alarm anywhere in a fleet of robots that are alike has a chance of 1 % at most.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from taskcal.adaptation.robot_history import Estimates
from taskcal.robot.parameter import ShownUnit

LEVEL = 0.01
"""Chance of calling any robot of a fleet an outlier where all are alike."""

FEWEST_ROBOTS = 8
"""Of one kind, that can be held against each other."""

NORMAL_QUARTILE = 0.6745
"""Median of the absolute value of a standard normal variable."""

FREEDOM_SHARE = 0.45
"""Degrees of freedom for each robot but one."""

HALVINGS = 50
"""Of the interval in which a spread is looked for."""


@dataclass(frozen=True, kw_only=True)
class OutlyingParameter:
    """A parameter of a robot unlike that of the others; metres and radians."""

    robot: str
    name: str
    unit: ShownUnit
    value: float
    standard_error: float
    centre: float
    """Median of the fleet."""
    spread: float
    """Standard deviation of the robots about it, without what their uncertainties add."""
    z: float
    """Distance from the centre over its standard deviation, the own uncertainty included."""
    chance: float
    """Of one like that anywhere in the fleet, were all robots alike."""


def find_outliers(robots: Sequence[str], estimates: Sequence[Estimates]) -> tuple[OutlyingParameter, ...]:
    """Parameters of robots that are outliers, the least probable first.

    Args:
        robots: names of the robots, `FEWEST_ROBOTS` or more.
        estimates: of each; all of one nominal robot. A parameter that fewer of them have is left out.
    """
    names = list(dict.fromkeys(name for one in estimates for name in one.names))
    units = {name: unit for one in estimates for name, unit in zip(one.names, one.units, strict=True)}
    values, errors = _table(names, estimates)
    common = np.isfinite(values).sum(axis=0) >= FEWEST_ROBOTS
    names = [name for name, seen in zip(names, common, strict=True) if seen]
    values, errors = values[:, common], errors[:, common]
    if not names:
        return ()
    centre, spread, z, chance = judge(values, errors)
    out = [
        OutlyingParameter(
            robot=robots[int(r)],
            name=names[int(p)],
            unit=units[names[p]],
            value=float(values[r, p]),
            standard_error=float(errors[r, p]),
            centre=float(centre[p]),
            spread=float(spread[p]),
            z=float(z[r, p]),
            chance=float(chance[r, p]),
        )
        for r, p in np.argwhere(chance < LEVEL)
    ]
    return tuple(sorted(out, key=lambda one: (one.chance, -abs(one.z))))


def _table(names: Sequence[str], estimates: Sequence[Estimates]) -> tuple[np.ndarray, np.ndarray]:
    """Values and standard errors of every robot and parameter; NaN where a robot's calibration has not got it."""
    column = {name: k for k, name in enumerate(names)}
    values = np.full((len(estimates), len(names)), np.nan)
    errors = values.copy()
    for row, one in enumerate(estimates):
        columns = [column[name] for name in one.names]
        values[row, columns], errors[row, columns] = one.values, one.errors
    return values, errors


def judge(
    values: Float[np.ndarray, "n p"], errors: Float[np.ndarray, "n p"]
) -> tuple[Float[np.ndarray, " p"], Float[np.ndarray, " p"], Float[np.ndarray, "n p"], Float[np.ndarray, "n p"]]:
    """Centre and spread of each parameter, and of each robot the distance z and its chance; NaN where there is no value.

    Args:
        values: of each robot and parameter.
        errors: their standard errors.
    """
    from scipy.stats import t

    count = np.isfinite(values).sum(axis=0)
    centre = np.nanmedian(values, axis=0)
    distance = np.abs(values - centre)
    spread = _spread(distance, errors) * count / (count - 0.8)  # the median of few distances is too small
    width = np.sqrt((spread**2 + errors**2) * (1.0 + np.pi / (2.0 * count)))  # the centre is uncertain, too
    z = np.divide(values - centre, width, out=np.zeros_like(values), where=width > 0.0)
    z[np.isnan(values)] = np.nan
    single = 2.0 * t.sf(np.abs(z), FREEDOM_SHARE * (count - 1))
    return centre, spread, z, _holm(single)


def _spread(distance: Float[np.ndarray, "n p"], errors: Float[np.ndarray, "n p"]) -> Float[np.ndarray, " p"]:
    """The spread beside the errors with which the median distance is that of a normal distribution; zero where they suffice."""
    low = np.zeros(distance.shape[1])
    high = np.nanmax(distance, axis=0) / NORMAL_QUARTILE
    for _ in range(HALVINGS):
        middle = (low + high) / 2.0
        width = np.sqrt(middle**2 + errors**2)
        over = np.divide(distance, width, out=np.zeros_like(distance), where=width > 0.0)
        over[np.isnan(distance)] = np.nan
        wider = np.nanmedian(over, axis=0) > NORMAL_QUARTILE
        low, high = np.where(wider, middle, low), np.where(wider, high, middle)
    return low


def _holm(single: Float[np.ndarray, "n p"]) -> Float[np.ndarray, "n p"]:
    """Probabilities that allow for how many there are (Holm 1979)."""
    flat = single.ravel()
    order = np.argsort(flat)[: int(np.isfinite(flat).sum())]
    factor = len(order) - np.arange(len(order))
    out = np.full_like(flat, np.nan)
    out[order] = np.minimum(np.maximum.accumulate(flat[order] * factor), 1.0)
    return out.reshape(single.shape)
