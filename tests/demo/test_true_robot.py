"""True robots that no model of the fit describes: each part does what it is said to do, and no fit can try it."""

import numpy as np
import pytest

from taskcal.demo.true_robot import ElasticLinks, GearErrors, Sizes, UnevenExpansion, draw_true_robot
from taskcal.robot.effects.base import kinds
from taskcal.robot.error_model import ErrorModel

NOTHING = dict.fromkeys(("links", "drives", "gears", "lost_motion", "expansion"), 0.0)


def test_no_fit_can_try_what_the_truth_is_made_of():
    import taskcal.demo.true_robot  # noqa: F401

    assert not {ElasticLinks, GearErrors, UnevenExpansion} & set(kinds())


@pytest.mark.parametrize("part", NOTHING)
def test_each_part_alone_moves_the_tool_by_its_size(robot, q, part):
    """Twice the size moves it farther, and without any a robot has its defects of geometry alone."""
    nominal = ErrorModel(robot)
    moved = []
    for size in (0.0, 1.0, 2.0):
        true = draw_true_robot(robot, np.random.default_rng(1), Sizes(**{**NOTHING, part: size}))
        x = true.x.copy()
        x[: len(nominal)] = 0.0
        off = true.model.poses(q, x, true.measured(q))[:, :3, 3] - nominal.poses(q)[:, :3, 3]
        moved.append(np.linalg.norm(off, axis=1).max())
    assert moved[0] < 1e-12
    assert 5e-6 < moved[1] < 5e-3
    assert moved[2] == pytest.approx(2.0 * moved[1], rel=0.2)


def test_draws_repeat(robot, q):
    first, second = (draw_true_robot(robot, np.random.default_rng(3)) for _ in range(2))
    np.testing.assert_array_equal(first.milled(q), second.milled(q))
