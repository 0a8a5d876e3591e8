"""The path of a tool that rounds its corners."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float, Int

from taskcal.correction.corners import Corners
from taskcal.correction.segments import Segments
from taskcal.geometry import se3

STRAIGHT_M, STRAIGHT_RAD = 1e-6, 1e-6
"""A corner whose target the tool passes by nearer than this, metres and radians, is none."""

AT_END = 1e-12

POINT, TURN = 0, 1
"""Columns of the sizes of a corner: for the tool point, and for the orientation."""


@dataclass(frozen=True, eq=False, kw_only=True)
class RoundedPath:
    """Segments of a tool's path, with the corners between them rounded.

    In a corner the tool point goes along a cubic Bézier curve that touches both motions where they are left and joined: between
    lines it is the parabola, between two pieces of one arc the arc to fourth order. The orientation turns as both motions
    turn it, the one running out while the other sets in. A share of a motion's length is that of its segment; the
    corner is half passed where the motion would have ended.
    """

    segments: Segments
    corners: Corners

    def at(self, move: Int[np.ndarray, " k"], share: Float[np.ndarray, " k"]) -> Float[np.ndarray, "k 4 4"]:
        """Poses at shares of the lengths of some motions, 0 to 1; at the end also where the start is not known."""
        at_end = share >= 1.0 - AT_END
        T = np.where(at_end[:, None, None], self.segments.end[move], self.segments.at(move, share))
        passage = self._passage(move, share, POINT)
        if len(passage.rows):
            T[passage.rows, :3, 3] = _bezier(self._controls(passage), passage.u[:, None])
        passage = self._passage(move, share, TURN)
        if len(passage.rows):
            T[passage.rows, :3, :3] = self._orientations(passage)
        return T

    def direction(self, move: Int[np.ndarray, " k"], share: Float[np.ndarray, " k"]) -> Float[np.ndarray, "k 3"]:
        """Unit vectors along the path; zero where the tool point stays."""
        out = self.segments.direction(move, share)
        passage = self._passage(move, share, POINT)
        if len(passage.rows):
            A, C, D, B = self._controls(passage)
            u = passage.u[:, None]
            along = (1.0 - u) ** 2 * (C - A) + 2.0 * u * (1.0 - u) * (D - C) + u**2 * (B - D)
            size = np.linalg.norm(along, axis=1, keepdims=True)
            out[passage.rows] = np.where(size > 1e-12, along / np.maximum(size, 1e-12), 0.0)
        return out

    def inside(self, move: Int[np.ndarray, " k"], share: Float[np.ndarray, " k"]) -> Bool[np.ndarray, " k"]:
        """Whether the tool is in a corner there."""
        leaving = 1.0 - share < self.corners.exit[move].max(axis=1, initial=0.0)
        return leaving | (share < self.corners.entry[move].max(axis=1, initial=0.0))

    def bent(self) -> "RoundedPath":
        """The path without corners that are as good as straight."""
        rows = np.flatnonzero(self.corners.after >= 0)
        T, P = self.at(rows, np.ones(len(rows))), self.segments.end[rows]
        off = np.linalg.norm(T[:, :3, 3] - P[:, :3, 3], axis=1)
        turn = np.linalg.norm(se3.log(np.swapaxes(P[:, :3, :3], 1, 2) @ T[:, :3, :3]), axis=1)
        kept = np.zeros(len(self.corners.after), dtype=bool)
        kept[rows] = (off > STRAIGHT_M) | (turn > STRAIGHT_RAD)
        return replace(self, corners=self.corners.only(kept))

    @cached_property
    def _runs(self) -> tuple[Segments, Segments]:
        """What is left and what is joined: of a motion of the joints, the chord over the corner."""
        own, corners = self.segments, self.corners
        left, joined = _is_known(corners.left), _is_known(corners.joined)
        return (
            replace(own, start=np.where(left[:, None, None], corners.left, own.start)) if left.any() else own,
            replace(own, end=np.where(joined[:, None, None], corners.joined, own.end)) if joined.any() else own,
        )

    def _passage(self, move: Int[np.ndarray, " k"], share: Float[np.ndarray, " k"], part: int) -> "_Passage":
        corners = self.corners
        leaving = 1.0 - share < corners.exit[move, part]
        rows = np.flatnonzero(leaving | (share < corners.entry[move, part]))
        own, leaving, share = move[rows], leaving[rows], share[rows]
        first = np.where(leaving, own, corners.before[own])
        second = np.where(leaving, corners.after[own], own)
        exit_, entry = corners.exit[first, part], corners.entry[second, part]
        from_target = np.where(leaving, (share - 1.0) / exit_, share / entry)
        # shares of the chords of motions of the joints, which reach over the wider of both corners
        widest = corners.exit[first].max(axis=1, initial=0.0), corners.entry[second].max(axis=1, initial=0.0)
        return _Passage(
            rows=rows,
            first=first,
            second=second,
            u=(1.0 + from_target) / 2.0,
            exit=np.where(_is_known(corners.left)[first], exit_ / widest[0], exit_),
            entry=np.where(_is_known(corners.joined)[second], entry / widest[1], entry),
        )

    def _controls(self, passage: "_Passage") -> tuple[Float[np.ndarray, "k 3"], ...]:
        """Control points of the curves: where the first motion is left, two on the tangents, where the second is joined."""
        (left, joined), first, second = self._runs, passage.first, passage.second
        A = left.at(first, 1.0 - passage.exit)[:, :3, 3]
        B = joined.at(second, passage.entry)[:, :3, 3]
        C = A + _handle(left, first, passage.exit) * left.direction(first, 1.0 - passage.exit)
        D = B - _handle(joined, second, passage.entry) * joined.direction(second, passage.entry)
        return A, C, D, B

    def _orientations(self, passage: "_Passage") -> Float[np.ndarray, "k 3 3"]:
        (left, joined), u = self._runs, passage.u
        R_first = left.at(passage.first, 1.0 - passage.exit * (1.0 - u) ** 2)[:, :3, :3]
        R_target = self.segments.end[passage.first, :3, :3]
        R_second = joined.at(passage.second, passage.entry * u**2)[:, :3, :3]
        return R_first @ np.swapaxes(R_target, 1, 2) @ R_second


@dataclass(frozen=True, eq=False, kw_only=True)
class _Passage:
    """Places of the tool in corners."""

    rows: Int[np.ndarray, " k"]
    """Which places they are."""
    first: Int[np.ndarray, " k"]
    """Motion that is left."""
    second: Int[np.ndarray, " k"]
    """Motion that is joined."""
    u: Float[np.ndarray, " k"]
    """How far the corner is passed, 0 to 1."""
    exit: Float[np.ndarray, " k"]
    """Share of the first motion, or of its chord, that the corner takes."""
    entry: Float[np.ndarray, " k"]
    """The same of the second."""


def _bezier(controls: tuple[Float[np.ndarray, "k 3"], ...], u: Float[np.ndarray, "k 1"]) -> Float[np.ndarray, "k 3"]:
    A, C, D, B = controls
    v = 1.0 - u
    return v**3 * A + 3.0 * u * v**2 * C + 3.0 * u**2 * v * D + u**3 * B


def _handle(run: Segments, motion: Int[np.ndarray, " k"], share: Float[np.ndarray, " k"]) -> Float[np.ndarray, "k 1"]:
    """Distance of a control point from the end of its curve, metres.

    Two thirds of the way to the target make the parabola between lines; on an arc, a little more keeps to the circle.
    """
    half = np.minimum(run.arc_angle[motion] * share, np.pi / 2.0) / 2.0
    bow = np.where(half > 1e-4, np.tan(half) / np.maximum(half, 1e-4), 1.0)
    return (2.0 / 3.0 * bow * run.length[motion] * share)[:, None]


def _is_known(T: Float[np.ndarray, "m 4 4"]) -> Bool[np.ndarray, " m"]:
    return np.isfinite(T[:, 0, 0])
