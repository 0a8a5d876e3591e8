"""Residual fields, as calibrations of earlier versions hold them."""

import numpy as np
from scipy.spatial.distance import cdist

from taskcal.identification.field import ResidualField


def field_through(q: np.ndarray, values: np.ndarray, length: float = 0.8, ratio: float = 0.01) -> ResidualField:
    """The field that a Gaussian process of this length makes of values at joint positions, `ratio` its share of noise."""
    K = np.exp(-0.5 * cdist(q / length, q / length, "sqeuclidean")) + ratio * np.eye(len(q))
    deviation = np.sqrt((values**2).mean(axis=0))
    return ResidualField(
        q=q,
        weights=np.linalg.solve(K, values),
        lengths=np.full(q.shape[1], length),
        deviation=deviation,
        noise=np.sqrt(ratio) * deviation,
    )
