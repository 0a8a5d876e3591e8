"""New waypoints near the motions of a KRL program."""

import numpy as np

from robot_programs.core.program import Motion, Program, Waypoint, rotation
from taskcal.robot.catalogue import load_robot

ROBOT = load_robot("kuka-kr16-2")

Q = np.radians([5.0, -70.0, 95.0, 10.0, -30.0, -20.0])
"""Joint positions of all of them: they decide status and turn only."""


def nearby(rng: np.random.Generator, move: Motion, size: float = 1e-3) -> Waypoint:
    """Not far from a motion's end, metres and radians."""
    if move.end.T is None:
        assert move.end.q is not None
        return Waypoint(kind=move.kind, q=move.end.q + rng.normal(scale=size, size=6), T=None)
    via = None if move.via is None else Waypoint(kind=move.kind, q=Q, T=_moved(rng, move.via.T, size))
    return Waypoint(kind=move.kind, q=Q, T=_moved(rng, move.end.T, size), via=via)


def nearby_waypoints(rng: np.random.Generator, program: Program, most: int) -> dict[int, tuple[Waypoint, ...]]:
    """For about half of the motions, up to so many waypoints each; none for those that cannot be rewritten for others' sake."""
    waypoints = {
        i: tuple(nearby(rng, move) for _ in range(int(rng.integers(1, most + 1))))
        for i, move in enumerate(program.motions)
        if rng.random() < 0.5
    }
    cannot = program.unwritable(ROBOT, waypoints, tolerance=0.0)
    return {i: path for i, path in waypoints.items() if i not in cannot}


def _moved(rng: np.random.Generator, T: np.ndarray, size: float) -> np.ndarray:
    out = T.copy()
    out[:3, :3] = rotation(*rng.normal(scale=np.degrees(size), size=3)) @ T[:3, :3]
    out[:3, 3] += rng.normal(scale=size, size=3)
    return out
