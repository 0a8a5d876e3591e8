"""Points measured at the end of a chain, and the chain they are measured on, as the compiled passes take them.

A pass goes over the poses, eight at a time, and at each over the targets that were seen, and fills a block with each one's residual
and derivative. What is then done with the block is the pass's own (`normal_equations`, `covariance`).
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from taskcal.kernels.chain import Chain, Columns, Layout, Steps
from taskcal.kernels.compiled import part
from taskcal.kernels.lanes import LANES, rooms
from taskcal.kernels.walk import Axes, fill_columns

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
    T: Float[np.ndarray, "3 4"]
    """Pose of the end."""
    r: Float[np.ndarray, " 3"]
    J: Float[np.ndarray, "3 p"]
    """Derivative of the prediction."""


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
