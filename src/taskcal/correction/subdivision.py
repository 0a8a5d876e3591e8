"""Subdivision of corrected lines and arcs until the true tool follows them between their ends."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float, Int

from robot_programs.core.program import Motion, Target
from taskcal.correction.controller import ControllerTrajectory, DriveDirections
from taskcal.correction.path import PlacedMotions, Segments
from taskcal.correction.tool_poses import solve_calibrated
from taskcal.identification.calibration import Calibration
from taskcal.kinematics.inverse import solve_near
from taskcal.robot.conditions import Conditions
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot import Robot

MAX_PIECES = 4096
"""Pieces that one motion is divided into at most."""

MAX_ROUNDS = 12
"""Divisions of a motion, each by a deviation that was measured: the second or third ends nearly all."""

LENGTH_MARGIN = 1.1
"""Factor by which pieces are taken shorter than the square root of their deviation states."""

MAX_GROWTH = 0.5
"""Motions that may be added, as a share of those that are corrected, before the tolerance is widened."""

WIDENING = 1.2
"""Factor of one step in which a tolerance is widened."""

MIN_ROOM = 1e-6
"""Share of a motion's length in which no further target is put."""


@dataclass(frozen=True, eq=False, kw_only=True)
class CorrectionProblem:
    """The motions of a program, the path they ask for, and the robot as calibrated."""

    robot: Robot
    motions: Sequence[Motion]
    calibration: Calibration
    placed: PlacedMotions
    """On the robot as calibrated."""
    wanted: Segments
    trajectory: ControllerTrajectory
    """Of the program as it was given, on the nominal robot."""
    directions: DriveDirections | None
    """Of the drives, where the calibration depends on them."""
    tolerance: float
    """Of the true tool's distance from its path between nodes, metres."""
    widest: float = 0.0
    """To how much that may be widened where the program would grow too much, metres; not at all where it is less."""

    @cached_property
    def nominal(self) -> PlacedMotions:
        """The motions on the robot as its controller knows it."""
        return PlacedMotions.nominal(self.robot, self.motions)

    @cached_property
    def is_circular(self) -> Bool[np.ndarray, " m"]:
        """Motions that have a via point, whether or not their start is known."""
        return np.array([move.via is not None for move in self.motions], dtype=bool)

    @cached_property
    def clear(self) -> Float[np.ndarray, "m 2"]:
        """Shares of the motions' lengths, from their starts and before their ends, in which no target may be put.

        A controller rounds a corner by no more than half of the way to the target next to it; a target that stood nearer would
        make the corner another one.
        """
        corners = self.trajectory.corners
        return 2.0 * np.stack([corners.entry.max(axis=1), corners.exit.max(axis=1)], axis=1)

    def seeds(self, move: Int[np.ndarray, " k"], share: Float[np.ndarray, " k"]) -> Float[np.ndarray, "k joints"]:
        """Nominal joint positions along motions, between the samples of the controller's trajectory."""
        trajectory = self.trajectory
        if not len(move):
            return np.zeros((0, trajectory.end.shape[1]))
        rows = np.arange(len(self.motions))
        started = np.isfinite(trajectory.start[:, 0])
        ended = np.isfinite(trajectory.end[:, 0])
        place = np.concatenate([trajectory.move + trajectory.share, rows[started] + 1e-9, rows[ended] + 1.0 - 1e-9])
        q = np.concatenate([trajectory.q, trajectory.start[started], trajectory.end[ended]])
        order = np.argsort(place, kind="stable")
        at = move + np.clip(share, 2e-9, 1.0 - 2e-9)
        return np.stack([np.interp(at, place[order], column[order]) for column in q.T], axis=1)

    def conditions(self, move: Int[np.ndarray, " k"], share: Float[np.ndarray, " k"]) -> Conditions | None:
        """Under which the robot is there, at shares of the lengths of some motions."""
        return None if self.directions is None else self.directions.at(move, share)


@dataclass(frozen=True, eq=False, kw_only=True)
class Nodes:
    """Ends of the pieces of corrected motions, and a via point of each arc; sorted by motion and share."""

    move: Int[np.ndarray, " k"]
    share: Float[np.ndarray, " k"]
    """Share of the motion's length."""
    q: Float[np.ndarray, "k joints"]
    """Joint positions to which the controller must move, radians."""
    reached: Bool[np.ndarray, " k"]
    wanted: Float[np.ndarray, "k 4 4"]
    """Pose of the tool in the part's frame that the true robot is to take there."""
    T: Float[np.ndarray, "k 4 4"]
    """Pose of the tool in the part's frame that the controller takes for these joint positions; an estimate where not reached."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Subdivision:
    """Corrected motions, lines and arcs in pieces."""

    pieces: Int[np.ndarray, " m"]
    """Into how many each motion is divided; 0 for those that are not corrected."""
    nodes: Nodes
    deviation: Float[np.ndarray, " m"]
    """Largest distance of the true tool from the path between nodes, metres; zero where nothing lies between."""
    tolerance: float
    """Of that distance, to which the motions were divided, metres."""


def subdivide(problem: CorrectionProblem) -> Subdivision:
    """Correct all motions that the nominal robot can execute, dividing lines and arcs until they keep to their paths.

    Where they would become more than the problem allows, the tolerance is widened until they do not.
    """
    tolerance = problem.tolerance
    while True:
        subdivision = _divide(problem, tolerance)
        tolerance = subdivision.tolerance * WIDENING
        kept = subdivision.pieces[np.isfinite(subdivision.deviation) & (subdivision.pieces > 0)]
        if tolerance > problem.widest or kept.sum() <= len(kept) * (1.0 + MAX_GROWTH):
            return subdivision


def _divide(problem: CorrectionProblem, tolerance: float) -> Subdivision:
    """The same to a tolerance, which is widened at once by what the motions' deviations show, as long as they are whole."""
    trajectory, m = problem.trajectory, len(problem.motions)
    curved = np.array([move.kind in ("linear", "circular") for move in problem.motions], dtype=bool)
    divisible = np.array([move.divisible for move in problem.motions], dtype=bool)
    along = curved & divisible & np.isfinite(trajectory.start[:, 0]) & np.isfinite(problem.wanted.start[:, 0, 0])
    pieces = np.isfinite(trajectory.end[:, 0]).astype(np.int64)
    open_ = along & (pieces > 0)
    nodes = _nodes(problem, np.flatnonzero(pieces), pieces)
    lost = np.zeros(m, dtype=bool)
    lost[nodes.move[~nodes.reached]] = True
    before = np.array([-1 if move.follows is None else move.follows for move in problem.motions], dtype=np.int64)
    open_ &= ~lost & ~lost[before]
    deviation, mendable = np.zeros(m), np.zeros(0)
    todo = np.flatnonzero(open_)
    for round_ in range(MAX_ROUNDS):
        if len(todo):
            deviation[todo], mendable = _deviations(problem, nodes, todo, pieces)
            if not round_:
                tolerance = _widened(tolerance, problem.widest, mendable, MAX_GROWTH * np.count_nonzero(pieces))
            more = (mendable > tolerance) & (pieces[todo] < MAX_PIECES)
            todo, mendable = todo[more], mendable[more]
        if not len(todo):
            break
        # the deviation of a chord goes with the square of its length
        factor = np.minimum(np.sqrt(mendable / tolerance) * LENGTH_MARGIN, 16.0)
        pieces[todo] = np.minimum(np.maximum(np.ceil(pieces[todo] * factor), pieces[todo] + 1), MAX_PIECES)
        nodes = _replaced(nodes, _nodes(problem, todo, pieces), todo)
    return Subdivision(pieces=pieces, nodes=nodes, deviation=deviation, tolerance=tolerance)


def _widened(tolerance: float, widest: float, deviation: Float[np.ndarray, " r"], more: float) -> float:
    """A tolerance for which motions that are off by so much, undivided, become no more than so many more, or the widest."""
    finite = deviation[np.isfinite(deviation)]
    while tolerance * WIDENING <= widest:
        added = np.ceil(np.sqrt(finite[finite > tolerance] / tolerance) * LENGTH_MARGIN) - 1.0
        if added.sum() <= more:
            break
        tolerance *= WIDENING
    return tolerance


def _nodes(problem: CorrectionProblem, rows: Int[np.ndarray, " r"], pieces: Int[np.ndarray, " m"]) -> Nodes:
    """Nodes of some motions."""
    per_piece = np.where(problem.is_circular[rows], 2, 1)
    count = pieces[rows] * per_piece
    move = np.repeat(rows, count)
    number = np.arange(len(move)) - np.repeat(np.cumsum(count) - count, count) + 1
    ends = _piece_ends(problem, rows, pieces)
    share = ends if (per_piece == 1).all() else _with_vias(ends, problem.is_circular[np.repeat(rows, pieces[rows])])
    # an arc that stays whole keeps its own via point
    via = (pieces[move] == 1) & problem.is_circular[move] & (number == 1)
    on_arc = via & problem.wanted.is_arc[move]
    share[on_arc] = problem.wanted.via_share[move[on_arc]]
    at_end = number == np.repeat(count, count)
    T = np.where(at_end[:, None, None], problem.wanted.end[move], problem.wanted.at(move, share))
    for k in np.flatnonzero(via & ~on_arc):  # where an arc begins is not known: its points are corrected one by one
        T[k] = _pose(problem.motions[int(move[k])].via)
    seeds = problem.seeds(move, share)
    conditions = problem.conditions(move, share)
    solution = solve_calibrated(problem.calibration, problem.placed.robot_tool(move, T), seeds, conditions)
    met, lost = np.flatnonzero(solution.reached), np.flatnonzero(~solution.reached)
    stated = T.copy()
    stated[met] = problem.nominal.tool_in_part(move[met], share[met], solution.q[met])
    # no joints to take the controller's pose from: moved by as much as the true tool is off at the nominal joints
    stated[lost, :3, 3] += T[lost, :3, 3] - problem.placed.tool_in_part(move[lost], share[lost], seeds[lost])[:, :3, 3]
    return Nodes(move=move, share=share, q=solution.q, reached=solution.reached, wanted=T, T=stated)


def _piece_ends(
    problem: CorrectionProblem, rows: Int[np.ndarray, " r"], pieces: Int[np.ndarray, " m"]
) -> Float[np.ndarray, " p"]:
    """Shares of their motion's length at which the pieces of some motions end: evenly, and clear of the corners."""
    count = pieces[rows]
    owner = np.repeat(np.arange(len(rows)), count)
    number = np.arange(len(owner)) - np.repeat(np.cumsum(count) - count, count) + 1
    n, clear = count[owner], problem.clear[rows][owner]
    room = np.stack([np.zeros(len(n)), np.ones(len(n))], axis=1)
    bound = np.zeros((len(n), 2), dtype=bool)
    for _ in range(2):  # where one end has to stay clear, the other may come to lack room
        between = np.maximum(n - bound.sum(axis=1), 1)
        bound |= clear > ((room[:, 1] - room[:, 0]) / between)[:, None]
        room = np.where(bound, np.stack([clear[:, 0], 1.0 - clear[:, 1]], axis=1), [0.0, 1.0])
    between = np.maximum(n - bound.sum(axis=1), 1)
    inner = room[:, 0] + (room[:, 1] - room[:, 0]) * (number - bound[:, 0]) / between
    inner = np.where(n == 2, np.clip(0.5, clear[:, 0], np.maximum(1.0 - clear[:, 1], clear[:, 0])), inner)
    return np.where(number == n, 1.0, inner)


def _with_vias(ends: Float[np.ndarray, " p"], circular: Bool[np.ndarray, " p"]) -> Float[np.ndarray, " k"]:
    """Ends of pieces, with the middle of a piece before its end where it is an arc's."""
    begin = np.where(np.concatenate([[1.0], ends[:-1]]) >= 1.0, 0.0, np.concatenate([[0.0], ends[:-1]]))
    both = np.stack([(begin + ends) / 2.0, ends], axis=1)
    return both[np.stack([circular, np.ones(len(ends), dtype=bool)], axis=1)]


def _pose(target: Target | None) -> Float[np.ndarray, "4 4"]:
    if target is None or target.T is None:
        raise ValueError("a via point of an arc is a pose")
    return target.T


def _replaced(nodes: Nodes, new: Nodes, rows: Int[np.ndarray, " r"]) -> Nodes:
    kept = ~np.isin(nodes.move, rows)
    joined = {
        name: np.concatenate([getattr(nodes, name)[kept], getattr(new, name)])
        for name in ("move", "share", "q", "reached", "wanted", "T")
    }
    order = np.lexsort((joined["share"], joined["move"]))
    return Nodes(**{name: array[order] for name, array in joined.items()})


def _deviations(
    problem: CorrectionProblem, nodes: Nodes, rows: Int[np.ndarray, " r"], pieces: Int[np.ndarray, " m"]
) -> tuple[Float[np.ndarray, " r"], Float[np.ndarray, " r"]]:
    """Largest distance of the true tool from each of some motions, between its nodes, metres.

    Of all pieces, and of those that can be divided further.
    """
    first = np.searchsorted(nodes.move, rows, side="left")
    arc = problem.is_circular[rows]
    stride = np.where(arc, 2, 1)
    owner = np.repeat(np.arange(len(rows)), pieces[rows])
    piece = np.arange(len(owner)) - np.repeat(np.cumsum(pieces[rows]) - pieces[rows], pieces[rows])
    end = first[owner] + (piece + 1) * stride[owner] - 1
    previous = np.array([problem.motions[i].follows for i in rows], dtype=np.int64)
    start_q = nodes.q[np.searchsorted(nodes.move, previous, side="right") - 1]
    start_T = problem.nominal.tool_in_part(rows, np.zeros(len(rows)), start_q)
    inner = piece > 0
    before = np.maximum(end - stride[owner], 0)
    q0 = np.where(inner[:, None], nodes.q[before], start_q[owner])
    T0 = np.where(inner[:, None, None], nodes.T[before], start_T[owner])
    via = np.where(arc[owner, None], nodes.T[np.maximum(end - 1, 0), :3, 3], np.nan)
    segments = Segments(start=T0, end=nodes.T[end], via=via)
    finish = _piece_ends(problem, rows, pieces)
    begin = np.where(piece == 0, 0.0, np.concatenate([[0.0], finish[:-1]]))
    divisible = _have_room(begin, finish, problem.clear[rows][owner])
    out, mendable = np.zeros(len(rows)), np.zeros(len(rows))
    model = ErrorModel(problem.robot)
    for within in (0.25, 0.5, 0.75):
        k = np.arange(len(owner))
        T = segments.at(k, np.full(len(k), within))
        move = rows[owner]
        solution = solve_near(model, problem.nominal.robot_tool(move, T), q0 + within * (nodes.q[end] - q0))
        share = begin + within * (finish - begin)
        wanted = problem.wanted.at(move, share)
        error = problem.placed.tool_in_part(move, share, solution.q)[:, :3, 3] - wanted[:, :3, 3]
        tangent = problem.wanted.direction(move, share)
        error -= (error * tangent).sum(axis=1, keepdims=True) * tangent
        size = np.where(solution.reached, np.linalg.norm(error, axis=1), np.inf)
        np.maximum.at(out, owner, size)
        np.maximum.at(mendable, owner, np.where(divisible, size, 0.0))
    return out, mendable


def _have_room(
    begin: Float[np.ndarray, " p"], finish: Float[np.ndarray, " p"], clear: Float[np.ndarray, "p 2"]
) -> Bool[np.ndarray, " p"]:
    """Whether a further target may be put into pieces, by what is to stay clear at both ends of their motions."""
    return np.minimum(finish, 1.0 - clear[:, 1]) - np.maximum(begin, clear[:, 0]) > MIN_ROOM
