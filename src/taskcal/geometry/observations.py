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

from taskcal.geometry.chain import Chain, Steps
from taskcal.geometry.columns import Columns, Layout
from taskcal.geometry.compiled import inlined
from taskcal.geometry.linearised_observation import copy_linearised
from taskcal.geometry.point_observation import linearise_point
from taskcal.geometry.pose_observation import linearise_rotation
from taskcal.geometry.walk import Axes, allocate_axes

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
