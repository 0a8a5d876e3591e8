"""Streamed normal equations of measured points or poses at the end of a chain: JᵀWJ and JᵀWr without storing J."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Int

from taskcal.geometry.chain import Chain
from taskcal.geometry.compiled import compiled, inlined
from taskcal.geometry.walk import Columns, expand_error_frames, fill_columns, in_chunks, walk_pose

SQUARED, HUBER, CAUCHY = range(3)

WhitenedEquations = Callable[[np.ndarray], tuple[float, np.ndarray, np.ndarray]]
"""An estimate's cost, JᵀWr and JᵀWJ."""


@dataclass(frozen=True, eq=False)
class Observations:
    """Points fixed to the chain's end, or its pose, as measured in the frame of its start."""

    position: Float[np.ndarray, "n targets 3"]
    """Measured positions, metres."""
    rotation: Float[np.ndarray, "n 3 3"] | None
    """Measured rotations; None where only points were measured."""
    valid: Bool[np.ndarray, "n targets"]
    """False where the beam was lost."""

    @property
    def rows(self) -> int:
        """Rows of one block of residuals: 3 for a point, 6 for a pose."""
        return 3 if self.rotation is None else 6


@dataclass(frozen=True, eq=False)
class Points:
    """Where the targets sit in the end's frame, and which columns belong to that."""

    position: Float[np.ndarray, "targets 3"]
    """Target centres, metres."""
    columns: Int[np.ndarray, "targets 3"]
    """Column of each coordinate, −1 where it is held fixed."""


@inlined
def _block(T, joint_axes, frame_axes, frames, joint, column, factor, points, point_columns, t, y, y_rotation, r, J, w):
    """Residual r (measured less predicted) and derivative J of the prediction, for target t at one pose."""
    a, b, c = points[t, 0], points[t, 1], points[t, 2]
    x0 = T[0, 3] + T[0, 0] * a + T[0, 1] * b + T[0, 2] * c
    x1 = T[1, 3] + T[1, 0] * a + T[1, 1] * b + T[1, 2] * c
    x2 = T[2, 3] + T[2, 0] * a + T[2, 1] * b + T[2, 2] * c
    fill_columns(joint_axes, frame_axes, frames, joint, column, factor, x0, x1, x2, J)
    for other in range(point_columns.shape[0]):
        for d in range(3):
            k = point_columns[other, d]
            if k >= 0:
                for row in range(J.shape[0]):
                    J[row, k] = T[row, d] if other == t and row < 3 else 0.0
    r[0], r[1], r[2] = y[t, 0] - x0, y[t, 1] - x1, y[t, 2] - x2
    if r.shape[0] == 6:
        _rotation_residual(T, y_rotation, r, J, w)


@inlined
def _rotation_residual(T, y_rotation, r, J, w):
    """Rows 3–5: r = log(R_measured·R_predictedᵀ), whose derivative is Jr⁻¹(r) times the angular columns."""
    for i in range(3):
        for j in range(3):
            w[i, j] = y_rotation[i, 0] * T[j, 0] + y_rotation[i, 1] * T[j, 1] + y_rotation[i, 2] * T[j, 2]
    v0, v1, v2 = 0.5 * (w[2, 1] - w[1, 2]), 0.5 * (w[0, 2] - w[2, 0]), 0.5 * (w[1, 0] - w[0, 1])
    sine = np.sqrt(v0 * v0 + v1 * v1 + v2 * v2)
    angle = np.arctan2(sine, 0.5 * (w[0, 0] + w[1, 1] + w[2, 2] - 1.0))
    # half a turn has no unique axis; a fit starts from a registration that is nowhere near it
    scale = 1.0 if sine < 1e-12 else angle / sine
    r[3], r[4], r[5] = scale * v0, scale * v1, scale * v2
    c = 1.0 / 12.0
    if angle > 1e-4:
        c = 1.0 / (angle * angle) - (1.0 + np.cos(angle)) / (2.0 * angle * np.sin(angle))
    a, b, g = r[3], r[4], r[5]
    w[0, 0], w[0, 1], w[0, 2] = 1.0 - c * (b * b + g * g), -0.5 * g + c * a * b, 0.5 * b + c * a * g
    w[1, 0], w[1, 1], w[1, 2] = 0.5 * g + c * a * b, 1.0 - c * (a * a + g * g), -0.5 * a + c * b * g
    w[2, 0], w[2, 1], w[2, 2] = -0.5 * b + c * a * g, 0.5 * a + c * b * g, 1.0 - c * (a * a + b * b)
    for k in range(J.shape[1]):
        a, b, g = J[3, k], J[4, k], J[5, k]
        for i in range(3):
            J[3 + i, k] = w[i, 0] * a + w[i, 1] * b + w[i, 2] * g


@compiled
def _accumulate(
    kind, index, fixed, s, e, factor, frames, joint, column, points, point_columns, y, y_rotation, valid,
    whitener, loss, threshold, mode, matrix, H, g, residual, spread,
):  # fmt: skip
    """One pass over the poses.

    Mode 0 adds up H = JᵀWJ and g = JᵀWr and returns the cost; mode 1 stores r and J·matrix·Jᵀ of every block.
    """
    e_rotation, e_axes, nil = expand_error_frames(e)
    joint_axes, frame_axes = np.zeros((s.shape[1], 3, 3)), np.zeros((e.shape[0], 7, 3))
    T, w = np.empty((3, 4)), np.empty((3, 3))
    rows, p = whitener.shape[2], g.shape[0]
    r, J, white, product = np.zeros(rows), np.zeros((rows, p)), np.zeros((rows, p)), np.zeros(p)
    cost = 0.0
    for i in range(s.shape[0]):
        walk_pose(kind, index, fixed, s[i], e, e_rotation, e_axes, nil, joint_axes, frame_axes, T)
        for t in range(y.shape[1]):
            if not valid[i, t]:
                continue
            _block(
                T, joint_axes, frame_axes, frames, joint, column, factor[i], points, point_columns, t, y[i],
                y_rotation[i if y_rotation.shape[0] > 1 else 0], r, J, w,
            )  # fmt: skip
            if mode == 1:
                for a in range(rows):
                    residual[i, t, a] = r[a]
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
                        spread[i, t, a, b] = v
                        spread[i, t, b, a] = v
                continue
            square = 0.0
            for a in range(rows - 1, -1, -1):  # W is lower triangular: row a needs rows 0…a, so go down in place
                v = 0.0
                white[a, :] = 0.0
                for b in range(a + 1):
                    u = whitener[i, t, a, b]
                    v += u * r[b]
                    for k in range(p):
                        white[a, k] += u * J[b, k]
                r[a] = v
                square += v * v
            scaled = square / rows / (threshold * threshold)
            if loss == HUBER and scaled > 1.0:
                weight = 1.0 / np.sqrt(scaled)
                square = rows * threshold * threshold * (2.0 * np.sqrt(scaled) - 1.0)
            elif loss == CAUCHY:
                weight = 1.0 / (1.0 + scaled)
                square = rows * threshold * threshold * np.log1p(scaled)
            else:
                weight = 1.0
            cost += 0.5 * square
            for a in range(0, rows, 3):  # three rows at a time: a third of the traffic on H
                for j in range(p):
                    u, v, x = weight * white[a, j], weight * white[a + 1, j], weight * white[a + 2, j]
                    g[j] += u * r[a] + v * r[a + 1] + x * r[a + 2]
                    for k in range(j, p):
                        H[j, k] += u * white[a, k] + v * white[a + 1, k] + x * white[a + 2, k]
    for j in range(H.shape[0]):  # mode 1 brings an empty H
        for k in range(j):
            H[j, k] = H[k, j]
    return cost


_NO_ROTATION = np.zeros((1, 3, 3))
_NO_MATRIX = np.zeros((0, 0))
_NO_BLOCKS = np.zeros((0, 0, 0)), np.zeros((0, 0, 0, 0))


@dataclass(frozen=True, eq=False)
class Walked:
    """A chain with everything that a pass over measured poses needs besides the measurements."""

    chain: Chain
    s: Float[np.ndarray, "n joints"]
    e: Float[np.ndarray, "frames 6"]
    layout: Columns
    factor: Float[np.ndarray, "n pairs"]
    points: Points

    def arrays(self, rows: slice) -> tuple[np.ndarray, ...]:
        """The arguments that every pass shares, for some of the poses."""
        chain, layout = self.chain, self.layout
        return (
            chain.kind, chain.index, chain.fixed, self.s[rows], self.e, self.factor[rows],
            layout.frames, layout.joint, layout.column, self.points.position, self.points.columns,
        )  # fmt: skip


def _measured(seen: Observations, rows: slice) -> tuple[np.ndarray, ...]:
    rotation = _NO_ROTATION if seen.rotation is None else seen.rotation[rows]
    return seen.position[rows], rotation, seen.valid[rows]


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
        shared = (*walked.arrays(rows), *_measured(seen, rows))
        arguments: tuple[Any, ...] = (*shared, whitener[rows], loss, threshold, 0, _NO_MATRIX, H, g, *_NO_BLOCKS)
        cost = _accumulate(*arguments)
        return cost, g, H

    parts = in_chunks(add, len(walked.s))
    if len(parts) == 1:
        return parts[0]
    costs, gs, Hs = zip(*parts, strict=True)
    return sum(costs), np.sum(gs, axis=0), np.sum(Hs, axis=0)


def spread(
    walked: Walked, seen: Observations, matrix: Float[np.ndarray, "p p"]
) -> tuple[Float[np.ndarray, "n targets b"], Float[np.ndarray, "n targets b b"]]:
    """Residuals (measured − predicted, not whitened) and J·matrix·Jᵀ of every block; NaN where nothing was measured."""
    n, targets = seen.valid.shape
    residual = np.full((n, targets, seen.rows), np.nan)
    out = np.full((n, targets, seen.rows, seen.rows), np.nan)
    shape = np.zeros((0, 0, seen.rows, seen.rows))
    matrix = np.ascontiguousarray(matrix)

    def fill(rows: slice) -> None:
        g = np.zeros(walked.layout.count)
        shared = (*walked.arrays(rows), *_measured(seen, rows))
        arguments: tuple[Any, ...] = (*shared, shape, SQUARED, 1.0, 1, matrix, _NO_MATRIX, g, residual[rows], out[rows])
        _accumulate(*arguments)

    in_chunks(fill, n)
    return residual, out
