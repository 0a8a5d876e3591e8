"""The joints in rounded corners: what a controller drives instead of going to the target and on from there."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from taskcal.correction.corners import Corners, find_corners
from taskcal.correction.rounded_path import RoundedPath
from taskcal.correction.segments import Segments
from taskcal.geometry import se3
from taskcal.kinematics.inverse import solve_near
from taskcal.programs.program import Move
from taskcal.robot.error_model import ErrorModel

WITHIN = 0.5
"""Corners of lines and arcs are looked at in the middle, and at this share of both halves."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Samples:
    """Joint positions along lines and arcs, in the order of the program."""

    move: Int[np.ndarray, " k"]
    share: Float[np.ndarray, " k"]
    """Share of the motion's length; the last sample of each motion is at its end."""
    q: Float[np.ndarray, "k joints"]


@dataclass(frozen=True, eq=False, kw_only=True)
class Cornered:
    """Samples of a path whose corners are rounded."""

    samples: Samples
    passes: Float[np.ndarray, "m joints"]
    """Joint positions at the end of each motion, radians: in the middle of the corner where it is rounded."""
    corners: Corners
    lost: tuple[int, ...]
    """Motions at whose ends the corner leads where the robot does not reach, and which are taken to end in their targets."""


def round_corners(
    model: ErrorModel,
    moves: Sequence[Move],
    segments: Segments,
    samples: Samples,
    start: Float[np.ndarray, "m joints"],
    end: Float[np.ndarray, "m joints"],
) -> Cornered:
    """Round the corners of a controller's path.

    Args:
        model: of the nominal robot.
        moves: the motions.
        segments: tool in part along them.
        samples: joint positions along lines and arcs, to each target and from there.
        start: joint positions where each motion begins, radians; NaN where that is not known.
        end: joint positions of each target; NaN where it cannot be executed.
    """

    def driven(rows: Int[np.ndarray, " n"], share: Float[np.ndarray, " n"]) -> Float[np.ndarray, "n 4 4"]:
        q = start[rows] + share[:, None] * (end[rows] - start[rows])
        flange = model.poses(q) @ se3.inverse(model.robot.T_flange_tool)
        return np.stack([moves[i].target(T) for i, T in zip(rows, flange, strict=True)])

    known = np.asarray(np.isfinite(start).all(axis=1) & np.isfinite(end).all(axis=1))
    path = RoundedPath(segments=segments, corners=find_corners(moves, segments, known, driven)).bent()
    if not (path.corners.after >= 0).any():
        return Cornered(samples=samples, passes=end, corners=path.corners, lost=())
    along, added = _with_halves(samples, start, path.corners)
    alone = np.flatnonzero((path.corners.after >= 0) & ~np.isin(np.arange(len(moves)), samples.move))
    rows = np.flatnonzero(path.inside(along.move, along.share))
    number = np.concatenate([along.move[rows], alone])
    share = np.concatenate([along.share[rows], np.ones(len(alone))])
    seeds = np.concatenate([along.q[rows], end[alone]])
    flange = _flange(moves, number, path.at(number, share))
    solution = solve_near(model, flange @ model.robot.T_flange_tool, seeds)
    corner = np.where(share > 0.5, number, path.corners.before[number])  # a corner is known by the motion that is left
    lost = np.unique(corner[~solution.reached])
    solved = ~np.isin(corner, lost)
    q = along.q.copy()
    q[rows[solved[: len(rows)]]] = solution.q[: len(rows)][solved[: len(rows)]]
    passes = end.copy()
    middle = solved & (share == 1.0)
    passes[number[middle]] = solution.q[middle]
    gone = added.copy()
    gone[rows] &= ~solved[: len(rows)]
    kept = ~(added & gone)
    return Cornered(
        samples=Samples(move=along.move[kept], share=along.share[kept], q=q[kept]),
        passes=passes,
        corners=path.corners.only(~np.isin(np.arange(len(moves)), lost)),
        lost=tuple(int(i) for i in lost),
    )


def _flange(
    moves: Sequence[Move], number: Int[np.ndarray, " n"], T: Float[np.ndarray, "n 4 4"]
) -> Float[np.ndarray, "n 4 4"]:
    """Poses of the flange in the base for poses of the tool in the part, in some motions."""
    alike: dict[tuple[int, int, bool], list[int]] = {}
    for k, i in enumerate(number.tolist()):
        alike.setdefault((id(moves[i].tool), id(moves[i].part), moves[i].part_in_hand), []).append(k)
    flange = np.empty_like(T)
    for rows in alike.values():
        flange[rows] = moves[int(number[rows[0]])].flange(T[rows])
    return flange


def _with_halves(
    samples: Samples, start: Float[np.ndarray, "m joints"], corners: Corners
) -> tuple[Samples, Bool[np.ndarray, " n"]]:
    """Samples with further ones inside corners, at about the joints there, and which these are."""
    sampled = np.unique(samples.move)
    exit_, entry = corners.exit.max(axis=1, initial=0.0), corners.entry.max(axis=1, initial=0.0)
    left, joined = sampled[exit_[sampled] > 0.0], sampled[entry[sampled] > 0.0]
    move = np.concatenate([left, joined])
    share = np.concatenate([1.0 - WITHIN * exit_[left], WITHIN * entry[joined]])
    place = samples.move + samples.share
    behind = np.searchsorted(place, move + share)
    first = (behind == 0) | (samples.move[np.maximum(behind - 1, 0)] != move)
    before_q = np.where(first[:, None], start[move], samples.q[np.maximum(behind - 1, 0)])
    before_share = np.where(first, 0.0, samples.share[np.maximum(behind - 1, 0)])
    between = (share - before_share) / np.maximum(samples.share[behind] - before_share, 1e-12)
    q = before_q + between[:, None] * (samples.q[behind] - before_q)
    move, share = np.concatenate([samples.move, move]), np.concatenate([samples.share, share])
    order = np.lexsort((share, move))
    added = np.arange(len(move)) >= len(samples.move)
    return Samples(move=move[order], share=share[order], q=np.concatenate([samples.q, q])[order]), added[order]
