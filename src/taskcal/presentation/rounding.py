"""Numbers with as many digits as they are worth."""

import math

DIGITS = 2
"""Of an uncertainty that are worth stating (GUM:2008, 7.2.6)."""

COVERAGE = 1.96
"""Standard uncertainties on either side of an interval that holds 95 % of a normal distribution."""


def decimals_of(uncertainty: float) -> int:
    """Digits behind the point that an uncertainty leaves worth stating."""
    if not 0.0 < uncertainty < math.inf:
        return 4
    return min(max(DIGITS - 1 - math.floor(math.log10(uncertainty)), 0), 9)


def with_interval(value: float, uncertainty: float) -> tuple[str, str]:
    """A value and its 95 % interval, with the same digits.

    Args:
        value: the best estimate.
        uncertainty: its standard uncertainty.
    """
    digits = decimals_of(uncertainty)
    half = COVERAGE * uncertainty
    return signed(value, digits), f"{signed(value - half, digits)} to {signed(value + half, digits)}"


def signed(value: float, digits: int) -> str:
    """A number with its sign; nothing has none."""
    text = f"{value:+.{digits}f}".replace("-", "−")
    return text if float(text.replace("−", "-")) else f"{0.0:.{digits}f}"
