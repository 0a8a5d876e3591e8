"""What tells that a file is a calibration, and of which version; it takes no more than the standard library to see."""

import base64
import binascii
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from taskcal.errors import FileError, FitError, TaskcalError, shown
from taskcal.estimation.matrices import factor_positive
from taskcal.io.text_file import read_json

FORMAT = "taskcal-calibration"
FORMAT_VERSION = 7
"""Version 1 held estimate and covariance of the parameters that were estimated, and of no others; versions 1 and 2 counted
the rows of outliers among those fitted, and named no line; before version 4 no joint had an error of its own, and no
covariance was packed; before version 5 neither the joint positions nor what rows held out showed were kept; before version 6 a
tracker had measured everything; before version 7 the covariance itself was held, not its factor."""


def read_envelope(path: Path) -> dict[str, Any]:
    """The content of a calibration's file, of which only format and version are looked at.

    Raises:
        FileError: it cannot be read, is cut off, or is something else.
    """
    data = read_json(path, "calibration", "save the calibration again")
    if not isinstance(data, dict) or data.get("format") != FORMAT:
        raise FileError(
            path, f"is JSON, but not a calibration: 'format' is not '{FORMAT}'; write one with taskcal identify"
        )
    format_version = data.get("format_version")
    if type(format_version) is not int or not 1 <= format_version <= FORMAT_VERSION:
        raise FileError(
            path,
            f"has format version {shown(repr(format_version))}, this Taskcal reads 1 to {FORMAT_VERSION}; identify again, or use "
            "the Taskcal that wrote it",
        )
    return data


# A covariance as a calibration file holds it: a triangular factor of it, to the last bit, so that it is one when
# read.
#
# A large factor stands in a sixth of the room of its digits.

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
    size, numbers = _unpack(described, "covariance_factor", "lower")
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


def unpack_covariance(described: dict[str, Any]) -> Float[np.ndarray, "z z"]:
    """The covariance whose upper triangle files before version 7 hold packed.

    Raises:
        TaskcalError: as `unpack_factor`.
    """
    size, numbers = _unpack(described, "covariance", "upper")
    C = np.zeros((size, size))
    i, j = np.triu_indices(size)
    C[i, j] = C[j, i] = numbers
    return C


def _unpack(described: dict[str, Any], key: str, part: str) -> tuple[int, Float[np.ndarray, " numbers"]]:
    """Size and numbers of a packed triangle, row by row."""
    if set(described) != {"size", part}:
        raise TaskcalError(f"'{key}' has the keys {shown(', '.join(map(str, described)))}, not 'size' and '{part}'")
    size, triangle = described["size"], described[part]
    if type(size) is not int or not 0 <= size <= MOST_ENTRIES:
        raise TaskcalError(f"the size of '{key}' is {shown(repr(size))}, not a number from 0 to {MOST_ENTRIES}")
    try:
        content = base64.b64decode(triangle, validate=True)
    except (TypeError, ValueError, binascii.Error) as error:
        raise TaskcalError(f"the {part} triangle of '{key}' is not base64: {error}") from error
    wanted = size * (size + 1) // 2 * NUMBER.itemsize
    if len(content) != wanted:
        raise TaskcalError(f"the {part} triangle of '{key}' has {len(content)} bytes, one of size {size} has {wanted}")
    return size, np.frombuffer(content, dtype=NUMBER)
