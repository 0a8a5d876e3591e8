"""Derivatives of what is written in NumPy, by complex steps: exact to rounding, unlike differences."""

from collections.abc import Callable

import numpy as np
from jaxtyping import Float

from taskcal.errors import TaskcalError

STEP = 1e-30
"""Radians; no digits cancel, so that it may be as small as floating point allows."""

SHIFT = 0.1
"""Radians by which positions are moved to see whether a real result is a constant."""

REMEDY = "give its derivative (by_joint), or write it with analytic functions of NumPy alone"


def differentiate(
    function: Callable[[np.ndarray], np.ndarray], q: Float[np.ndarray, "n joints"]
) -> Float[np.ndarray, "n p joints"]:
    """∂f/∂q of a function (n, joints) → (n, p) that treats each row by itself: Im f(q + i·h·e) / h.

    Source: Squire and Trapp (1998), Using complex variables to estimate derivatives of real functions.

    Raises:
        TaskcalError: the function does not carry complex numbers through.
    """
    columns = [_along(function, q, direction) for direction in np.eye(q.shape[1])]
    return np.stack(columns, axis=2)


def _along(
    function: Callable[[np.ndarray], np.ndarray],
    q: Float[np.ndarray, "n joints"],
    direction: Float[np.ndarray, " joints"],
) -> Float[np.ndarray, "n p"]:
    try:
        moved = np.asarray(function(q + 1j * STEP * direction))
    except TypeError as error:
        raise TaskcalError(
            f"the basis of an effect cannot be evaluated at complex positions ({error}); {REMEDY}"
        ) from error
    if np.iscomplexobj(moved):
        return np.imag(moved) / STEP
    if not np.array_equal(moved, function(q + SHIFT * direction)):
        raise TaskcalError(f"the basis of an effect drops the imaginary part of complex positions; {REMEDY}")
    return np.zeros(moved.shape)
