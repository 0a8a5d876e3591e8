"""Streamed normal equations of points measured at the end of a chain: JᵀWJ and JᵀWr without storing J."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from taskcal.kernels.chunks import in_chunks
from taskcal.kernels.compiled import compiled, inlined, part
from taskcal.kernels.lanes import LANES, as_lanes
from taskcal.kernels.observations import (
    PointBlock,
    SeenPoints,
    Walked,
    allocate_points,
    linearise_point,
    take_points,
)
from taskcal.kernels.products import add_products, allocate_products, symmetric
from taskcal.kernels.walk import Axes, expand_error_frames, take_lanes, walk_pose

SQUARED, HUBER, CAUCHY = range(3)

POSES = 2048
"""Poses a thread takes at a time."""

WhitenedEquations = Callable[[np.ndarray], tuple[float, np.ndarray, np.ndarray]]
"""An estimate's cost, JᵀWr and JᵀWJ."""


class _Loss(NamedTuple):
    kind: int
    threshold: float


@inlined
def _weigh(loss, threshold, square, rows):
    """Weight of a block under the loss, and twice its cost."""
    scaled = square / rows / (threshold * threshold)
    if loss == HUBER and scaled > 1.0:
        return 1.0 / np.sqrt(scaled), rows * threshold * threshold * (2.0 * np.sqrt(scaled) - 1.0)
    if loss == CAUCHY:
        return 1.0 / (1.0 + scaled), rows * threshold * threshold * np.log1p(scaled)
    return 1.0, square


def weigh(
    loss: int, threshold: float, square: Float[np.ndarray, " blocks"], rows: int
) -> tuple[Float[np.ndarray, " blocks"], Float[np.ndarray, " blocks"]]:
    """Weight of every block under the loss, and twice its cost.

    Args:
        loss: SQUARED, HUBER or CAUCHY.
        threshold: of the root mean square of a block's whitened residuals.
        square: sum of squares of these.
        rows: of a block.
    """
    size = rows * threshold * threshold
    scaled = np.maximum(square / size, 1.0 if loss == HUBER else 0.0)
    if loss == HUBER:
        return 1.0 / np.sqrt(scaled), np.where(square > size, size * (2.0 * np.sqrt(scaled) - 1.0), square)
    if loss == CAUCHY:
        return 1.0 / (1.0 + scaled), size * np.log1p(scaled)
    return np.ones_like(square), square


@part
def _take_whitener(valid, whitener, first, t, out):
    """Copy lower triangles to lanes; zeros where nothing was measured, and beyond the last pose."""
    n = valid.shape[0]
    for lane in range(LANES):
        i = min(first + lane, n - 1)
        there = first + lane < n and valid[i, t]
        for a in range(3):
            for b in range(a + 1):
                out[a, b, lane] = whitener[i, t, a, b] if there else 0.0


@compiled
def _accumulate(walk, seen, whitener, loss, room, products):
    """Add up the products of whitened columns and residuals, which come last, eight poses at a time; the cost."""
    error_frames, p, W, rows = (
        expand_error_frames(walk.e),
        products.columns,
        as_lanes(room.work),
        as_lanes(products.block),
    )
    axes = Axes(as_lanes(room.joints), as_lanes(room.frames), room.slides)
    s, factor, y, r, J = as_lanes(room.s), as_lanes(room.factor), as_lanes(room.y), as_lanes(room.r), as_lanes(room.J)
    block = PointBlock(axes, as_lanes(room.T), r, J)
    cost = 0.0
    for first in range(0, walk.s.shape[0], LANES):
        take_lanes(walk.s, first, room.s)
        take_lanes(walk.factor, first, room.factor)
        walk_pose(walk.steps, s, error_frames, axes, block.T)
        for t in range(seen.valid.shape[1]):
            take_points(seen.position, seen.valid, first, t, room.y)
            linearise_point(walk.points, walk.layout, factor, y, t, block)
            _take_whitener(seen.valid, whitener, first, t, room.work)
            r2 = W[2, 0] * r[0] + W[2, 1] * r[1] + W[2, 2] * r[2]
            r1, r0 = W[1, 0] * r[0] + W[1, 1] * r[1], W[0, 0] * r[0]
            block.r[0] = r0 * r0 + r1 * r1 + r2 * r2
            for lane in range(LANES):
                weight, double = _weigh(loss.kind, loss.threshold, room.r[0, lane], 3)
                room.r[1, lane] = np.sqrt(weight)
                cost += 0.5 * double
            # the first vector of these rows in the block
            used = 3 * ((first // LANES * seen.valid.shape[1] + t) % (rows.shape[1] // 3))
            root = r[1]
            rows[p, used], rows[p, used + 1], rows[p, used + 2] = root * r0, root * r1, root * r2
            w00, w10, w11 = root * W[0, 0], root * W[1, 0], root * W[1, 1]
            w20, w21, w22 = root * W[2, 0], root * W[2, 1], root * W[2, 2]
            for k in range(p):
                u, v, w = J[0, k], J[1, k], J[2, k]
                rows[k, used], rows[k, used + 1] = w00 * u, w10 * u + w11 * v
                rows[k, used + 2] = w20 * u + w21 * v + w22 * w
            last = first + LANES >= walk.s.shape[0] and t + 1 == seen.valid.shape[1]
            if used + 3 == rows.shape[1] or last:
                add_products(rows, used + 3, products.sums)
    return cost


def normal_equations(
    walked: Walked,
    seen: SeenPoints,
    whitener: Float[np.ndarray, "n targets 3 3"],
    loss: int = SQUARED,
    threshold: float = 1.0,
) -> tuple[float, Float[np.ndarray, " p"], Float[np.ndarray, "p p"]]:
    """Cost, JᵀWr and JᵀWJ of the whitened residuals r = whitener·(measured − predicted), W the loss's weights.

    A loss acts on the root mean square of a block's whitened residuals, so that it does not depend on the axes:
    the cost of a block of b = 3 rows is ½·b·t²·ρ(|r|²/(b·t²)), with threshold t.
    """
    p, weighing = walked.layout.count, _Loss(loss, float(threshold))

    def add(rows: slice) -> tuple[float, np.ndarray]:
        white = whitener[rows]
        n, targets = white.shape[:2]
        products = allocate_products(p, 3 * targets * -(-n // LANES))
        room = allocate_points(walked)
        return _accumulate(walked.arrays(rows), seen.take(rows), white, weighing, room, products), products.sums

    costs, sums = zip(*in_chunks(add, len(walked.s), POSES), strict=True)
    total = symmetric(sums[0] if len(sums) == 1 else np.sum(sums, axis=0))
    return sum(costs), total[:p, p].copy(), total[:p, :p].copy()
