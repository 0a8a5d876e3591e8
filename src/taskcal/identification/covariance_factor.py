"""A covariance as a calibration file holds it: a triangular factor of it, to the last bit, so that it is one when read.

A large factor stands in a sixth of the room of its digits.
"""

import base64
import binascii
from collections.abc import Sequence
from typing import Any

import numpy as np
from jaxtyping import Float

from taskcal.errors import FitError, TaskcalError, shown
from taskcal.estimation.matrices import factor_positive

PACKED_FROM = 150
"""Entries from which on a factor is packed; smaller ones are left for people to read."""

MOST_ENTRIES = 20_000
"""Of a packed factor; the effects of a seven-joint robot have under a thousand."""

ROUNDING = 1e-9
"""How far under zero rounding may leave an eigenvalue of the correlations, for each entry; sums of squares leave 10⁻¹³."""

NUMBER = np.dtype("<f8")
"""Binary64, the least significant byte first, on every machine."""


def spread_of(C: Float[np.ndarray, "z z"]) -> Float[np.ndarray, "z z"]:
    """Lower triangular B with B·Bᵀ the covariance C of a fit.

    Raises:
        FitError: C is none, as a combination of its entries would have a negative variance.
    """
    try:
        return factor_positive(C, ROUNDING * len(C))
    except np.linalg.LinAlgError as error:
        raise FitError(
            f"the covariance of the fit is none: {error}; the rows do not determine all that is fitted: fit fewer parameters "
            "or effects (--keep, --effects)"
        ) from error


def describe_factor(B: Float[np.ndarray, "z z"]) -> Any:
    """A lower triangular factor for JSON: its rows up to the diagonal, or packed where it is large."""
    if len(B) < PACKED_FROM:
        return [row[: i + 1].tolist() for i, row in enumerate(B)]
    lower = B[np.tril_indices(len(B))].astype(NUMBER)
    return {"size": len(B), "lower": base64.b64encode(lower.tobytes()).decode("ascii")}


def unpack_factor(described: dict[str, Any]) -> list[list[float]]:
    """The rows of a packed factor, up to the diagonal.

    Raises:
        TaskcalError: it lacks a part, its size is not a number of entries, or it does not hold as many numbers.
    """
    if set(described) != {"size", "lower"}:
        keys = ", ".join(map(str, described))
        raise TaskcalError(f"'covariance_factor' has the keys {shown(keys)}, not 'size' and 'lower'")
    size, triangle = described["size"], described["lower"]
    if type(size) is not int or not 0 <= size <= MOST_ENTRIES:
        raise TaskcalError(
            f"the size of 'covariance_factor' is {shown(repr(size))}, not a number from 0 to {MOST_ENTRIES}"
        )
    try:
        content = base64.b64decode(triangle, validate=True)
    except (TypeError, ValueError, binascii.Error) as error:
        raise TaskcalError(f"the lower triangle of 'covariance_factor' is not base64: {error}") from error
    wanted = size * (size + 1) // 2 * NUMBER.itemsize
    if len(content) != wanted:
        raise TaskcalError(
            f"the lower triangle of 'covariance_factor' has {len(content)} bytes, one of size {size} has {wanted}"
        )
    numbers = np.frombuffer(content, dtype=NUMBER)
    return [row.tolist() for row in np.split(numbers, np.cumsum(np.arange(1, size)))] if size else []


def factor_of(rows: Sequence[Sequence[float]], size: int) -> Float[np.ndarray, "z z"]:
    """The factor that has these rows up to the diagonal.

    Raises:
        TaskcalError: there are more or fewer rows, or one has another number of entries.
    """
    if len(rows) != size:
        raise TaskcalError(f"'covariance_factor' has {len(rows)} rows, not {size}")
    B = np.zeros((size, size))
    for i, row in enumerate(rows):
        if len(row) != i + 1:
            raise TaskcalError(f"'covariance_factor' {i + 1} has {len(row)} numbers, not {i + 1}")
        B[i, : i + 1] = row
    return B
