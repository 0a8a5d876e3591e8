"""Points measured at the end of a chain: normal equations and propagated covariances, streamed.

A pass goes over the poses, eight at a time, and at each over the targets that were seen, and fills a block with each one's residual
and derivative. It adds up JᵀWJ and JᵀWr, or takes J·C·Jᵀ, without storing J.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from taskcal.kernels.chain import Chain, Columns, Layout, Steps
from taskcal.kernels.chunks import in_chunks
from taskcal.kernels.compiled import compiled, inlined, part
from taskcal.kernels.lanes import LANES, as_lanes
from taskcal.kernels.products import add_products, allocate_products, symmetric
from taskcal.kernels.walk import Axes, Buffers, axes_of, expand_error_frames, fill_columns, take_lanes, walk_pose

# A measured point that is fixed to the end of a chain.


@part
def linearise_point(targets, layout, factor, y, t, block):
    """Residual (measured less predicted) of target t, measured at y, and the derivative J of the prediction."""
    T, r, J = block.T, block.r, block.J
    points, columns = targets.position, targets.columns
    a, b, c = points[t, 0], points[t, 1], points[t, 2]
    x0 = T[0, 3] + T[0, 0] * a + T[0, 1] * b + T[0, 2] * c
    x1 = T[1, 3] + T[1, 0] * a + T[1, 1] * b + T[1, 2] * c
    x2 = T[2, 3] + T[2, 0] * a + T[2, 1] * b + T[2, 2] * c
    fill_columns(block.axes, layout, factor, x0, x1, x2, J)
    for other in range(columns.shape[0]):
        for d in range(3):
            k = columns[other, d]
            if k >= 0:
                for row in range(3):
                    J[row, k] = T[row, d] if other == t else 0.0
    r[0], r[1], r[2] = y[0] - x0, y[1] - x1, y[2] - x2


class Points(NamedTuple):
    """Where the targets sit in the end's frame, and which columns belong to that."""

    position: Float[np.ndarray, "targets 3"]
    """Target centres, metres."""
    columns: Int[np.ndarray, "targets 3"]
    """Column of each coordinate, −1 where it is held fixed."""


class WalkArrays(NamedTuple):
    """The arrays of `Walked`."""

    steps: Steps
    s: Float[np.ndarray, "n joints"]
    e: Float[np.ndarray, "frames 6"]
    layout: Layout
    factor: Float[np.ndarray, "n pairs"]
    points: Points


class SeenPoints(NamedTuple):
    """Points fixed to the chain's end, as measured in the frame of its start."""

    position: Float[np.ndarray, "n targets 3"]
    """Metres."""
    valid: Bool[np.ndarray, "n targets"]
    """False where the beam was lost."""

    def take(self, rows: slice) -> "SeenPoints":
        """Some of the poses."""
        return SeenPoints(self.position[rows], self.valid[rows])


@dataclass(frozen=True, eq=False)
class Walked:
    """A chain with everything that a pass over measured poses needs besides the measurements."""

    chain: Chain
    s: Float[np.ndarray, "n joints"]
    e: Float[np.ndarray, "frames 6"]
    layout: Columns
    factor: Float[np.ndarray, "n pairs"]
    points: Points

    def arrays(self, rows: slice) -> WalkArrays:
        """Some of the poses, for a compiled pass."""
        return WalkArrays(self.chain.steps, self.s[rows], self.e, self.layout.arrays, self.factor[rows], self.points)


class PointBlock(NamedTuple):
    """One pose as walked, or eight as lanes, and the residual of one of its points."""

    axes: Axes
    T: Float[np.ndarray, "4 4"]
    """Pose of the end."""
    r: Float[np.ndarray, " 3"]
    J: Float[np.ndarray, "3 p"]
    """Derivative of the prediction."""


def allocate_points(walked: Walked) -> Buffers:
    """Buffers for a pass over the points of a walk."""
    return Buffers.of(walked.s, walked.e, walked.factor.shape[1], (3, walked.layout.count))


@part
def take_points(position, valid, first, t, out):
    """Copy the positions of target t to lanes, zero where nothing was measured, and those of the last pose beyond it."""
    for lane in range(LANES):
        i = min(first + lane, valid.shape[0] - 1)
        for a in range(3):
            out[a, lane] = position[i, t, a] if valid[i, t] else 0.0


# Normal equations.

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
def _accumulate(walk, seen, whitener, loss, buffers, products):
    """Add up the products of whitened columns and residuals, which come last, eight poses at a time; the cost."""
    error_frames, axes, p = expand_error_frames(walk.e), axes_of(buffers), products.columns
    W, rows = as_lanes(buffers.work), as_lanes(products.block)
    s, factor, y, r, J = (
        as_lanes(buffers.s),
        as_lanes(buffers.factor),
        as_lanes(buffers.y),
        as_lanes(buffers.r),
        as_lanes(buffers.J),
    )
    block = PointBlock(axes, as_lanes(buffers.T), r, J)
    cost = 0.0
    for first in range(0, walk.s.shape[0], LANES):
        take_lanes(walk.s, first, buffers.s)
        take_lanes(walk.factor, first, buffers.factor)
        walk_pose(walk.steps, s, error_frames, axes, block.T)
        for t in range(seen.valid.shape[1]):
            take_points(seen.position, seen.valid, first, t, buffers.y)
            linearise_point(walk.points, walk.layout, factor, y, t, block)
            _take_whitener(seen.valid, whitener, first, t, buffers.work)
            r2 = W[2, 0] * r[0] + W[2, 1] * r[1] + W[2, 2] * r[2]
            r1, r0 = W[1, 0] * r[0] + W[1, 1] * r[1], W[0, 0] * r[0]
            block.r[0] = r0 * r0 + r1 * r1 + r2 * r2
            for lane in range(LANES):
                weight, double = _weigh(loss.kind, loss.threshold, buffers.r[0, lane], 3)
                buffers.r[1, lane] = np.sqrt(weight)
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
        buffers = allocate_points(walked)
        return _accumulate(walked.arrays(rows), seen.take(rows), white, weighing, buffers, products), products.sums

    costs, sums = zip(*in_chunks(add, len(walked.s), POSES), strict=True)
    total = symmetric(sums[0] if len(sums) == 1 else np.sum(sums, axis=0))
    return sum(costs), total[:p, p].copy(), total[:p, :p].copy()


# Covariances of what is predicted.


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
def _propagate(walk, seen, matrix, buffers, residual, out):
    """Store r and J·matrix·Jᵀ of every block, eight poses at a time."""
    error_frames, axes, n = expand_error_frames(walk.e), axes_of(buffers), len(walk.s)
    s, factor, y = as_lanes(buffers.s), as_lanes(buffers.factor), as_lanes(buffers.y)
    block = PointBlock(axes, as_lanes(buffers.T), as_lanes(buffers.r), as_lanes(buffers.J))
    for first in range(0, n, LANES):
        take_lanes(walk.s, first, buffers.s)
        take_lanes(walk.factor, first, buffers.factor)
        walk_pose(walk.steps, s, error_frames, axes, block.T)
        for t in range(seen.valid.shape[1]):
            take_points(seen.position, seen.valid, first, t, buffers.y)
            linearise_point(walk.points, walk.layout, factor, y, t, block)
            conjugate_lanes(block.J, matrix, as_lanes(buffers.work))
            for lane in range(min(LANES, n - first)):
                if seen.valid[first + lane, t]:
                    for a in range(3):
                        residual[first + lane, t, a] = buffers.r[a, lane]
                        for b in range(3):
                            out[first + lane, t, a, b] = buffers.work[max(a, b), min(a, b), lane]


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
        buffers = allocate_points(walked)
        _propagate(walked.arrays(rows), seen.take(rows), matrix, buffers, residual[rows], propagated[rows])

    in_chunks(fill, n)
    return residual, propagated
