"""Streamed propagation of a covariance to what is measured at the end of a chain: J·C·Jᵀ without storing J."""

import numpy as np
from jaxtyping import Float

from taskcal.geometry.chunks import in_chunks
from taskcal.geometry.compiled import compiled, inlined, part
from taskcal.geometry.lanes import LANES, as_lanes, take_lanes
from taskcal.geometry.observations import Observations, PointBlock, Walked, allocate_block, linearise
from taskcal.geometry.point_observation import linearise_point
from taskcal.geometry.point_pass import allocate_points, take_points
from taskcal.geometry.walk import Axes, expand_error_frames, walk_pose


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
def _propagate_points(walk, seen, matrix, room, residual, out):
    """The same of points alone, eight poses at a time."""
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
        walk = walked.arrays(rows)
        if seen.only_points and len(matrix):
            room = allocate_points(walked)
            _propagate_points(walk, seen.points(rows), matrix, room, residual[rows], propagated[rows])
        else:
            _propagate(walk, seen.arrays(rows), matrix, residual[rows], propagated[rows])

    in_chunks(fill, n)
    return residual, propagated
