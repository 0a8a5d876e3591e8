"""Corners that a tool rounds: where it leaves one motion for the next without a stop, and where it has joined that.

The makers say: a corner path, a parabola, begins at the edge of the zone, which never reaches farther than half of the way to
the position before or behind (ABB, RAPID reference manual, data type zonedata, and Motion and I/O principles, corner paths);
approximation begins at the earliest at the stated distance from the target, and at half of the motion (KUKA, KST
PLC mxAutomation, APO and PTP_APO).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int

from taskcal.correction.segments import Segments
from taskcal.programs.program import Move
from taskcal.programs.zone import Zone

PosesInMotions = Callable[[np.ndarray, np.ndarray], np.ndarray]
"""From numbers of motions (n) and shares of their lengths (n) to poses (n, 4, 4) of the tool in the part's frame."""

AT_ONCE = 1e-6
"""A motion whose tool point goes less far only turns the tool, metres."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Corners:
    """Rounded corners of a program."""

    before: Int[np.ndarray, " m"]
    """Motion that each one joins from in a rounded corner; −1 where it begins in the target before."""
    after: Int[np.ndarray, " m"]
    """Motion for which each one is left in a rounded corner; −1 where it goes to its target."""
    entry: Float[np.ndarray, "m 2"]
    """Share of its length where it is joined: by the tool point, and by the orientation; zero in the target before."""
    exit: Float[np.ndarray, "m 2"]
    """Share of its length that is not gone any more: by the tool point, and by the orientation."""
    joined: Float[np.ndarray, "m 4 4"]
    """Tool in part where a motion of the joints is joined; NaN for others, which say their paths themselves."""
    left: Float[np.ndarray, "m 4 4"]
    """The same where one is left."""

    @classmethod
    def none(cls, m: int) -> "Corners":
        """Of a program that meets all its targets."""
        nobody, nothing, nowhere = np.full(m, -1), np.zeros((m, 2)), np.full((m, 4, 4), np.nan)
        return cls(before=nobody, after=nobody, entry=nothing, exit=nothing, joined=nowhere, left=nowhere)

    def only(self, kept: Bool[np.ndarray, " m"]) -> "Corners":
        """Those at the ends of some motions."""
        after = np.where(kept, self.after, -1)
        before = np.where((self.before >= 0) & kept[np.maximum(self.before, 0)], self.before, -1)
        return replace(
            self,
            before=before,
            after=after,
            entry=np.where((before >= 0)[:, None], self.entry, 0.0),
            exit=np.where((after >= 0)[:, None], self.exit, 0.0),
        )


def find_corners(
    moves: Sequence[Move], segments: Segments, known: Bool[np.ndarray, " m"], driven: PosesInMotions
) -> Corners:
    """Where the tool rounds the corners of a program.

    Args:
        moves: the motions.
        segments: tool in part along lines and arcs, and from start to end of motions of the joints.
        known: motions whose start is known, and which can be executed.
        driven: tool in part along motions of the joints.
    """
    corners = Corners.none(len(moves))
    length, angle = segments.length, np.linalg.norm(segments.turn, axis=1)
    before, after = corners.before.copy(), corners.after.copy()
    entry, exit_ = corners.entry.copy(), corners.exit.copy()
    for i, j in enumerate(_followers(moves)):
        zone = moves[i].zone
        if j < 0 or moves[i].stops or zone is None or not zone.rounds:
            continue
        if not (known[i] and known[j] and _in_common(moves[i], moves[j])):
            continue
        exit_[i], entry[j] = _shares(zone, length[[i, j]], angle[[i, j]])
        if exit_[i].max() > 0.0:
            after[i], before[j] = j, i
    chords = []
    by_joints = np.array([move.kind in ("joint", "axes") for move in moves], dtype=bool)
    for partner, share in ((before, entry.max(axis=1, initial=0.0)), (after, 1.0 - exit_.max(axis=1, initial=0.0))):
        T = corners.left.copy()
        rows = np.flatnonzero((partner >= 0) & by_joints)
        if len(rows):
            T[rows] = driven(rows, share[rows])
        chords.append(T)
    return Corners(before=before, after=after, entry=entry, exit=exit_, joined=chords[0], left=chords[1])


def _followers(moves: Sequence[Move]) -> list[int]:
    """The motion behind each one; −1 where there is none, or more than one may come."""
    followers = [-1] * len(moves)
    several: set[int] = set()
    for j, move in enumerate(moves):
        if move.follows is not None:
            if followers[move.follows] >= 0:
                several.add(move.follows)
            followers[move.follows] = j
    return [-1 if i in several else j for i, j in enumerate(followers)]


def _in_common(first: Move, second: Move) -> bool:
    """Whether two motions have tool and part in common."""
    return first.part_in_hand == second.part_in_hand and all(
        a is b or (a.name == b.name and np.array_equal(a.T, b.T))
        for a, b in ((first.tool, second.tool), (first.part, second.part))
    )


def _shares(
    zone: Zone, length: Float[np.ndarray, " 2"], angle: Float[np.ndarray, " 2"]
) -> tuple[tuple[float, float], tuple[float, float]]:
    """Shares of two motions that a corner between them takes: of the first and of the second, by point and orientation."""
    if (length > AT_ONCE).all():
        most = min(length.min() / 2.0, zone.share * length[0])
        sizes = [min(zone.distance, most), min(max(zone.distance, zone.turn_distance), most)]
        measure = length
    elif (length <= AT_ONCE).all() and (angle > 0.0).all():
        sizes = [min(zone.angle, angle.min() / 2.0, zone.share * angle[0])] * 2
        measure = angle
    else:  # between a path and a turn on the spot, half of which is no way at all
        return (0.0, 0.0), (0.0, 0.0)
    first, second = ((float(sizes[0] / whole), float(sizes[1] / whole)) for whole in measure)
    return first, second
