"""What is measured at the end of a chain, and the chain it is measured on, as the compiled passes take them.

A pass goes over the poses, and at each over the targets that were seen, and fills a block with each one's residual and
derivative. A tracker's points and poses are linearised on the way (`point_observation`, `pose_observation`); every other kind of
observation comes linearised by the twist of the chain's end (`linearised_observation`), so that no kind need be known here. What
is then done with the block is the same for all (`normal_equations`, `covariance_propagation`).
"""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from taskcal.kernels.chain import Chain, Columns, Layout, Steps
from taskcal.kernels.compiled import inlined, part
from taskcal.kernels.lanes import LANES, rooms
from taskcal.kernels.walk import Axes, allocate_axes, fill_columns

# A measured point that is fixed to the end of a chain.


@part
def linearise_point(targets, layout, factor, y, t, block):
    """Residual (measured less predicted) of target t, measured at y, and the derivative J of the prediction.

    Where J has six rows the last three are left as the angular columns, for a measured pose.
    """
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
                for row in range(J.shape[0]):
                    if other == t and row < 3:
                        J[row, k] = T[row, d]
                    else:
                        J[row, k] = 0.0
    r[0], r[1], r[2] = y[0] - x0, y[1] - x1, y[2] - x2


# A measured pose: the first three rows of its block are a point's, the others say how the end of the chain is turned.


@part
def linearise_rotation(walk, seen, i, block):
    """Rows 3–5 of a block: r = log(R_measured·R_predictedᵀ), whose derivative is Jr⁻¹(r) times the angular columns in J.

    R_predicted = exp(o)·T turns with o by Jl(o), and with all else by exp(o) times the angular columns.
    """
    turn, turning, columns = walk.points.turn, walk.points.turning, walk.points.columns
    T, r, J, w, v, y_rotation = block.T, block.r, block.J, block.room[0], block.room[1], seen.rotation[i]
    for i in range(3):
        for j in range(3):
            v[i, j] = y_rotation[i, 0] * T[j, 0] + y_rotation[i, 1] * T[j, 1] + y_rotation[i, 2] * T[j, 2]
    for i in range(3):
        for j in range(3):
            w[i, j] = v[i, 0] * turn[j, 0] + v[i, 1] * turn[j, 1] + v[i, 2] * turn[j, 2]
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
    for i in range(3):
        for j in range(3):
            v[i, j] = w[i, 0] * turn[0, j] + w[i, 1] * turn[1, j] + w[i, 2] * turn[2, j]
    for k in range(J.shape[1]):
        a, b, g = J[3, k], J[4, k], J[5, k]
        for i in range(3):
            J[3 + i, k] = v[i, 0] * a + v[i, 1] * b + v[i, 2] * g
    for d in range(3):
        k = columns[0, d]
        if k >= 0:
            for i in range(3):
                J[i, k] = 0.0
                J[3 + i, k] = w[i, 0] * turning[0, d] + w[i, 1] * turning[1, d] + w[i, 2] * turning[2, d]


# A measurement of any kind, linearised beforehand by the twist of the chain's end and by unknowns of its own.


@part
def copy_linearised(walk, linear, i, t, block):
    """Residual of target t at pose i, and the derivative J of the prediction: what moves the end, then the unknowns."""
    T, J, twist, columns = block.T, block.J, block.twist, linear.columns
    fill_columns(block.axes, walk.layout, walk.factor[i], T[0, 3], T[1, 3], T[2, 3], twist)
    for row in range(J.shape[0]):
        block.r[row] = linear.residual[i, t, row]
        for k in range(J.shape[1]):
            J[row, k] = 0.0
        for c in range(6):
            by = linear.by_end[i, t, row, c]
            if by != 0.0:
                for k in range(J.shape[1]):
                    J[row, k] += by * twist[c, k]
        for u in range(columns.shape[1]):
            k = columns[t, u]
            if k >= 0:
                J[row, k] += linear.by_unknown[i, t, row, u]


_NO_ROTATION = np.zeros((1, 3, 3))
_NOT_TURNED = np.eye(3)


class Points(NamedTuple):
    """Where the targets sit in the end's frame, and which columns belong to that.

    A pose is measured of the end itself. Its rotations may be measured in axes of their own, turned by exp(o) against those of
    the positions; the columns are then those of o.
    """

    position: Float[np.ndarray, "targets 3"]
    """Target centres, metres."""
    columns: Int[np.ndarray, "targets 3"]
    """Column of each coordinate, −1 where it is held fixed."""
    turn: Float[np.ndarray, "3 3"] = _NOT_TURNED
    """exp(o) …"""
    turning: Float[np.ndarray, "3 3"] = _NOT_TURNED
    """… and its left Jacobian."""


class WalkArrays(NamedTuple):
    """The arrays of `Walked`."""

    steps: Steps
    s: Float[np.ndarray, "n joints"]
    e: Float[np.ndarray, "frames 6"]
    layout: Layout
    factor: Float[np.ndarray, "n pairs"]
    points: Points


class Linearised(NamedTuple):
    """Measurements of any kind about an estimate, b numbers each; what is not measured of the b is zero throughout."""

    residual: Float[np.ndarray, "n targets b"]
    """Measured less predicted."""
    by_end: Float[np.ndarray, "n targets b 6"]
    """Derivative of what is predicted by the twist of the chain's end at its origin: vx vy vz wx wy wz."""
    by_unknown: Float[np.ndarray, "n targets b u"]
    """The same by unknowns of the kind's own."""
    columns: Int[np.ndarray, "targets u"]
    """Their columns, −1 where there are fewer, or where they are held."""

    def take(self, rows: slice) -> "Linearised":
        """Some of the poses."""
        return Linearised(self.residual[rows], self.by_end[rows], self.by_unknown[rows], self.columns)


_NOTHING = Linearised(
    np.zeros((0, 0, 0)), np.zeros((0, 0, 0, 6)), np.zeros((0, 0, 0, 0)), np.zeros((0, 0), dtype=np.int64)
)


class SeenArrays(NamedTuple):
    """The arrays of `Observations`; where only points were measured the rotation is never read."""

    position: Float[np.ndarray, "n targets 3"]
    rotation: Float[np.ndarray, "m 3 3"]
    valid: Bool[np.ndarray, "n targets"]
    linear: Linearised


class SeenPoints(NamedTuple):
    """Those of them that a pass over points alone reads: compiling it takes the longer, the more it is given."""

    position: Float[np.ndarray, "n targets 3"]
    valid: Bool[np.ndarray, "n targets"]


@dataclass(frozen=True, eq=False)
class Observations:
    """Points fixed to the chain's end, or its pose, as measured in the frame of its start."""

    position: Float[np.ndarray, "n targets 3"]
    """Measured positions, metres."""
    rotation: Float[np.ndarray, "n 3 3"] | None
    """Measured rotations; None where only points were measured."""
    valid: Bool[np.ndarray, "n targets"]
    """False where the beam was lost."""
    linear: Linearised | None = None
    """What takes the place of positions and rotation, where a kind of its own was measured."""

    @property
    def rows(self) -> int:
        """Rows of one block of residuals: 3 for a point, 6 for a pose."""
        if self.linear is not None:
            return self.linear.residual.shape[2]
        return 3 if self.rotation is None else 6

    def held(self) -> "Observations":
        """The same with the unknowns of their own held."""
        if self.linear is None:
            return self
        return replace(self, linear=self.linear._replace(columns=np.full_like(self.linear.columns, -1)))

    @property
    def only_points(self) -> bool:
        """Whether nothing else was measured."""
        return self.rotation is None and self.linear is None

    def points(self, rows: slice) -> SeenPoints:
        """Points at some of the poses, for a compiled pass over them."""
        return SeenPoints(self.position[rows], self.valid[rows])

    def arrays(self, rows: slice) -> SeenArrays:
        """Some of the poses, for a compiled pass."""
        # contiguous, so that one compilation serves a part of larger arrays too
        rotation = _NO_ROTATION if self.rotation is None else np.ascontiguousarray(self.rotation[rows])
        linear = _NOTHING if self.linear is None else self.linear.take(rows)
        return SeenArrays(self.position[rows], rotation, self.valid[rows], linear)


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
    T: Float[np.ndarray, "3 4"]
    """Pose of the end."""
    r: Float[np.ndarray, " 3"]
    J: Float[np.ndarray, "3 p"]
    """Derivative of the prediction."""


class Block(NamedTuple):
    """One pose as walked, and the residual of one of its targets."""

    axes: Axes
    T: Float[np.ndarray, "3 4"]
    """Pose of the end."""
    r: Float[np.ndarray, " rows"]
    J: Float[np.ndarray, "rows p"]
    """Derivative of the prediction."""
    room: Float[np.ndarray, "2 3 3"]
    """For what a kind of observation works out on the way."""
    twist: Float[np.ndarray, "6 p"]
    """For the derivative of the end's twist."""


@inlined
def allocate_block(walk, rows, p):
    """Room for a block of so many rows and columns."""
    axes = allocate_axes(walk.s.shape[1], walk.e.shape[0])
    return Block(axes, np.empty((3, 4)), np.zeros(rows), np.zeros((rows, p)), np.empty((2, 3, 3)), np.zeros((6, p)))


@inlined
def linearise(walk, seen, i, t, block):
    """Residual and derivative of target t at pose i; their rows say which kind of observation it is."""
    if seen.linear.residual.shape[0] > 0:
        copy_linearised(walk, seen.linear, i, t, block)
    else:
        linearise_point(walk.points, walk.layout, walk.factor[i], seen.position[i, t], t, block)
        if block.r.shape[0] == 6:
            linearise_rotation(walk, seen, i, block)


# Passes over measured points alone, eight poses at a time: what normal equations and covariances share.


class PointRoom(NamedTuple):
    """What a pass over points fills on the way; the lanes are along each array's last axis, where it has any."""

    s: Float[np.ndarray, "joints lanes"]
    factor: Float[np.ndarray, "pairs lanes"]
    joints: Float[np.ndarray, "joints 2 3 lanes"]
    frames: Float[np.ndarray, "frames 7 3 lanes"]
    slides: Bool[np.ndarray, " joints"]
    T: Float[np.ndarray, "3 4 lanes"]
    r: Float[np.ndarray, "3 lanes"]
    J: Float[np.ndarray, "3 p lanes"]
    y: Float[np.ndarray, "3 lanes"]
    """Measured."""
    work: Float[np.ndarray, "3 3 lanes"]
    """For the pass itself."""


def allocate_points(walked: Walked) -> PointRoom:
    """Room for a pass over a walk."""
    joints, frames, pairs = walked.s.shape[1], len(walked.e), walked.factor.shape[1]
    s, factor, axes, along, T, r, J, y, work = rooms(
        (joints,), (pairs,), (joints, 2, 3), (frames, 7, 3), (3, 4), (3,), (3, walked.layout.count), (3,), (3, 3)
    )
    return PointRoom(s, factor, axes, along, np.empty(joints, dtype=bool), T, r, J, y, work)


@part
def take_points(position, valid, first, t, out):
    """Copy the positions of target t to lanes, zero where nothing was measured, and those of the last pose beyond it."""
    for lane in range(LANES):
        i = min(first + lane, valid.shape[0] - 1)
        for a in range(3):
            out[a, lane] = position[i, t, a] if valid[i, t] else 0.0
