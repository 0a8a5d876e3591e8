"""Points measured at the end of a chain: normal equations and propagated covariances, some poses at a time.

The compiled walk leaves the residuals and derivatives of a tile of poses column by column. Their products, JᵀWJ and JᵀWr or J·C·Jᵀ,
are BLAS's; J is stored for no more than a tile.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from taskcal.kernels.blocks import BLOCK
from taskcal.kernels.chain import Chain, Columns
from taskcal.kernels.chunks import in_chunks
from taskcal.kernels.walk import (
    NO_COLUMNS,
    NO_POSES,
    NOT_WHITENED,
    TILE,
    Buffers,
    Points,
    SeenPoints,
    WalkArrays,
    WalkOutput,
    walk_points,
)


@dataclass(frozen=True, eq=False)
class Walked:
    """A chain with everything that a pass over measured poses needs besides the measurements."""

    chain: Chain
    s: Float[np.ndarray, "n joints"]
    e: Float[np.ndarray, "frames 6"]
    layout: Columns
    factor: Float[np.ndarray, "n pairs"]
    points: Points

    def rows(
        self, rows: slice, seen: SeenPoints, whitener: Float[np.ndarray, "n targets 3 3"] = NOT_WHITENED
    ) -> Float[np.ndarray, "p+1 blocks 3*poses"]:
        """Derivatives of some poses' points, column by column and a block of a target behind another; at last, residuals."""
        own, measured = self.s[rows], seen.take(rows)
        at = WalkArrays(self.chain.steps, own, self.e, self.layout.arrays, self.factor[rows], self.points)
        blocks = -(-len(own) // BLOCK) * len(self.points.position)
        out = np.zeros((self.layout.count + 1, blocks, 3 * BLOCK))
        buffers = Buffers.of(own.shape[1], len(self.e), self.factor.shape[1])
        walk_points(at, measured, whitener[rows], buffers, WalkOutput(NO_POSES, NO_COLUMNS, out))
        return out


# Normal equations.

POSES = 2048
"""Poses of other kinds of observation that are linearised at a time."""

WhitenedEquations = Callable[[np.ndarray], tuple[float, np.ndarray, np.ndarray]]
"""An estimate's cost, JᵀWr and JᵀWJ."""


def normal_equations(
    walked: Walked, seen: SeenPoints, whitener: Float[np.ndarray, "n targets 3 3"]
) -> tuple[float, Float[np.ndarray, " p"], Float[np.ndarray, "p p"]]:
    """Cost ½·rᵀr, JᵀWr and JᵀWJ of the residuals r = measured − predicted, whitened: W = whitenerᵀ·whitener."""
    p = walked.layout.count

    def add(rows: slice) -> np.ndarray:
        flat = walked.rows(rows, seen, whitener).reshape(p + 1, -1)
        return flat @ flat.T

    sums = in_chunks(add, len(walked.s), TILE)
    costs = [0.5 * float(one[p, p]) for one in sums]
    total = sums[0] if len(sums) == 1 else np.sum(sums, axis=0)
    return sum(costs), total[:p, p].copy(), total[:p, :p].copy()


# Covariances of what is predicted.


def propagate_points(
    walked: Walked, seen: SeenPoints, covariance: Float[np.ndarray, "p p"]
) -> tuple[Float[np.ndarray, "n targets 3"], Float[np.ndarray, "n targets 3 3"]]:
    """Residuals (measured − predicted, not whitened) and J·C·Jᵀ of every point; NaN where nothing was measured.

    Args:
        walked: the chain at every pose.
        seen: what was measured.
        covariance: C, of the layout's columns, one at least.
    """
    (n, targets), p = seen.valid.shape, len(covariance)
    residual, propagated = np.full((n, targets, 3), np.nan), np.full((n, targets, 3, 3), np.nan)

    def by_pose(blocks: Float[np.ndarray, "blocks poses"], valid: np.ndarray) -> np.ndarray:
        return blocks.reshape(-1, targets, BLOCK).swapaxes(1, 2).reshape(-1, targets)[: len(valid)][valid]

    def fill(rows: slice) -> None:
        A, valid = walked.rows(rows, seen), seen.valid[rows]
        J = A[:p].reshape(p, -1, 3, BLOCK)
        moved = (covariance @ A[:p].reshape(p, -1)).reshape(J.shape)
        for a in range(3):
            residual[rows][valid, a] = by_pose(A[p].reshape(-1, 3, BLOCK)[:, a], valid)
            for b in range(a + 1):
                own = by_pose(np.einsum("kni,kni->ni", moved[:, :, a], J[:, :, b]), valid)
                propagated[rows][valid, a, b] = propagated[rows][valid, b, a] = own

    in_chunks(fill, n, TILE)
    return residual, propagated
