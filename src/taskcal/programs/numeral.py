"""Numbers in the text of a program: a new value in the digits of the old one."""

MOST_DECIMALS = 12
"""No program states more."""


def renumbered(text: str, was: float, value: float, decimals: int) -> str:
    """Text for a value that may have changed.

    Args:
        text: how the number is written.
        was: what is meant by it.
        value: what is to be meant.
        decimals: decimals that matter; as many are written, or more where the text has more.

    Returns:
        The text itself where the value is the same to that many decimals.
    """
    if abs(value - was) <= 0.5 * 10.0**-decimals:
        return text
    return numeral(value, max(decimals, min(_decimals(text), MOST_DECIMALS)))


def numeral(value: float, decimals: int) -> str:
    """A number with so many decimals, without a minus before zero."""
    return f"{round(value, decimals) + 0.0:.{decimals}f}"


def _decimals(text: str) -> int:
    behind = text.partition(".")[2]
    return len(behind) - len(behind.lstrip("0123456789"))
