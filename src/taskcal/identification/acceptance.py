"""Whether a calibrated robot is accurate enough: pass or fail by a limit and a guard band.

Decision rule (JCGM 106:2012, 8.3.2, guarded acceptance): a point is accepted where its measured error and 1.645 standard
uncertainties of the measurement stay within the limit together, so that of points right at the limit at most 5 % are accepted
that are beyond it. The errors of the measurement are taken as all in one direction, the worst case for a mean.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal, get_args

import numpy as np

from taskcal.identification.examination import Examination

GUARD = 1.645
"""Standard uncertainties in the guard band: one side of a normal distribution, 95 %."""

Statistic = Literal["max", "p95", "rms", "mean"]

STATISTICS: tuple[Statistic, ...] = get_args(Statistic)

_VALUES: dict[str, Callable[[np.ndarray], float]] = {
    "max": lambda errors: float(errors.max()),
    "p95": lambda errors: float(np.percentile(errors, 95)),
    "rms": lambda errors: float(np.sqrt(np.mean(errors**2))),
    "mean": lambda errors: float(errors.mean()),
}


@dataclass(frozen=True, kw_only=True)
class Acceptance:
    """The decision."""

    limit: float
    """Metres."""
    of: Statistic
    """What of the errors is held against the limit."""
    value: float
    """As measured, metres."""
    least: float
    """What it may be, if all errors were measured 1.645 standard uncertainties too large, metres."""
    most: float
    """What it may be, if all errors were measured 1.645 standard uncertainties too small, metres: value and guard band."""

    @property
    def accepted(self) -> bool:
        """Whether it is within the limit beyond reasonable doubt."""
        return self.most <= self.limit

    @property
    def decision(self) -> Literal["pass", "fail", "undecided"]:
        """``undecided`` is not accepted either: the measurement is too uncertain to tell."""
        if self.accepted:
            return "pass"
        return "fail" if self.least > self.limit else "undecided"

    def summary(self) -> dict[str, Any]:
        """The decision, in millimetres."""
        return {
            "limit_mm": self.limit * 1e3,
            "of": self.of,
            "value_mm": self.value * 1e3,
            "guard_band_mm": (self.most - self.value) * 1e3,
            "decision": self.decision,
            "accepted": self.accepted,
        }


def accept(examination: Examination, limit: float, of: Statistic = "max") -> Acceptance:
    """Decide whether a calibration keeps a limit on the campaign that it was examined with.

    Args:
        examination: the points.
        limit: of the error in space, metres.
        of: what is held against it: the largest error, the 95th percentile, the root mean square or the mean.

    Raises:
        ValueError: a limit that is not above zero, or another statistic.
    """
    if of not in STATISTICS:
        raise ValueError(f"of is {of!r}; give {', '.join(STATISTICS)}")
    if not 0.0 < limit < np.inf:
        raise ValueError(f"limit is {limit!r}; give metres above zero")
    errors, guard = examination.validation.errors, GUARD * examination.uncertainty
    value = _VALUES[of]
    return Acceptance(
        limit=limit,
        of=of,
        value=value(errors),
        least=value(np.maximum(errors - guard, 0.0)),
        most=value(errors + guard),
    )
