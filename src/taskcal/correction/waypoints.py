"""What is written for the motions that a correction changes."""

from collections.abc import Sequence, Set

import numpy as np

from taskcal.correction.correction import Bounds
from taskcal.correction.correction_problem import CorrectionProblem
from taskcal.correction.rejections import find_rejections
from taskcal.correction.subdivision import Subdivision
from taskcal.correction.target_changes import TargetChanges
from taskcal.programs.program import Move, Program, Waypoint
from taskcal.programs.unwritable import keep_together

UNMOVED, UNTURNED = 1e-7, 1e-7
"""A target that moves and turns by less, metres and radians, keeps its text."""


def choose_waypoints(
    problem: CorrectionProblem,
    subdivision: Subdivision,
    changes: TargetChanges,
    bounds: Bounds,
    *,
    keep_joints: bool,
    program: Program | None,
) -> tuple[dict[int, tuple[Waypoint, ...]], dict[int, str]]:
    """What is written, by number of the motion, and the motions that are left as they are, with the reason.

    Args:
        problem: what is corrected.
        subdivision: as corrected.
        changes: how far that moves the targets.
        bounds: how far they may be moved.
        keep_joints: leave motions to joint positions as they are.
        program: the one whose own text is rewritten; None where a new one is written.
    """
    moves, robot = problem.moves, problem.robot
    kept = {i for i, move in enumerate(moves) if keep_joints and move.kind == "axes"}
    rejected = problem.trajectory.rejected | find_rejections(robot, subdivision, changes, bounds)
    rejected = {i: why for i, why in rejected.items() if i not in kept}
    waypoints = _waypoints(moves, subdivision, changes, kept | rejected.keys())
    if program is not None:
        visits = tuple(program.visits())
        while True:
            more = program.unwritable(robot, waypoints, subdivision.tolerance)
            more = more or keep_together(visits, rejected, waypoints)
            if not more:
                break
            rejected |= more
            waypoints = {i: path for i, path in waypoints.items() if i not in more}
    return waypoints, rejected


def _waypoints(
    moves: Sequence[Move], subdivision: Subdivision, changes: TargetChanges, kept: Set[int]
) -> dict[int, tuple[Waypoint, ...]]:
    """What is written for every motion that changes.

    Args:
        moves: the motions of the program.
        subdivision: as corrected.
        changes: how far that moves them.
        kept: numbers of motions that stay as they are.
    """
    nodes = subdivision.nodes
    first = np.searchsorted(nodes.move, np.arange(len(moves) + 1))
    waypoints: dict[int, tuple[Waypoint, ...]] = {}
    for i, move in enumerate(moves):
        rows = range(first[i], first[i + 1])
        unchanged = subdivision.pieces[i] == 1 and changes.shift[i] < UNMOVED and changes.turn[i] < UNTURNED
        if i in kept or not rows or unchanged:
            continue
        if move.kind == "axes":
            waypoints[i] = (Waypoint(kind="axes", q=nodes.q[rows[-1]], T=None),)
            continue
        if move.via is None:
            waypoints[i] = tuple(
                Waypoint(
                    kind=move.kind,
                    q=nodes.q[k],
                    T=nodes.T[k],
                    external=_external(moves, i, nodes.share[k]),
                    share=float(nodes.share[k]),
                )
                for k in rows
            )
            continue
        waypoints[i] = tuple(
            Waypoint(
                kind="circular",
                q=nodes.q[k],
                T=nodes.T[k],
                via=Waypoint(kind="circular", q=nodes.q[k - 1], T=nodes.T[k - 1]),
                external=_external(moves, i, nodes.share[k]),
                share=float(nodes.share[k]),
            )
            for k in rows[1::2]
        )
    return waypoints


def _external(moves: Sequence[Move], i: int, share: float) -> tuple[float, ...]:
    """Positions of the external axes at a share of a motion's length; empty where they stay, or their start is not known.

    A controller moves them in step with the way of the tool.
    """
    follows = moves[i].follows
    start, end = () if follows is None else moves[follows].external, moves[i].external
    if share >= 1.0 or start == end or len(start) != len(end):
        return ()
    return tuple(b if np.isnan(a) else a + share * (b - a) for a, b in zip(start, end, strict=True))
