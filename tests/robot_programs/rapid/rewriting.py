"""What holds whenever motions of a program are rewritten."""

from collections.abc import Mapping

import numpy as np
from scipy.spatial.transform import Rotation

from robot_programs.core.program import Program, Target, Waypoint
from taskcal.robot.robot import Robot


def nearby_waypoints(rng: np.random.Generator, program: Program, most: int) -> dict[int, tuple[Waypoint, ...]]:
    """New waypoints for some of the motions: up to `most` each, of which the last is of the motion's kind."""
    waypoints = {}
    for i, move in enumerate(program.motions):
        if rng.random() < 0.5:
            count = int(rng.integers(1, most + 1))
            kinds = ["linear", "joint", move.kind] if move.divisible else [move.kind]
            before = [_near(rng, move.end, str(rng.choice(kinds))) for _ in range(count - 1)]
            waypoints[i] = (*before, _near(rng, move.end, move.kind))
    return waypoints


def _near(rng: np.random.Generator, target: Target, kind: str) -> Waypoint:
    q = rng.uniform(-3, 3, 6)
    if kind == "axes":
        return Waypoint(kind="axes", q=q, T=None)
    T = np.eye(4) if target.T is None else target.T.copy()
    T[:3, 3] += rng.normal(scale=3e-3, size=3)
    T[:3, :3] = T[:3, :3] @ Rotation.from_rotvec(rng.normal(scale=3e-3, size=3)).as_matrix()
    via = _near(rng, target, "linear") if kind == "circular" else None
    return Waypoint(kind=kind, q=q, T=T, via=via)


def check_rewriting(program: Program, waypoints: Mapping[int, tuple[Waypoint, ...]], robot: Robot) -> None:
    """Read again, rewritten motions end where they should, and all others where they did."""
    cannot = program.unwritable(robot, waypoints, tolerance=0.0)
    waypoints = {i: path for i, path in waypoints.items() if i not in cannot}
    sources = program.rewrite(robot, waypoints)
    again = program.reread(sources)
    assert len(again.diagnostics) == len(program.diagnostics)
    motions = iter(again.motions)
    for i, move in enumerate(program.motions):
        path = waypoints.get(i)
        if path is None:
            _same(next(motions).end, move.end)
            continue
        for waypoint in path:
            found = next(motions)
            assert found.kind == waypoint.kind
            np.testing.assert_array_equal(found.tool.T, move.tool.T)
            np.testing.assert_array_equal(found.part.T, move.part.T)
            assert found.speed == move.speed
            _reaches(found.end, waypoint, robot)
            if waypoint.via is not None:
                _reaches(found.via, waypoint.via, robot)
            last = waypoint is path[-1]
            assert found.stops == (move.stops and last)
    assert next(motions, None) is None


def _same(found: Target, before: Target) -> None:
    if before.T is None:
        np.testing.assert_array_equal(found.q, before.q)
    else:
        np.testing.assert_array_equal(found.T, before.T)
        assert found.posture == before.posture


def _reaches(found: Target, waypoint: Waypoint, robot: Robot) -> None:
    """Single precision has 24 bits: 1.2e-4 mm at 1000 mm, 6e-8 of a quaternion's component, 7.6e-6° at 100°."""
    if waypoint.T is None:
        np.testing.assert_allclose(np.degrees(found.q), np.degrees(waypoint.q), rtol=1e-7, atol=2e-6)
        return
    np.testing.assert_allclose(found.T[:3, 3], waypoint.T[:3, 3], rtol=1.2e-7, atol=1.6e-7)
    turn = Rotation.from_matrix(found.T[:3, :3].T @ waypoint.T[:3, :3]).magnitude()
    assert turn < 5e-7
    assert found.posture.agrees(robot, waypoint.q[None])[0]
