"""A controller that takes its robot for nominal: the joint positions to which a program sends it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from robot_programs.core.program import GradedPosture, Move, Target
from taskcal.correction.path import Corners, RoundedPath, Segments, find_corners
from taskcal.errors import ReachError
from taskcal.geometry import se3
from taskcal.kinematics.inverse import find_postures, solve_near
from taskcal.kinematics.tracing import Outcome, rejections, trace, turned
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot import Robot

# The joints in rounded corners: what a controller drives instead of going to the target and on from there.

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


MAX_STEP_M, MAX_STEP_RAD = 0.02, np.radians(5.0)
"""Segments are followed in steps not longer than this, metres and radians."""

CORNER_LOST = (
    "rounds a corner where the robot does not reach it inside its joint limits; it is taken to meet its target"
)


@dataclass(frozen=True, eq=False, kw_only=True)
class ControllerTrajectory:
    """Where a nominal controller moves its joints in the motions of a program."""

    start: Float[np.ndarray, "m joints"]
    """Where each motion begins, radians: in the target before it; NaN where that is not known."""
    end: Float[np.ndarray, "m joints"]
    """In its target; NaN where it cannot be executed."""
    passes: Float[np.ndarray, "m joints"]
    """Where it ends: in its target, or in the middle of the corner in which it is left for the next one."""
    segments: Segments
    """Tool in part's frame along each motion, to its target; of use for lines and arcs."""
    corners: Corners
    """Between motions that do not stop."""
    rejected: dict[int, str]
    """Motions that cannot be executed, and why."""
    out_of_reach: tuple[int, ...]
    """Those among them that lead where the robot does not reach in any posture."""
    warnings: dict[int, str]
    """Motions whose posture data disagree with where the path leads."""
    move: Int[np.ndarray, " k"]
    """Motion of every sample along lines and arcs whose start is known, in order; the last one of each is where it ends."""
    share: Float[np.ndarray, " k"]
    """Share of the motion's length."""
    q: Float[np.ndarray, "k joints"]
    """Joint positions there, radians."""


def simulate_controller(
    robot: Robot,
    moves: Sequence[Move],
    refused: Mapping[int, str] | None = None,
    near: Float[np.ndarray, "m joints"] | None = None,
) -> ControllerTrajectory:
    """Simulate the nominal controller executing a program.

    Args:
        robot: the robot as its controller knows it.
        moves: the motions, in the order of the program.
        refused: motions of which it is not known where they lead, and why.
        near: where motions end whose targets state no posture, about, radians; NaN where that is not known. By default in the
            posture that is nearest to the one before, and at first in the best one.
    """
    nowhere = np.full((len(moves), len(robot.joints)), np.nan)
    return _Simulation(robot, moves, dict(refused or {}), nowhere if near is None else near).run()


class _Simulation:
    """One run through a program; motions that follow each other along lines and arcs are traced together."""

    def __init__(
        self, robot: Robot, moves: Sequence[Move], refused: dict[int, str], near: Float[np.ndarray, "m joints"]
    ):
        self.robot, self.moves, self.near = robot, moves, near
        self.model = ErrorModel(robot)
        m, joints = len(moves), len(robot.joints)
        self.start, self.end = np.full((m, joints), np.nan), np.full((m, joints), np.nan)
        self.rejected = refused
        self.out_of_reach: list[int] = []
        self.warnings: dict[int, str] = {}
        self.samples: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []
        self.last: np.ndarray | None = None
        self._take_joint_targets()
        self.segments = self._segments()

    def run(self) -> ControllerTrajectory:
        joints = len(self.robot.joints)
        i = 0
        while i < len(self.moves):
            previous = self.moves[i].follows
            if previous is not None:
                self.start[i] = self.end[previous]
            if self._is_path(i):
                i = self._trace(i)
                continue
            if i not in self.rejected and np.isnan(self.end[i, 0]):
                self._solve_pose(i)
            if i not in self.rejected:
                self.last = self.end[i]
            i += 1
        parts = self.samples or [(np.zeros(0, dtype=np.int64), np.zeros(0), np.zeros((0, joints)))]
        move, share, q = (np.concatenate(column) for column in zip(*parts, strict=True))
        samples = Samples(move=move, share=share, q=q)
        cornered = round_corners(self.model, self.moves, self.segments, samples, self.start, self.end)
        for i in cornered.lost:
            self.warnings.setdefault(i, CORNER_LOST)
        return ControllerTrajectory(
            start=self.start,
            end=self.end,
            passes=cornered.passes,
            segments=self.segments,
            corners=cornered.corners,
            rejected=self.rejected,
            out_of_reach=tuple(self.out_of_reach),
            warnings=self.warnings,
            move=cornered.samples.move,
            share=cornered.samples.share,
            q=cornered.samples.q,
        )

    def _take_joint_targets(self) -> None:
        """Ends of motions to joint positions."""
        for i, move in enumerate(self.moves):
            if move.end.q is None or i in self.rejected:
                continue
            if len(move.end.q) != len(self.robot.joints):
                count = len(self.robot.joints)
                self.rejected[i] = f"has {len(move.end.q)} joint positions; {self.robot.name} has {count} joints"
                continue
            outside = self.robot.outside_limits(move.end.q[None])
            if outside:
                self.rejected[i] = outside[0][1]
            else:
                self.end[i] = move.end.q

    def _segments(self) -> Segments:
        """Of all motions, tool in part; the start is where the motion before ended, seen with this motion's frames."""
        m = len(self.moves)
        flange = np.full((m, 4, 4), np.nan)
        to_joints = np.flatnonzero(np.isfinite(self.end[:, 0]))
        if len(to_joints):
            flange[to_joints] = self.model.poses(self.end[to_joints]) @ se3.inverse(self.robot.T_flange_tool)
        start, end, via = np.full((m, 4, 4), np.nan), np.full((m, 4, 4), np.nan), np.full((m, 3), np.nan)
        for i, move in enumerate(self.moves):
            if i in self.rejected and move.end.T is not None:
                continue
            if move.end.T is not None:
                flange[i] = move.flange(move.end.T)
                end[i] = move.end.T
            elif np.isfinite(flange[i, 0, 0]):
                end[i] = move.target(flange[i])
            if move.follows is not None and np.isfinite(flange[move.follows, 0, 0]):
                start[i] = move.target(flange[move.follows])
            if move.via is not None and move.via.T is not None:
                via[i] = move.via.T[:3, 3]
        self.goal = flange @ self.robot.T_flange_tool
        return Segments(start=start, end=end, via=via)

    def _is_path(self, i: int) -> bool:
        """Whether a motion is a line or an arc from a place that is known."""
        if i in self.rejected:
            return False
        return self.moves[i].kind in ("linear", "circular") and bool(np.isfinite(self.start[i]).all())

    def _trace(self, first: int) -> int:
        """Follow lines and arcs that continue each other; returns the motion to go on with."""
        stop = first + 1
        while (
            stop < len(self.moves)
            and self.moves[stop].kind in ("linear", "circular")
            and self.moves[stop].follows == stop - 1
            and stop not in self.rejected
        ):
            stop += 1
        rows = np.arange(first, stop)
        turn = np.linalg.norm(self.segments.turn[rows], axis=1)
        steps = np.ceil(np.maximum(self.segments.length[rows] / MAX_STEP_M, turn / MAX_STEP_RAD)).astype(int)
        steps = np.maximum(steps, 2)
        move = np.repeat(rows, steps)
        last = np.cumsum(steps) - 1
        number = np.arange(len(move)) - np.repeat(last + 1 - steps, steps) + 1
        share = number / np.repeat(steps, steps)
        flange = np.empty((len(move), 4, 4))
        T = self.segments.at(move, share)
        for i, own in _groups(move):
            flange[own] = self.moves[i].flange(T[own])
        traced = trace(self.model, flange @ self.robot.T_flange_tool, self.start[first])
        reached = traced.reached
        end = int(np.argmin(reached)) if not reached.all() else len(reached)
        whole = int(np.searchsorted(last, end, side="left"))  # motions of which every sample was reached
        kept = last[whole - 1] + 1 if whole else 0
        self.samples.append((move[:kept], share[:kept], traced.q[:kept]))
        for k in range(whole):
            i = first + k
            self.end[i] = traced.q[last[k]]
            self.start[i] = self.start[first] if k == 0 else self.end[i - 1]
            self._compare_posture(i)
        if whole:
            self.last = self.end[first + whole - 1]
        if end < len(reached):
            reason = dict(rejections(self.robot, traced))[end]
            self.rejected[first + whole] = f"{reason}, {share[end]:.0%} of the way there"
            if traced.outcome[end] == Outcome.OUT_OF_REACH:
                self.out_of_reach.append(first + whole)
            return first + whole + 1
        return stop

    def _solve_pose(self, i: int) -> None:
        """Find the joint positions of a pose that is not reached along a known path."""
        move = self.moves[i]
        T = self.goal[i]
        if move.end.posture is None and np.isfinite(self.near[i, 0]):
            seed = self.near[i]
        else:
            seed = self.start[i] if np.isfinite(self.start[i, 0]) else self.last
        near = np.zeros((0, len(self.robot.joints)))
        if seed is not None:
            solution = solve_near(self.model, T[None], seed[None])
            near = solution.q[solution.reached]
            if len(near) and _agrees(self.robot, move.end, near)[0]:
                self.end[i] = near[0]
                return
        try:
            postures = np.concatenate([turned(self.robot, q) for q in find_postures(self.model, T)])
        except ReachError:
            self.rejected[i] = "is out of reach, or reached outside the joint limits only"
            self.out_of_reach.append(i)
            return
        agreeing = postures[_agrees(self.robot, move.end, postures)]
        if not len(agreeing):
            self._take_nearest(i, postures)
            return
        if seed is None:
            self.end[i] = agreeing[0]
        else:
            self.end[i] = agreeing[np.argmin(np.abs(agreeing - seed).max(axis=1))]

    def _take_nearest(self, i: int, postures: Float[np.ndarray, "n joints"]) -> None:
        """Of postures of which none is the one that is stated, take the nearest where the controller does."""
        end = self.moves[i].end
        stated = f"states the posture {end.posture}, in which the robot does not reach it inside its joint limits"
        if not isinstance(end.posture, GradedPosture):
            self.rejected[i] = f"{stated}; it does so in other postures only"
            return
        miss = end.posture.miss(self.robot, postures)
        nearest = int(np.argmin(miss))
        joints = ", ".join(f"{angle:.1f}" for angle in np.degrees(postures[nearest]))
        text = f"{stated}; the nearest is at joints [{joints}]°, {np.degrees(miss[nearest]):.0f}° from it"
        if end.posture_binds and miss[nearest] > end.posture.tolerated:
            self.rejected[i] = text
        else:
            self.end[i] = postures[nearest]
            self.warnings[i] = f"{text}, and is taken"

    def _compare_posture(self, i: int) -> None:
        move = self.moves[i]
        if not _agrees(self.robot, move.end, self.end[i][None])[0]:
            self.warnings[i] = f"says posture {move.end.posture}, but the path leads there in another"


def _agrees(robot: Robot, target: Target, q: Float[np.ndarray, "n joints"]) -> np.ndarray:
    return np.ones(len(q), dtype=bool) if target.posture is None else target.posture.agrees(robot, q)


def _groups(move: Int[np.ndarray, " k"]) -> list[tuple[int, slice]]:
    """Each motion of sorted numbers, with the rows that are its own."""
    numbers, first = np.unique(move, return_index=True)
    ends = [*first[1:], len(move)]
    return [(int(i), slice(int(a), int(b))) for i, a, b in zip(numbers, first, ends, strict=True)]
