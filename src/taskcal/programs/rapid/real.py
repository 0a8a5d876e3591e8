"""The text of RAPID numbers, which the controller keeps in single precision."""

import math

import numpy as np

MM_DECIMALS = 5
DEG_DECIMALS = 6
QUATERNION_DECIMALS = 9
"""Smaller digits are rounding errors."""

LARGE = 1e7
"""From here on numbers are written with an exponent, as the controller writes its 9E+09."""


def real(value: float, decimals: int) -> str:
    """The shortest text that gives a value back in single precision, rounded to so many decimals before."""
    if abs(value) >= LARGE:
        mantissa, exponent = f"{np.format_float_scientific(np.float32(value), trim='-', exp_digits=2)}".split("e")
        return f"{mantissa}E{exponent}"
    text = np.format_float_positional(np.float32(round(value, decimals)), unique=True, trim="-")
    return "0" if text == "-0" else text


def quaternion_texts(wxyz: tuple[float, ...]) -> tuple[str, ...]:
    """Texts of a unit quaternion's components whose largest makes up for the rounding of the others."""
    texts = [real(v, QUATERNION_DECIMALS) for v in wxyz]
    largest = max(range(4), key=lambda i: abs(wxyz[i]))
    others = sum(float(text) ** 2 for i, text in enumerate(texts) if i != largest)
    length = math.sqrt(max(1.0 - others, 0.0))
    texts[largest] = real(math.copysign(length, wxyz[largest]), QUATERNION_DECIMALS)
    return tuple(texts)
