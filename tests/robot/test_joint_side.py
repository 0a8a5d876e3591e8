"""A four-bar drive: the side it is built on, and that no other is taken for it."""

import numpy as np
import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st

from taskcal.errors import ClosureError, TaskcalError
from taskcal.geometry.four_bar import FourBar, can_close, close_four_bar
from taskcal.kernels.blocks import BLOCK
from taskcal.kernels.chunks import CHUNK
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.joint_side import FourBarDrive, JointMap, JointSide
from tests.laws.robots import generators

PARALLELOGRAM = FourBar(crank=0.5, rod=0.7, rocker=0.5, arm=0.7)


def drive(bar: FourBar) -> FourBarDrive:
    return FourBarDrive(bar=bar, arm=np.array([1.0, 0.0]), crank=np.array([0.0, 1.0]), output=np.array([1.0]))


@pytest.mark.parametrize("apart", [100.0, -100.0, 91.0, -170.0])
def test_parallelogram_past_singular_is_refused(apart):
    """A parallelogram past its singular position is refused with the pose."""
    model = ErrorModel(load_robot("abb-irb6660-205-1.9"))
    q = np.zeros((4, 6))
    q[2, 2] = np.radians(apart)
    for call in (model.poses, model.jacobian, model.joint_jacobian):
        with pytest.raises(ClosureError, match=r"pose 2: arm at 0\.000°.*folded over.*well under 90° apart"):
            call(q)
    np.testing.assert_array_equal(model.robot.four_bar.closes(q, np.zeros(3)), [True, True, False, True])


@given(generators, st.floats(-89.9, 89.9))
def test_parallelogram_closes_up_to_singular(rng, apart):
    """A parallelogram closes as such up to its singular position."""
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


@given(st.tuples(*[st.floats(0.1, 1.5)] * 4), st.sampled_from([1, -1]), st.sampled_from([-90.0, 90.0, 30.0, -150.0]))
@example((0.734, 0.288, 0.664, 0.385), 1, -90.0)
@example((1.0, 1.0, 1.0, 1.0), 1, -90.0)
@example((1.0, 1.0, 1.0, 1.0), 1, 90.0)
@settings(max_examples=40)
def test_any_loop_closes_on_one_unbroken_branch(L, assembly, lever):
    """A loop of any lengths closes on one unbroken way without dead points or a change of assembly."""
    crank_lever, rocker_lever, n = np.radians(lever), -np.pi / 2, 3600
    bar = FourBar(crank=L[0], rod=L[1], rocker=L[2], arm=L[3], crank_angle=crank_lever, assembly=assembly)
    kappa = np.arange(n) * 2.0 * np.pi / n
    q = np.c_[np.zeros(n), kappa]
    closing = drive(bar).closes(q, np.zeros(3))
    assume(closing.any() and not closing.all())
    begins = np.flatnonzero(closing & ~np.roll(closing, 1))
    assert len(begins) == 1
    way = np.roll(np.arange(n), -begins[0])[: closing.sum()]
    theta = np.unwrap(kappa[way] + drive(bar).shift(q[way], np.zeros(3)).value[:, 0])
    rocker = np.array([np.cos(theta + rocker_lever), np.sin(theta + rocker_lever)])
    rod = (
        np.array([[L[3]], [0.0]])
        + L[2] * rocker
        - L[0] * np.array([np.cos(kappa[way] + crank_lever), np.sin(kappa[way] + crank_lever)])
    )
    np.testing.assert_allclose(np.hypot(*rod), L[1], rtol=1e-9)
    turned, across = np.diff(theta), rod[0] * rocker[1] - rod[1] * rocker[0]
    assert (turned > 0.0).all() or (turned < 0.0).all()
    assert (across > 0.0).all() or (across < 0.0).all()  # rod and rocker line up where the two assemblies meet


def test_a_loop_in_its_mirrored_position_is_refused():
    loop = drive(FourBar(crank=0.734, rod=0.288, rocker=0.664, arm=0.385))
    for apart, built in ((0.0, True), (180.0, False)):
        kappa = np.radians(np.arange(-60.0, 60.0, 1.0) + apart)
        assert loop.closes(np.c_[0.0 * kappa, kappa], np.zeros(3)).any() == built
    kappa = np.radians(np.arange(90.0, 270.0))
    kappa = kappa[can_close(loop.bar, 0.0 * kappa, kappa)]
    kappa = kappa[close_four_bar(loop.bar, 0.0 * kappa, kappa).by_angle[:, 1] > 0.0]
    with pytest.raises(ClosureError, match=r"pose 0: .*mirrored, as it does not come without being taken apart"):
        loop.shift(np.c_[0.0 * kappa, kappa], np.zeros(3))


def test_crossed_loop_turns_against_its_crank():
    """Crank and rocker on opposite sides of the arm, square to it as the file says."""
    rod = np.hypot(0.6, 0.95)
    bar = FourBar(crank=0.5, rod=rod, rocker=0.45, arm=0.6, rocker_angle=np.pi / 2, assembly=-1)
    kappa = np.radians(np.linspace(-10.0, 10.0, 201))
    q = np.c_[np.zeros(201), kappa]
    theta = kappa + drive(bar).shift(q, np.zeros(3)).value[:, 0]
    assert theta[100] == pytest.approx(0.0, abs=1e-12)
    assert (np.diff(theta) < 0.0).all()
    around = np.radians(np.arange(-180.0, 180.0, 0.5))
    closing = drive(bar).closes(np.c_[0.0 * around, around], np.zeros(3))
    assert not closing.all()
    turn = close_four_bar(bar, np.zeros(closing.sum()), around[closing]).by_angle[:, 1]
    assert (turn < 0.0).all()


def side_of(rng: np.random.Generator, coordinates: int) -> JointSide:
    """Any couplings of two joints, with a parallelogram between them that moves any of the coordinates."""
    output = rng.normal(size=coordinates) * (rng.random(coordinates) < 0.5)
    bar = FourBarDrive(bar=PARALLELOGRAM, arm=np.array([1.0, 0.2]), crank=np.array([0.1, 1.0]), output=output)
    return JointSide(
        joint_map=JointMap(matrix=rng.normal(size=(coordinates, 2)), offset=rng.normal(size=coordinates)), four_bar=bar
    )


@given(generators, st.integers(1, 7), st.integers(0, 2 * BLOCK))
def test_coordinates_are_those_of_the_map_and_the_loop(rng, coordinates, n):
    side, q, xi = side_of(rng, coordinates), rng.uniform(-0.5, 0.5, (n, 2)), rng.normal(size=3) * 0.01
    used = rng.random(len(side.four_bar.pairs)) < 0.6
    s, factor = side.at(q, xi, used, coordinates + 2)
    shift = side.four_bar.shift(q, xi)
    np.testing.assert_allclose(s[:, :coordinates], side.joint_map(q) + shift.value, rtol=0.0, atol=1e-14)
    assert not s[:, coordinates:].any()
    np.testing.assert_allclose(factor, shift.jacobian[:, used], rtol=1e-14, atol=1e-15)
    plain = JointSide(joint_map=side.joint_map, four_bar=None)
    np.testing.assert_allclose(plain.at(q, xi, used[:0], coordinates)[0], side.joint_map(q), rtol=0.0, atol=1e-14)


@given(generators, st.integers(1, 2 * BLOCK))
def test_pose_does_not_depend_on_other_rows(rng, n):
    """What comes out for a pose does not depend on those beside it."""
    side, q = side_of(rng, 3), rng.uniform(-0.5, 0.5, (n, 2))
    used = np.ones(len(side.four_bar.pairs), dtype=bool)
    together = side.at(q, np.zeros(3), used, 3)
    for rows in (slice(1, None), slice(n // 2, n // 2 + 1)):
        for part, whole in zip(side.at(q[rows], np.zeros(3), used, 3), together, strict=True):
            np.testing.assert_array_equal(part, whole[rows])


@pytest.mark.parametrize("row", [0, 6, BLOCK, CHUNK + 3, 2 * CHUNK + 2])
@pytest.mark.parametrize("apart", [100.0, np.nan])
def test_a_pose_that_does_not_close_is_named_wherever_it_stands(row, apart):
    model = ErrorModel(load_robot("abb-irb6660-205-1.9"))
    q = np.zeros((2 * CHUNK + 3, 6))
    q[row, 2] = np.radians(apart)
    for call in (model.walk, model.poses, model.robot.four_bar.closes):
        if call == model.robot.four_bar.closes:
            np.testing.assert_array_equal(np.flatnonzero(~call(q, np.zeros(3))), [row])
        else:
            refused = call == model.poses and np.isnan(apart)  # before anything is computed
            with pytest.raises(TaskcalError, match=f"q: row {row} is not" if refused else f"pose {row}: arm at"):
                call(q)
