"""Which directions of a target's place on the tool the rows do not tell."""

import numpy as np
from jaxtyping import Float

LOCATED_WITHIN = 0.02
"""A direction is determined if its standard deviation is below this, metres."""

LEAST_ERROR = 1e-3
"""A residual under this, metres, is taken for it: a robot that happens to be exact has not more orientations for it."""


def unlocated(
    by_place: Float[np.ndarray, "m 3"], by_other: Float[np.ndarray, "m u"], rms: float
) -> Float[np.ndarray, "3 3"]:
    """Projector onto directions of the place that are not determined beside what else is unknown.

    Args:
        by_place: derivative of what is predicted, in metres, by the place.
        by_other: the same by all other unknowns.
        rms: of the residuals, metres.
    """
    scale = np.linalg.norm(by_other, axis=0)
    q = np.linalg.svd(by_other[:, scale > 0] / scale[scale > 0], full_matrices=False)
    basis = q[0][:, q[1] > 1e-7 * q[1].max(initial=0.0)]
    left = by_place - basis @ (basis.T @ by_place)
    values, vectors = np.linalg.eigh(left.T @ left)
    weak = vectors[:, values < (max(rms, LEAST_ERROR) / LOCATED_WITHIN) ** 2]
    return weak @ weak.T
