"""Streamed propagation of a covariance to what is measured at the end of a chain: J·C·Jᵀ without storing J."""

import numpy as np
from jaxtyping import Float

from taskcal.geometry.compiled import compiled, inlined
from taskcal.geometry.observations import Observations, Walked, allocate_block, linearise
from taskcal.geometry.walk import expand_error_frames, in_chunks, walk_pose


@inlined
def _conjugate(J, matrix, product, out):
    """Out = J·matrix·Jᵀ, symmetric; `product` is room for a row."""
    p = J.shape[1]
    for a in range(J.shape[0]):
        product[:] = 0.0
        for j in range(p):
            v = J[a, j]
            if v != 0.0:
                for k in range(p):
                    product[k] += v * matrix[j, k]
        for b in range(a + 1):
            v = 0.0
            for k in range(p):
                v += product[k] * J[b, k]
            out[a, b] = v
            out[b, a] = v


@compiled
def _propagate(walk, seen, matrix, residual, out):
    """Store r and J·matrix·Jᵀ of every block."""
    error_frames, p = expand_error_frames(walk.e), matrix.shape[0]
    block, product = allocate_block(walk, out.shape[2], p), np.zeros(p)
    for i in range(walk.s.shape[0]):
        walk_pose(walk.steps, walk.s[i], error_frames, block.axes, block.T)
        for t in range(seen.valid.shape[1]):
            if seen.valid[i, t]:
                linearise(walk, seen, i, t, block)
                for a in range(
                    block.r.shape[0]
                ):  # assigned as a whole, the check of the shape takes longer to compile than this
                    residual[i, t, a] = block.r[a]
                _conjugate(block.J, matrix, product, out[i, t])


def propagate(
    walked: Walked, seen: Observations, covariance: Float[np.ndarray, "p p"]
) -> tuple[Float[np.ndarray, "n targets b"], Float[np.ndarray, "n targets b b"]]:
    """Residuals (measured − predicted, not whitened) and J·C·Jᵀ of every block; NaN where nothing was measured.

    Args:
        walked: the chain at every pose.
        seen: what was measured.
        covariance: C, of the layout's columns.
    """
    n, targets = seen.valid.shape
    residual = np.full((n, targets, seen.rows), np.nan)
    propagated = np.full((n, targets, seen.rows, seen.rows), np.nan)
    matrix = np.ascontiguousarray(covariance)

    def fill(rows: slice) -> None:
        _propagate(walked.arrays(rows), seen.arrays(rows), matrix, residual[rows], propagated[rows])

    in_chunks(fill, n)
    return residual, propagated
