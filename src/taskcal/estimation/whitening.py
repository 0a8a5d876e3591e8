"""Many small covariances factored at once: LAPACK takes some microseconds for each."""

import numpy as np
from jaxtyping import Float


def inverse_factors(covariance: Float[np.ndarray, "*n b b"]) -> Float[np.ndarray, "*n b b"]:
    """Lower triangular W with W·covariance·Wᵀ = I, the inverse of Cholesky's factor; NaN where there is none."""
    b, W = covariance.shape[-1], np.zeros(covariance.shape)
    for i in range(b):
        # of row i what the rows before it explain, one number of all blocks after another
        explained = [sum(W[..., j, k] * covariance[..., i, k] for k in range(j + 1)) for j in range(i)]
        left = covariance[..., i, i] - sum(part * part for part in explained)
        scale = 1.0 / np.sqrt(np.where(left > 0.0, left, np.nan))
        W[..., i, i] = scale
        for k in range(i):
            W[..., i, k] = -scale * sum(explained[j] * W[..., j, k] for j in range(k, i))
    return W
