"""Numbers as the demonstration's page says them."""

import numpy as np
from jaxtyping import Float


def rms(values: Float[np.ndarray, " n"]) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(values**2)))


def length_text(metres: float) -> str:
    """A length with its unit."""
    return f"{um(metres)} µm" if metres < 1e-3 else f"{metres * 1e3:.3g} mm"


def power_text(value: float) -> str:
    """A number as a power of ten."""
    digits, exponent = f"{value:.1e}".split("e")
    return f"{digits}·10" + str(int(exponent)).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))


def um(metres: float) -> str:
    """A length in micrometres, without the unit."""
    return f"{metres * 1e6:.0f}" if metres >= 2e-5 else f"{metres * 1e6:.1f}"
