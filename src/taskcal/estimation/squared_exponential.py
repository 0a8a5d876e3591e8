"""The squared-exponential correlation of a smooth random function (Rasmussen and Williams 2006, eq. 4.9)."""

import numpy as np
from jaxtyping import Float


def squared_exponential(square: Float[np.ndarray, "*b"]) -> Float[np.ndarray, "*b"]:
    """Correlation exp(−d²/2) of a function's values at two places.

    Args:
        square: d², squared distance of the places in units of the length scales; rounding may leave it below zero.
    """
    return np.exp(-0.5 * np.maximum(square, 0.0))
