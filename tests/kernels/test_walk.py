from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given
from pytransform3d import transformations as pt

from taskcal.kernels import walk
from taskcal.kernels.chain import ERROR_FRAME, FIXED, Chain, ErrorFrame, Fixed, Joint
from taskcal.kernels.chunks import CHUNK
from taskcal.kernels.walk import Columns
from tests.laws import plain
from tests.laws.chains import ChainCase, chains, rigid
from tests.laws.robots import generators


def every_column(case: ChainCase) -> tuple[Columns, np.ndarray]:
    """A layout with a column for each error-frame parameter and each joint, and its factors."""
    frames, joints, n = len(case.e), case.s.shape[1], len(case.s)
    numbers = np.arange(6 * frames + joints)
    layout = Columns(
        frames=numbers[: 6 * frames].reshape(-1, 6),
        joint=np.arange(joints),
        column=numbers[6 * frames :],
        count=len(numbers),
    )
    return layout, np.ones((n, joints))


def plain_columns(case: ChainCase, row: int) -> np.ndarray:
    """Twists (6, p) of `every_column` by complex step."""
    frames = case.e.size

    def pose(x: np.ndarray) -> np.ndarray:
        return case.pose(row, x[:frames].reshape(-1, 6), x[frames:])

    dT = plain.derivatives(pose, np.concatenate([case.e.reshape(-1), case.s[row]]))
    return plain.twists(case.pose(row), dT)


@given(chains())
def test_poses_are_the_product_of_all_transforms(case):
    T = walk.poses(case.chain, case.s, case.e)
    np.testing.assert_allclose(T, [case.pose(i) for i in range(len(case.s))], rtol=1e-10, atol=1e-12)


@given(generators)
def test_poses_agree_with_pytransform3d(rng):
    A, B = rigid(rng), rigid(rng)
    s = rng.normal(size=(1, 2))
    chain = Chain.of([Fixed(A), Joint(), Fixed(B), Joint("prismatic")])
    turned = pt.transform_from_exponential_coordinates(s[0, 0] * np.eye(6)[2])
    slid = pt.transform_from_exponential_coordinates(s[0, 1] * np.eye(6)[5])
    expected = pt.concat(slid, pt.concat(B, pt.concat(turned, A)))
    np.testing.assert_allclose(walk.poses(chain, s, np.zeros((0, 6)))[0], expected, atol=1e-12)


@given(chains(), generators)
def test_a_joint_with_a_number_moves_with_that_coordinate(case, rng):
    """Joints that are numbered in any order are those that are counted, with their coordinates in that order."""
    number = rng.permutation(case.s.shape[1])
    numbered = [
        replace(step, number=int(number[k])) for k, step in enumerate(s for s in case.steps if isinstance(s, Joint))
    ]
    steps = [numbered.pop(0) if isinstance(step, Joint) else step for step in case.steps]
    s = np.empty_like(case.s)
    s[:, number] = case.s
    np.testing.assert_array_equal(walk.poses(Chain.of(steps), s, case.e), walk.poses(case.chain, case.s, case.e))


@given(chains())
def test_columns_are_the_derivatives_of_the_poses(case):
    layout, factor = every_column(case)
    J = walk.columns(case.chain, case.s, case.e, layout, factor, angular=True)
    for row in range(len(case.s)):
        np.testing.assert_allclose(
            J[row], plain_columns(case, row), rtol=1e-10, atol=1e-10 * (1 + np.abs(J[row]).max(initial=0))
        )


@given(chains(), generators)
def test_columns_of_another_point_are_that_points_derivatives(case, rng):
    layout, factor = every_column(case)
    point = rng.normal(size=3)
    J = walk.columns(case.chain, case.s, case.e, layout, factor, angular=False, point=point)
    for row in range(len(case.s)):
        full = plain_columns(case, row)
        arm = case.pose(row)[:3, :3] @ point
        expected = full[:3] + np.cross(full[3:], arm, axis=0)
        np.testing.assert_allclose(J[row], expected, rtol=1e-10, atol=1e-10 * (1 + np.abs(expected).max(initial=0)))


@given(chains(), generators)
def test_joint_side_pairs_add_up_in_the_column_they_share(case, rng):
    joints, n = case.s.shape[1], len(case.s)
    assume(joints > 0)
    joint = np.repeat(np.arange(joints), 2)
    column = rng.integers(3, size=2 * joints)
    factor = rng.normal(size=(n, 2 * joints))
    layout = Columns(frames=np.full((len(case.e), 6), -1), joint=joint, column=column, count=3)
    J = walk.columns(case.chain, case.s, case.e, layout, factor, angular=True)
    alone = walk.columns(case.chain, case.s, case.e, case.chain.joint_columns, np.ones((n, joints)), angular=True)
    expected = np.zeros((n, 6, 3))
    for k in range(2 * joints):
        expected[:, :, column[k]] += factor[:, None, k] * alone[:, :, joint[k]]
    np.testing.assert_allclose(J, expected, rtol=1e-10, atol=1e-10)


@given(chains(), generators)
def test_columns_not_asked_for_are_left_out(case, rng):
    layout, factor = every_column(case)
    every = walk.columns(case.chain, case.s, case.e, layout, factor, angular=True)
    frames = np.where(rng.random(layout.frames.shape) < 0.5, layout.frames, -1)
    some = Columns(frames=frames, joint=layout.joint, column=layout.column, count=layout.count)
    wanted = np.union1d(frames[frames >= 0], layout.column)
    J = walk.columns(case.chain, case.s, case.e, some, factor, angular=True)
    np.testing.assert_array_equal(J[..., wanted], every[..., wanted])
    assert not J[..., np.setdiff1d(np.arange(layout.count), wanted)].any()


@given(generators)
def test_many_poses_on_threads_equal_few_poses_at_a_time(rng):
    case = ChainCase(
        [Fixed(rigid(rng)), Joint(), ErrorFrame(), Joint("prismatic"), ErrorFrame()],
        np.empty((0, 2)),
        rng.normal(size=(2, 6)),
    )
    few = rng.normal(size=(11, 2))
    many = np.resize(few, (2 * CHUNK + 7, 2))
    layout, factor = every_column(ChainCase(case.steps, many, case.e))
    T = walk.poses(case.chain, few, case.e)
    J = walk.columns(case.chain, few, case.e, layout, factor[:11], angular=True)
    np.testing.assert_array_equal(walk.poses(case.chain, many, case.e), np.resize(T, (len(many), 4, 4)))
    np.testing.assert_array_equal(
        walk.columns(case.chain, many, case.e, layout, factor, angular=True), np.resize(J, (len(many), *J.shape[1:]))
    )


@pytest.mark.parametrize(
    "out",
    [
        np.empty((4, 3, 2)),
        np.empty((5, 6, 2)),
        np.empty((5, 3, 2), dtype=np.float32),
        np.empty((5, 2, 3)).swapaxes(1, 2),
        np.broadcast_to(0.0, (5, 3, 2)),
    ],
)
def test_room_of_another_kind_is_refused(out):
    layout = Chain.of([Joint(), Joint()]).joint_columns
    with pytest.raises(ValueError, match=r"contiguous array of \(5, 3, 2\) doubles"):
        walk.allocate_columns(layout, 5, angular=False, out=out)


@given(chains())
def test_adjacent_fixed_transforms_merge_and_identities_drop(case):
    """Adjacent fixed transforms are merged, and identities are dropped."""
    chain = case.chain
    fixed = chain.kind == FIXED
    assert not (fixed[1:] & fixed[:-1]).any()
    assert len(chain.fixed) == fixed.sum()
    assert chain.frames == (chain.kind == ERROR_FRAME).sum() == len(case.e)
    padded = Chain.of([part for step in case.steps for part in (Fixed(np.eye(4)), step)])
    np.testing.assert_array_equal(padded.kind, chain.kind)


def test_an_empty_chain_and_no_poses_are_walked():
    chain = Chain.of([])
    np.testing.assert_array_equal(walk.poses(chain, np.empty((2, 0)), np.empty((0, 6))), [np.eye(4)] * 2)
    assert walk.poses(chain, np.empty((0, 0)), np.empty((0, 6))).shape == (0, 4, 4)
