from dataclasses import replace

import numpy as np

from taskcal.correction.controller import simulate_controller
from taskcal.correction.correction import assess
from taskcal.correction.path import Placed
from taskcal.geometry import se3


def test_unknown_start_is_assessed_at_the_end_only(robot, make_moves, middle):
    """A way whose start is not known is assessed at its end only."""
    moves = make_moves([middle @ se3.translation(0.05 * k, 0.0, 0.0) for k in range(3)])
    trajectory = simulate_controller(robot, moves)
    placed = Placed.nominal(robot, moves)
    path = trajectory.path_on(placed, moves)
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
