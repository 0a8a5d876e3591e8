"""Arrays and rigid transforms as files describe them: nested lists, checked."""

from typing import Any

import numpy as np
from jaxtyping import Float

from taskcal.errors import TaskcalError

RIGID_TOLERANCE = 1e-6
"""How far a transform's rotation may be from one; files keep sixteen digits."""


def array_of(key: str, values: Any, shape: tuple[int, ...]) -> np.ndarray:
    """Nested lists of numbers as an array; NaN for null.

    Raises:
        TaskcalError: they have another shape, or none; the message names the key.
    """
    try:
        array = np.array(values, dtype=float)
    except ValueError as error:
        raise TaskcalError(f"the rows of '{key}' differ in length") from error
    if array.size == 0 and 0 in shape:  # nothing was estimated: JSON has no empty matrix
        array = np.zeros(shape)
    return of_shape(key, array, shape)


def of_shape(key: str, array: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    """An array, where it has this shape.

    Raises:
        TaskcalError: it has another.
    """
    if array.shape != shape:
        raise TaskcalError(f"'{key}' has shape {array.shape}, not {shape}")
    return array


def rigid(key: str, T: Float[np.ndarray, "*n 4 4"]) -> Float[np.ndarray, "*n 4 4"]:
    """Transforms, where they neither scale, shear nor reflect.

    Raises:
        TaskcalError: one of them does.
    """
    for number, one in enumerate(T.reshape(-1, 4, 4), start=1):
        R = one[:3, :3]
        off = float(np.abs(R.T @ R - np.eye(3)).max())
        if off > RIGID_TOLERANCE or np.linalg.det(R) < 0.0 or (one[3] != (0.0, 0.0, 0.0, 1.0)).any():
            place = f"'{key}'" if T.ndim == 2 else f"'{key}' {number}"
            scale = float(np.linalg.norm(R) / np.sqrt(3.0))
            raise TaskcalError(
                f"{place} is not a rigid transform: its axes have length {scale:.6g} and are {off:.2g} off"
            )
    return T
