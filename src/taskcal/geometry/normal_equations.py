"""Streamed normal equations of what is measured at the end of a chain: JᵀWJ and JᵀWr without storing J."""

from collections.abc import Callable

import numpy as np
from jaxtyping import Float

from taskcal.geometry.compiled import compiled, inlined
from taskcal.geometry.observations import Observations, Walked, allocate_block, linearise
from taskcal.geometry.walk import expand_error_frames, in_chunks, walk_pose

SQUARED, HUBER, CAUCHY = range(3)

WhitenedEquations = Callable[[np.ndarray], tuple[float, np.ndarray, np.ndarray]]
"""An estimate's cost, JᵀWr and JᵀWJ."""


@inlined
def _whiten(whitener, r, J, white):
    """Replace r by W·r, put W·J into `white`; the sum of squares of W·r."""
    square = 0.0
    for a in range(r.shape[0] - 1, -1, -1):  # W is lower triangular: row a needs rows 0…a, so go down in place
        v = 0.0
        white[a, :] = 0.0
        for b in range(a + 1):
            u = whitener[a, b]
            v += u * r[b]
            for k in range(J.shape[1]):
                white[a, k] += u * J[b, k]
        r[a] = v
        square += v * v
    return square


@inlined
def _weigh(loss, threshold, square, rows):
    """Weight of a block under the loss, and twice its cost."""
    scaled = square / rows / (threshold * threshold)
    if loss == HUBER and scaled > 1.0:
        return 1.0 / np.sqrt(scaled), rows * threshold * threshold * (2.0 * np.sqrt(scaled) - 1.0)
    if loss == CAUCHY:
        return 1.0 / (1.0 + scaled), rows * threshold * threshold * np.log1p(scaled)
    return 1.0, square


@inlined
def _add_block(weight, r, white, H, g):
    """Add a whitened block to g and to the upper half of H."""
    p = g.shape[0]
    for a in range(0, r.shape[0], 3):  # three rows at a time: a third of the traffic on H
        for j in range(p):
            u, v, x = weight * white[a, j], weight * white[a + 1, j], weight * white[a + 2, j]
            g[j] += u * r[a] + v * r[a + 1] + x * r[a + 2]
            for k in range(j, p):
                H[j, k] += u * white[a, k] + v * white[a + 1, k] + x * white[a + 2, k]


@compiled
def _accumulate(walk, seen, whitener, loss, threshold, H, g):
    """Add up H = JᵀWJ and g = JᵀWr over the poses; the cost."""
    error_frames, rows, p = expand_error_frames(walk.e), whitener.shape[2], g.shape[0]
    block, white = allocate_block(walk, rows, p), np.zeros((rows, p))
    cost = 0.0
    for i in range(walk.s.shape[0]):
        walk_pose(walk.steps, walk.s[i], error_frames, block.axes, block.T)
        for t in range(seen.valid.shape[1]):
            if seen.valid[i, t]:
                linearise(walk, seen, i, t, block)
                weight, double = _weigh(loss, threshold, _whiten(whitener[i, t], block.r, block.J, white), rows)
                cost += 0.5 * double
                _add_block(weight, block.r, white, H, g)
    for j in range(p):
        for k in range(j):
            H[j, k] = H[k, j]
    return cost


def normal_equations(
    walked: Walked,
    seen: Observations,
    whitener: Float[np.ndarray, "n targets b b"],
    loss: int = SQUARED,
    threshold: float = 1.0,
) -> tuple[float, Float[np.ndarray, " p"], Float[np.ndarray, "p p"]]:
    """Cost, JᵀWr and JᵀWJ of the whitened residuals r = whitener·(measured − predicted), W the loss's weights.

    A loss acts on the root mean square of a block's whitened residuals, so that it does not depend on the axes:
    the cost of a block of b rows is ½·b·t²·ρ(|r|²/(b·t²)), with threshold t.
    """
    p = walked.layout.count

    def add(rows: slice) -> tuple[float, np.ndarray, np.ndarray]:
        H, g = np.zeros((p, p)), np.zeros(p)
        cost = _accumulate(walked.arrays(rows), seen.arrays(rows), whitener[rows], loss, threshold, H, g)
        return cost, g, H

    parts = in_chunks(add, len(walked.s))
    if len(parts) == 1:
        return parts[0]
    costs, gs, Hs = zip(*parts, strict=True)
    return sum(costs), np.sum(gs, axis=0), np.sum(Hs, axis=0)
