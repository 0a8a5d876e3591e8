"""What is known of two sockets of one block, and how the errors of several such distances go together."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

CALLIPER = 2e-5
"""Standard uncertainty of a distance of two sockets where nothing is said of it, metres: what a good calliper leaves."""

SAME_BLOCK = 1e-6
"""By how much the distance of two sockets differs between the places where their block stands, metres: a degree of warmth."""


@dataclass(frozen=True, kw_only=True)
class SocketDistance:
    """What is known of two sockets of one block."""

    a: str
    b: str
    distance: float
    """Between their centres, metres."""
    uncertainty: float
    """Its standard deviation, metres."""
    statement: str = ""
    """Name of what was measured once and holds of one block at several places, where its error is the same; none where it was
    measured by itself."""


def whiten_distances(distances: Sequence[SocketDistance]) -> Float[np.ndarray, "k k"]:
    """One over the Cholesky factor of the covariance of stated distances: what was measured once errs alike everywhere."""
    u = np.array([d.uncertainty for d in distances])
    names = [d.statement for d in distances]
    alike = np.array([[bool(a) and a == b for b in names] for a in names], dtype=bool).reshape(len(u), len(u))
    apart = np.where(alike.any(axis=1), SAME_BLOCK, 0.0)
    covariance = np.where(alike, u[:, None] * u, 0.0)
    covariance[np.diag_indices(len(u))] = u**2 + apart**2
    return np.linalg.inv(np.linalg.cholesky(covariance))
