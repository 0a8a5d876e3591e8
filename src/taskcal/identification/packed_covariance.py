"""A large covariance as a calibration file holds it: the upper triangle to the last bit, in a sixth of the room of its digits."""

import base64
import binascii
from typing import Any

import numpy as np
from jaxtyping import Float

from taskcal.errors import TaskcalError, shown

PACKED_FROM = 150
"""Entries from which on a covariance is packed; smaller ones are left for people to read."""

MOST_ENTRIES = 20_000
"""Of a packed covariance; the effects of a seven-joint robot have under a thousand."""

NUMBER = np.dtype("<f8")
"""Binary64, the least significant byte first, on every machine."""


def describe_covariance(C: Float[np.ndarray, "z z"]) -> Any:
    """A covariance for JSON: its rows, or its packed upper triangle where it is large and symmetric to the last bit."""
    if len(C) < PACKED_FROM or not np.array_equal(C, C.T):
        return C.tolist()
    upper = C[np.triu_indices(len(C))].astype(NUMBER)
    return {"size": len(C), "upper": base64.b64encode(upper.tobytes()).decode("ascii")}


def unpack_covariance(described: dict[str, Any]) -> Float[np.ndarray, "z z"]:
    """The covariance of a packed upper triangle.

    Raises:
        TaskcalError: it lacks a part, its size is not a number of entries, or it does not hold as many numbers.
    """
    if set(described) != {"size", "upper"}:
        raise TaskcalError(f"'covariance' has the keys {shown(', '.join(map(str, described)))}, not 'size' and 'upper'")
    size, upper = described["size"], described["upper"]
    if type(size) is not int or not 0 <= size <= MOST_ENTRIES:
        raise TaskcalError(f"the size of 'covariance' is {shown(repr(size))}, not a number from 0 to {MOST_ENTRIES}")
    try:
        content = base64.b64decode(upper, validate=True)
    except (TypeError, ValueError, binascii.Error) as error:
        raise TaskcalError(f"the upper triangle of 'covariance' is not base64: {error}") from error
    wanted = size * (size + 1) // 2 * NUMBER.itemsize
    if len(content) != wanted:
        raise TaskcalError(
            f"the upper triangle of 'covariance' has {len(content)} bytes, one of size {size} has {wanted}"
        )
    C = np.zeros((size, size))
    i, j = np.triu_indices(size)
    C[i, j] = C[j, i] = np.frombuffer(content, dtype=NUMBER)
    return C
