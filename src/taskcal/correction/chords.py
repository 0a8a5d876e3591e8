"""How many pieces a corrected line or arc takes until the true tool keeps to it between its ends."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float, Int

from taskcal.correction.controller import Driven
from taskcal.correction.fixed_frame import nominal_flange
from taskcal.correction.inverse import solve_calibrated
from taskcal.correction.placement import Placed
from taskcal.correction.way import Ways
from taskcal.identification.calibration import Calibration
from taskcal.kinematics.inverse import solve_near
from taskcal.programs.program import Move, Target
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot import Robot

MOST = 4096
"""Pieces that one motion is cut into at most."""

ROUNDS = 12


@dataclass(frozen=True, eq=False, kw_only=True)
class Nodes:
    """Ends of the pieces of corrected motions, and a point on the way of each arc; sorted by motion and share."""

    move: Int[np.ndarray, " k"]
    share: Float[np.ndarray, " k"]
    """Share of the motion's length."""
    q: Float[np.ndarray, "k joints"]
    """Joint positions to which the controller must drive, radians."""
    reached: Bool[np.ndarray, " k"]
    wanted: Float[np.ndarray, "k 4 4"]
    """Pose of the tool in the part's frame that the true robot is to take there."""
    T: Float[np.ndarray, "k 4 4"]
    """Pose of the tool in the part's frame that the controller takes for these joint positions; an estimate where not reached."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Chords:
    """Corrected motions."""

    pieces: Int[np.ndarray, " m"]
    """Into how many each motion is cut; 0 for those that are not corrected."""
    nodes: Nodes
    deviation: Float[np.ndarray, " m"]
    """Largest distance of the true tool from the way between nodes, metres; zero where nothing lies between."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Wish:
    """What is to be corrected."""

    robot: Robot
    moves: Sequence[Move]
    calibration: Calibration
    placed: Placed
    """On the robot as calibrated."""
    wanted: Ways
    driven: Driven
    """The program as it was given, on the nominal robot."""
    tolerance: float
    """Of the true tool's distance from its way between nodes, metres."""

    @cached_property
    def is_circular(self) -> Bool[np.ndarray, " m"]:
        """Motions that have a point on the way, whether or not their start is known."""
        return np.array([move.via is not None for move in self.moves], dtype=bool)

    def seeds(self, move: Int[np.ndarray, " k"], share: Float[np.ndarray, " k"]) -> Float[np.ndarray, "k joints"]:
        """Nominal joint positions along motions, between the samples that were driven."""
        driven = self.driven
        if not len(move):
            return np.zeros((0, driven.end.shape[1]))
        rows = np.arange(len(self.moves))
        known = np.isfinite(driven.start[:, 0])
        ended = np.isfinite(driven.end[:, 0])
        place = np.concatenate([driven.move + driven.share, rows[known] + 1e-9, rows[ended] + 1.0 - 1e-9])
        q = np.concatenate([driven.q, driven.start[known], driven.end[ended]])
        order = np.argsort(place, kind="stable")
        wanted = move + np.clip(share, 2e-9, 1.0 - 2e-9)
        return np.stack([np.interp(wanted, place[order], column[order]) for column in q.T], axis=1)


def cut(wish: Wish) -> Chords:
    """Correct all motions that the nominal robot can drive, cutting lines and arcs until they keep to their ways."""
    driven, m = wish.driven, len(wish.moves)
    curved = np.array([move.kind in ("linear", "circular") for move in wish.moves], dtype=bool)
    along = curved & np.isfinite(driven.start[:, 0]) & np.isfinite(wish.wanted.start[:, 0, 0])
    pieces = np.isfinite(driven.end[:, 0]).astype(np.int64)
    open_ = along & (pieces > 0)
    nodes = _nodes(wish, np.flatnonzero(pieces), pieces)
    lost = np.zeros(m, dtype=bool)
    lost[nodes.move[~nodes.reached]] = True
    before = np.array([-1 if move.follows is None else move.follows for move in wish.moves], dtype=np.int64)
    open_ &= ~lost & ~lost[before]
    deviation = np.zeros(m)
    todo = np.flatnonzero(open_)
    for _ in range(ROUNDS):
        if len(todo):
            deviation[todo] = _deviations(wish, nodes, todo, pieces)
            todo = todo[(deviation[todo] > wish.tolerance) & (pieces[todo] < MOST)]
        if not len(todo):
            break
        # the deviation of a chord goes with the square of its length
        factor = np.minimum(np.sqrt(deviation[todo] / wish.tolerance) * 1.1, 16.0)
        pieces[todo] = np.minimum(np.maximum(np.ceil(pieces[todo] * factor), pieces[todo] + 1), MOST)
        nodes = _replaced(nodes, _nodes(wish, todo, pieces), todo)
    return Chords(pieces=pieces, nodes=nodes, deviation=deviation)


def _nodes(wish: Wish, rows: Int[np.ndarray, " r"], pieces: Int[np.ndarray, " m"]) -> Nodes:
    """Nodes of some motions."""
    per_piece = np.where(wish.is_circular[rows], 2, 1)
    count = pieces[rows] * per_piece
    move = np.repeat(rows, count)
    number = np.arange(len(move)) - np.repeat(np.cumsum(count) - count, count) + 1
    share = number / np.repeat(count, count)
    # an arc that stays whole keeps its own point on the way
    via = (pieces[move] == 1) & wish.is_circular[move] & (number == 1)
    known = via & wish.wanted.is_arc[move]
    share[known] = wish.wanted.via_share[move[known]]
    at_end = number == np.repeat(count, count)
    T = np.where(at_end[:, None, None], wish.wanted.end[move], wish.wanted.at(move, share))
    for k in np.flatnonzero(via & ~known):  # where an arc begins is not known: its points are corrected one by one
        T[k] = _pose(wish.moves[int(move[k])].via)
    seeds = wish.seeds(move, share)
    found = solve_calibrated(wish.calibration, wish.placed.robot_tool(move, T), seeds)
    met, lost = np.flatnonzero(found.reached), np.flatnonzero(~found.reached)
    stated = T.copy()
    stated[met] = _controller(wish, move[met], found.q[met])
    # no joints to take the controller's pose from: moved by as much as the true tool is off at the nominal joints
    stated[lost, :3, 3] += T[lost, :3, 3] - wish.placed.tool_in_part(move[lost], seeds[lost])[:, :3, 3]
    return Nodes(move=move, share=share, q=found.q, reached=found.reached, wanted=T, T=stated)


def _pose(target: Target | None) -> Float[np.ndarray, "4 4"]:
    if target is None or target.T is None:
        raise ValueError("a point on the way of an arc is a pose")
    return target.T


def _controller(
    wish: Wish, move: Int[np.ndarray, " k"], q: Float[np.ndarray, "k joints"]
) -> Float[np.ndarray, "k 4 4"]:
    """Tool in part as the controller has it at joint positions."""
    flange = nominal_flange(wish.robot, q)
    out = np.empty_like(flange)
    for rows, example in _alike(wish, move):
        out[rows] = example.target(flange[rows])
    return out


def _alike(wish: Wish, move: Int[np.ndarray, " k"]) -> list[tuple[Int[np.ndarray, " _"], Move]]:
    """Rows whose motions have tool and part in common, with one of these motions."""
    own = wish.placed.number[move]
    return [(rows, wish.moves[int(move[rows[0]])]) for rows in (np.flatnonzero(own == k) for k in np.unique(own))]


def _replaced(nodes: Nodes, new: Nodes, rows: Int[np.ndarray, " r"]) -> Nodes:
    kept = ~np.isin(nodes.move, rows)
    joined = {
        name: np.concatenate([getattr(nodes, name)[kept], getattr(new, name)])
        for name in ("move", "share", "q", "reached", "wanted", "T")
    }
    order = np.lexsort((joined["share"], joined["move"]))
    return Nodes(**{name: array[order] for name, array in joined.items()})


def _deviations(
    wish: Wish, nodes: Nodes, rows: Int[np.ndarray, " r"], pieces: Int[np.ndarray, " m"]
) -> Float[np.ndarray, " r"]:
    """Largest distance of the true tool from each of some motions, between its nodes, metres."""
    first = np.searchsorted(nodes.move, rows, side="left")
    arc = wish.is_circular[rows]
    stride = np.where(arc, 2, 1)
    owner = np.repeat(np.arange(len(rows)), pieces[rows])
    piece = np.arange(len(owner)) - np.repeat(np.cumsum(pieces[rows]) - pieces[rows], pieces[rows])
    end = first[owner] + (piece + 1) * stride[owner] - 1
    begin_q, begin_T = _begins(wish, nodes, rows)
    inner = piece > 0
    before = np.maximum(end - stride[owner], 0)
    q0 = np.where(inner[:, None], nodes.q[before], begin_q[owner])
    T0 = np.where(inner[:, None, None], nodes.T[before], begin_T[owner])
    via = np.where(arc[owner, None], nodes.T[np.maximum(end - 1, 0), :3, 3], np.nan)
    ways = Ways(start=T0, end=nodes.T[end], via=via)
    out = np.zeros(len(rows))
    model = ErrorModel(wish.robot)
    own_tool = wish.robot.T_flange_tool
    for within in (0.25, 0.5, 0.75):
        k = np.arange(len(owner))
        T = ways.at(k, np.full(len(k), within))
        move = rows[owner]
        flange = np.empty_like(T)
        for alike, example in _alike(wish, move):
            flange[alike] = example.flange(T[alike])
        found = solve_near(model, flange @ own_tool, q0 + within * (nodes.q[end] - q0))
        share = (piece + within) / pieces[move]
        wanted = wish.wanted.at(move, share)
        error = wish.placed.tool_in_part(move, found.q)[:, :3, 3] - wanted[:, :3, 3]
        tangent = wish.wanted.direction(move, share)
        error -= (error * tangent).sum(axis=1, keepdims=True) * tangent
        size = np.where(found.reached, np.linalg.norm(error, axis=1), np.inf)
        np.maximum.at(out, owner, size)
    return out


def _begins(
    wish: Wish, nodes: Nodes, rows: Int[np.ndarray, " r"]
) -> tuple[Float[np.ndarray, "r joints"], Float[np.ndarray, "r 4 4"]]:
    """Where the corrected motions before some begin them: joint positions, and tool in part as the controller has it."""
    previous = np.array([_previous(wish.moves[i]) for i in rows], dtype=np.int64)
    last = np.searchsorted(nodes.move, previous, side="right") - 1
    q = nodes.q[last]
    return q, _controller(wish, rows, q)


def _previous(move: Move) -> int:
    if move.follows is None:
        raise ValueError("a motion without a known start has no way to cut")
    return move.follows
