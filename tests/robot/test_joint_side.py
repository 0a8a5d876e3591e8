"""A four-bar drive: the side it is built on, and that no other is taken for it."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from taskcal.errors import ClosureError
from taskcal.geometry.four_bar import FourBar
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.joint_side import FourBarDrive
from tests.laws.robots import generators

PARALLELOGRAM = FourBar(crank=0.5, rod=0.7, rocker=0.5, arm=0.7)


def drive(bar: FourBar) -> FourBarDrive:
    return FourBarDrive(bar=bar, arm=np.array([1.0, 0.0]), crank=np.array([0.0, 1.0]), output=np.array([1.0]))


@pytest.mark.parametrize("apart", [100.0, -100.0, 91.0, -170.0])
def test_a_parallelogram_past_its_singular_position_is_refused_with_the_pose(apart):
    model = ErrorModel(load_robot("abb-irb6660-205-1.9"))
    q = np.zeros((4, 6))
    q[2, 2] = np.radians(apart)
    for call in (model.poses, model.jacobian, model.joint_jacobian):
        with pytest.raises(ClosureError, match=r"pose 2: arm at 0\.000°.*folded over.*well under 90° apart"):
            call(q)
    np.testing.assert_array_equal(model.robot.four_bar.closes(q, np.zeros(3)), [True, True, False, True])


@given(generators, st.floats(-89.9, 89.9))
def test_a_parallelogram_closes_as_such_up_to_its_singular_position(rng, apart):
    q = np.array([[0.0, np.radians(apart)]]) + rng.uniform(-np.pi, np.pi)
    assert drive(PARALLELOGRAM).closes(q, np.zeros(3)).all()
    np.testing.assert_allclose(drive(PARALLELOGRAM).shift(q, np.zeros(3)).value, 0.0, atol=1e-12)


@given(generators)
def test_any_loop_follows_its_crank_from_where_it_was_built(rng):
    """Along a sweep of the crank away from the middle the link is the one that followed without a jump, or is refused."""
    lengths = np.array([0.5, 0.7, 0.5]) * rng.uniform(0.8, 1.25, 3)
    loop = drive(FourBar(crank=lengths[0], rod=lengths[1], rocker=lengths[2], arm=0.7))
    q = np.c_[np.zeros(4000), np.linspace(0.0, rng.choice([-1, 1]) * np.pi, 4000)]
    closing = loop.closes(q, np.zeros(3))
    assume(closing[0])
    first = len(q) if closing.all() else int(np.argmin(closing))
    assert first < len(q)  # no such loop follows its crank by half a turn
    theta = q[:first, 1] + loop.shift(q[:first], np.zeros(3)).value[:, 0]
    assert (np.diff(theta) * np.diff(q[:first, 1]) > 0.0).all()
    with pytest.raises(ClosureError, match=f"pose {first}:"):
        loop.shift(q[: first + 1], np.zeros(3))
