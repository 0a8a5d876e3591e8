"""True robots that no model of the fit describes: each part does what it is said to do, and no fit can try it."""

import numpy as np
import pytest

from taskcal.geometry import se3
from taskcal.robot.effects.base import kinds
from taskcal.robot.error_model import ErrorModel
from taskcal_demo.true_robot import (
    UNKIND,
    AxisWobble,
    ElasticLinks,
    GearErrors,
    Sizes,
    UnevenExpansion,
    draw_true_robot,
)

NOTHING = dict.fromkeys(("links", "drives", "gears", "lost_motion", "expansion", "wobble"), 0.0)


def test_no_fit_can_try_what_the_truth_is_made_of():
    import taskcal_demo.true_robot  # noqa: F401

    assert not {AxisWobble, ElasticLinks, GearErrors, UnevenExpansion} & set(kinds())


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


def test_twice_as_large_moves_the_tool_twice_as_far(robot, q):
    """The same robot, all of it doubled; to first order, and the drives' own deflection is stated with their spread."""
    once, twice = (
        draw_true_robot(robot, np.random.default_rng(1), sizes) for sizes in (None, UNKIND["twice as large"])
    )
    off = [true.milled(q)[:, :3, 3] - ErrorModel(robot).poses(q)[:, :3, 3] for true in (once, twice)]
    np.testing.assert_allclose(off[1], 2.0 * off[0], atol=0.05 * np.abs(off[0]).max())


def test_an_axis_tilts_with_its_joint_across_itself(robot, q):
    """Of the first axis against the turn by hand: about x and y of the frame in which the axis stands, at its origin."""
    model = ErrorModel(robot, effects=(AxisWobble(),))
    tilt = 1e-5
    end = np.linalg.multi_dot([*(part.transform for part in robot.joints[0].before), np.eye(4), np.eye(4)])
    rigid = ErrorModel(robot).poses(q)[:, :3, 3]
    for name, size in (
        ("J1.tilt_x_cos_2J1", np.cos(2.0 * q[:, 0])),
        ("J1.tilt_y_sin_J1J2", np.sin(q[:, 0] + q[:, 1])),
    ):
        x = np.zeros(len(model))
        x[model.names.index(name)] = tilt
        across = end[:3, "xy".index(name[8])]
        turned = [se3.exp(np.array([*(tilt * s * across)])) for s in size]
        wanted = np.einsum("nij,nj->ni", np.array(turned), rigid - end[:3, 3]) + end[:3, 3]
        np.testing.assert_allclose(model.poses(q, x)[:, :3, 3], wanted, atol=1e-9)
        assert np.abs(wanted - rigid).max() > 1e-6
