"""Streamed propagation of a covariance to points at the end of a chain: J·C·Jᵀ without storing J."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from taskcal.kernels.chunks import in_chunks
from taskcal.kernels.compiled import compiled, part
from taskcal.kernels.lanes import LANES, as_lanes, rooms, square_root
from taskcal.kernels.observations import (
    PointBlock,
    SeenPoints,
    Walked,
    allocate_points,
    linearise_point,
    take_points,
)
from taskcal.kernels.products import add_products
from taskcal.kernels.walk import Axes, expand_error_frames, take_lanes, walk_pose


@part
def conjugate_lanes(J, matrix, out):
    """The lower triangle of J·matrix·Jᵀ, matrix symmetric."""
    for a in range(3):
        for b in range(a + 1):
            out[a, b] = 0.0
    for k in range(matrix.shape[0]):
        u, v, w = matrix[k, 0] * J[0, 0], matrix[k, 0] * J[1, 0], matrix[k, 0] * J[2, 0]
        for j in range(1, matrix.shape[0]):
            c = matrix[k, j]
            u, v, w = u + c * J[0, j], v + c * J[1, j], w + c * J[2, j]
        x, y, z = J[0, k], J[1, k], J[2, k]
        out[0, 0], out[1, 0], out[2, 0] = out[0, 0] + u * x, out[1, 0] + v * x, out[2, 0] + w * x
        out[1, 1], out[2, 1], out[2, 2] = out[1, 1] + v * y, out[2, 1] + w * y, out[2, 2] + w * z


@compiled
def _propagate(walk, seen, matrix, room, residual, out):
    """Store r and J·matrix·Jᵀ of every block, eight poses at a time."""
    error_frames, n, s, factor, y = (
        expand_error_frames(walk.e),
        len(walk.s),
        as_lanes(room.s),
        as_lanes(room.factor),
        as_lanes(room.y),
    )
    axes = Axes(as_lanes(room.joints), as_lanes(room.frames), room.slides)
    block = PointBlock(axes, as_lanes(room.T), as_lanes(room.r), as_lanes(room.J))
    for first in range(0, n, LANES):
        take_lanes(walk.s, first, room.s)
        take_lanes(walk.factor, first, room.factor)
        walk_pose(walk.steps, s, error_frames, axes, block.T)
        for t in range(seen.valid.shape[1]):
            take_points(seen.position, seen.valid, first, t, room.y)
            linearise_point(walk.points, walk.layout, factor, y, t, block)
            conjugate_lanes(block.J, matrix, as_lanes(room.work))
            for lane in range(min(LANES, n - first)):
                if seen.valid[first + lane, t]:
                    for a in range(3):
                        residual[first + lane, t, a] = room.r[a, lane]
                        for b in range(3):
                            out[first + lane, t, a, b] = room.work[max(a, b), min(a, b), lane]


def propagate_points(
    walked: Walked, seen: SeenPoints, covariance: Float[np.ndarray, "p p"]
) -> tuple[Float[np.ndarray, "n targets 3"], Float[np.ndarray, "n targets 3 3"]]:
    """Residuals (measured − predicted, not whitened) and J·C·Jᵀ of every point; NaN where nothing was measured.

    Args:
        walked: the chain at every pose.
        seen: what was measured.
        covariance: C, of the layout's columns, one at least.
    """
    n, targets = seen.valid.shape
    residual, propagated = np.full((n, targets, 3), np.nan), np.full((n, targets, 3, 3), np.nan)
    matrix = np.ascontiguousarray(covariance)

    def fill(rows: slice) -> None:
        room = allocate_points(walked)
        _propagate(walked.arrays(rows), seen.take(rows), matrix, room, residual[rows], propagated[rows])

    in_chunks(fill, n)
    return residual, propagated


# Measured points about an estimate, kept eight poses at a time: what a fit of few rows weighs and propagates again
# and again.


class KeptPoints(NamedTuple):
    """Blocks of one target at eight poses each, in the order of the poses; the lanes are along each array's last axis.

    What belongs to a target that was not seen, or to poses beyond the last, weighs nothing.
    """

    residual: Float[np.ndarray, "blocks 3 lanes"]
    """Measured less predicted, metres."""
    by_entry: Float[np.ndarray, "blocks 3 p lanes"]
    """Derivative of what is predicted by the entries of an estimate."""
    noise: Float[np.ndarray, "blocks 3 3 lanes"]
    """Covariance of the measurements, m²."""
    seen: Float[np.ndarray, "blocks lanes"]
    """One where something was measured, else zero."""
    whitener: Float[np.ndarray, "blocks 3 3 lanes"]
    """Lower triangular W with W·(noise + model error)·Wᵀ = 1."""
    explained: Float[np.ndarray, "blocks 3 3 lanes"]
    """Covariance of what is predicted, its lower triangle, m²."""


def keep_room(poses: int, targets: int, p: int) -> KeptPoints:
    """Room for so many poses, targets and entries of an estimate."""
    blocks = -(-poses // LANES) * targets
    return KeptPoints(*rooms((blocks, 3), (blocks, 3, p), (blocks, 3, 3), (blocks,), (blocks, 3, 3), (blocks, 3, 3)))


@part
def keep_noise(noise, valid, kept):
    """Copy the covariances of what was measured; where nothing was, one that does not matter."""
    n, targets = valid.shape
    for b in range(kept.seen.shape[0]):
        first, t = b // targets * LANES, b % targets
        for lane in range(LANES):
            i = first + lane
            there = i < n and valid[min(i, n - 1), t]
            kept.seen[b, lane] = 1.0 if there else 0.0
            for c in range(3):
                for d in range(3):
                    other = 1.0 if c == d else 0.0
                    kept.noise[b, c, d, lane] = noise[min(i, n - 1), t, c, d] if there else other


@part
def keep_points(walk, seen, room, kept):
    """Walk every pose, and keep the residuals and derivatives."""
    error_frames, n, targets = expand_error_frames(walk.e), walk.s.shape[0], seen.valid.shape[1]
    axes = Axes(as_lanes(room.joints), as_lanes(room.frames), room.slides)
    s, factor, y, T = as_lanes(room.s), as_lanes(room.factor), as_lanes(room.y), as_lanes(room.T)
    r, J = as_lanes(kept.residual), as_lanes(kept.by_entry)
    for first in range(0, n, LANES):
        take_lanes(walk.s, first, room.s)
        take_lanes(walk.factor, first, room.factor)
        walk_pose(walk.steps, s, error_frames, axes, T)
        for t in range(targets):
            b = first // LANES * targets + t
            take_points(seen.position, seen.valid, first, t, room.y)
            linearise_point(walk.points, walk.layout, factor, y, t, PointBlock(axes, T, r[b], J[b]))


@part
def whiten_kept(kept, variance):
    """Fill the whiteners under a model error of that variance, m²."""
    R, W, seen = as_lanes(kept.noise), as_lanes(kept.whitener), as_lanes(kept.seen)
    for b in range(R.shape[0]):
        C, out = R[b], W[b]
        w00 = 1.0 / square_root(C[0, 0] + variance)
        e10 = w00 * C[1, 0]
        w11 = 1.0 / square_root(C[1, 1] + variance - e10 * e10)
        e20 = w00 * C[2, 0]
        w10 = -w11 * e10 * w00
        e21 = w10 * C[2, 0] + w11 * C[2, 1]
        w22 = 1.0 / square_root(C[2, 2] + variance - e20 * e20 - e21 * e21)
        out[0, 0], out[1, 0], out[1, 1] = seen[b] * w00, seen[b] * w10, seen[b] * w11
        out[2, 0], out[2, 1] = -seen[b] * w22 * (e20 * w00 + e21 * w10), -seen[b] * w22 * e21 * w11
        out[2, 2] = seen[b] * w22


@part
def add_kept(kept, products):
    """Add up the products of whitened columns and residuals, which come last."""
    r, J, W, rows = as_lanes(kept.residual), as_lanes(kept.by_entry), as_lanes(kept.whitener), as_lanes(products.block)
    p, blocks = products.columns, r.shape[0]
    for j in range(products.sums.shape[0]):
        for k in range(products.sums.shape[1]):
            products.sums[j, k] = 0.0
    for b in range(blocks):
        w00, w10, w11 = W[b, 0, 0], W[b, 1, 0], W[b, 1, 1]
        w20, w21, w22 = W[b, 2, 0], W[b, 2, 1], W[b, 2, 2]
        used = 3 * (b % (rows.shape[1] // 3))
        u, v, w = r[b, 0], r[b, 1], r[b, 2]
        rows[p, used], rows[p, used + 1], rows[p, used + 2] = w00 * u, w10 * u + w11 * v, w20 * u + w21 * v + w22 * w
        for k in range(p):
            u, v, w = J[b, 0, k], J[b, 1, k], J[b, 2, k]
            rows[k, used], rows[k, used + 1] = w00 * u, w10 * u + w11 * v
            rows[k, used + 2] = w20 * u + w21 * v + w22 * w
        if used + 3 == rows.shape[1] or b + 1 == blocks:
            add_products(rows, used + 3, products.sums)


@part
def propagate_kept(kept, covariance):
    """Fill the covariance of what is predicted, of that of an estimate."""
    J, out = as_lanes(kept.by_entry), as_lanes(kept.explained)
    for b in range(J.shape[0]):
        conjugate_lanes(J[b], covariance, out[b])


@part
def move_kept(kept, step):
    """Take what a step of the estimate explains, to first order, off the residuals."""
    r, J = as_lanes(kept.residual), as_lanes(kept.by_entry)
    for b in range(r.shape[0]):
        for a in range(3):
            v = r[b, a]
            for k in range(step.shape[0]):
                v -= step[k] * J[b, a, k]
            r[b, a] = v
