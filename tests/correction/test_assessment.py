from dataclasses import replace

import numpy as np

from taskcal.correction.controller import simulate_controller
from taskcal.correction.correction import assess
from taskcal.correction.frames import Placed, Placement, wanted_segments
from taskcal.correction.path import RoundedPath
from taskcal.geometry import se3
from taskcal.robot.error_model import ErrorModel


def test_unknown_start_is_assessed_at_the_end_only(robot, make_moves, middle):
    """A way whose start is not known is assessed at its end only."""
    moves = make_moves([middle @ se3.translation(0.05 * k, 0.0, 0.0) for k in range(3)])
    trajectory = simulate_controller(robot, moves)
    placed = Placed(
        tool_in_base=lambda q, move, share: ErrorModel(robot).poses(q),
        placements=(Placement(T_tool_grasped=np.eye(4), T_base_fixed=np.eye(4), part_in_hand=False),),
        number=np.zeros(3, dtype=np.int64),
    )
    wanted = wanted_segments(trajectory, placed, moves)
    start = wanted.start.copy()
    start[1] = np.nan
    path = RoundedPath(segments=wanted, corners=trajectory.corners)
    every, found = (
        assess(placed, path, trajectory),
        assess(placed, replace(path, segments=replace(wanted, start=start)), trajectory),
    )
    assert (every.move == 1).sum() > 1
    assert found.at_target[found.move == 1].tolist() == [True]
    kept = every.at_target | (every.move != 1)
    np.testing.assert_array_equal(found.error, every.error[kept])
    np.testing.assert_array_equal(found.q, every.q[kept])
