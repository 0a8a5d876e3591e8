"""Arithmetic that the languages have in common: comparisons, and functions of numbers whose angles are degrees."""

import math
import operator
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from robot_programs.core.program import Unresolved


@dataclass(frozen=True, kw_only=True, slots=True)
class Lost:
    """In place of a value, or of a component of one, that the text does not give."""

    reason: str


COMPARISONS: Mapping[str, Callable[[float, float], bool]] = {
    "<": operator.lt, "<=": operator.le, ">": operator.gt, ">=": operator.ge, "<>": operator.ne,
}  # fmt: skip

FUNCTIONS: Mapping[str, tuple[int, Callable[..., float]]] = {
    "ABS": (1, math.fabs), "SQRT": (1, math.sqrt), "EXP": (1, math.exp), "POW": (2, math.pow),
    "SIN": (1, lambda a: math.sin(math.radians(a))), "COS": (1, lambda a: math.cos(math.radians(a))),
    "TAN": (1, lambda a: math.tan(math.radians(a))),
    "ASIN": (1, lambda x: math.degrees(math.asin(x))), "ACOS": (1, lambda x: math.degrees(math.acos(x))),
    "ATAN": (1, lambda x: math.degrees(math.atan(x))), "ATAN2": (2, lambda y, x: math.degrees(math.atan2(y, x))),
}  # fmt: skip
"""Functions by their names in capitals, with how many numbers they are given."""


def applied(name: str, given: Sequence[float]) -> float:
    """Value of one of `FUNCTIONS`.

    Args:
        name: as the program writes it.
        given: as many numbers as it takes.

    Raises:
        Unresolved: it has none, or one that is not finite.
    """
    try:
        value = float(FUNCTIONS[name.upper()][1](*given))
    except (ValueError, ArithmeticError):
        value = math.nan
    if not math.isfinite(value):
        raise Unresolved(f"{name}({', '.join(f'{v:g}' for v in given)}) has no value")
    return value
