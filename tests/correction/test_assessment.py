from dataclasses import replace

import numpy as np

from taskcal.correction.controller import simulate_controller
from taskcal.correction.correction import Deviations, assess
from taskcal.correction.path import Placed
from taskcal.geometry import se3
from taskcal.identification.measured_range import MeasuredRange


def test_unknown_start_is_assessed_at_the_end_only(robot, make_moves, middle):
    """A way whose start is not known is assessed at its end only."""
    motions = make_moves([middle @ se3.translation(0.05 * k, 0.0, 0.0) for k in range(3)])
    trajectory = simulate_controller(robot, motions)
    placed = Placed.nominal(robot, motions)
    path = trajectory.path_on(placed, motions)
    start = path.segments.start.copy()
    start[1] = np.nan
    every, found = (
        assess(placed, path, trajectory),
        assess(placed, replace(path, segments=replace(path.segments, start=start)), trajectory),
    )
    assert (every.move == 1).sum() > 1
    assert found.at_target[found.move == 1].tolist() == [True]
    kept = every.at_target | (every.move != 1)
    np.testing.assert_array_equal(found.error, every.error[kept])
    np.testing.assert_array_equal(found.q, every.q[kept])


def test_a_motion_is_judged_where_any_joint_is_farthest_out():
    """Of each motion the row at which the joint that is farthest outside of what was measured is so."""
    rng, rows, motions = np.random.default_rng(1), 40, 6
    measured = MeasuredRange(
        joints=("a", "b"),
        prismatic=(False, False),
        low=-np.ones(2),
        high=np.ones(2),
        same_after_turn=np.zeros(2, dtype=bool),
    )
    q, move = rng.uniform(-3.0, 3.0, (rows, 2)), rng.integers(0, motions - 1, rows)
    every = Deviations(
        move=move,
        share=np.ones(rows),
        at_target=np.ones(rows, dtype=bool),
        q=q,
        error=np.zeros((rows, 3)),
        turn=np.zeros(rows),
    )
    found = every.farthest(measured, motions)
    assert np.isnan(found[-1]).all()
    for k in range(motions - 1):
        out = {tuple(row): max(0.0, *(abs(value) - 1.0 for value in row)) for row in q[move == k]}
        assert out[tuple(found[k])] == max(out.values())
