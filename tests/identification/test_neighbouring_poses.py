"""Groups of poses that lie next to each other."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from taskcal.identification.held_out import group_neighbours
from tests.laws.robots import generators


@given(generators, st.integers(2, 30))
def test_groups_have_about_as_many_rows(rng, count):
    n = int(rng.integers(count, 200))
    rows = np.bincount(group_neighbours(rng.uniform(-2, 2, (n, 6)), count))
    assert len(rows) == count
    assert rows.sum() == n
    # each of the log2 cuts rounds once
    assert rows.max() - rows.min() <= 1 + np.ceil(np.log2(count))


@given(generators)
def test_a_twentieth_of_a_round_number_is_a_twentieth(rng):
    assert set(np.bincount(group_neighbours(rng.uniform(-2, 2, (200, 4)), 20))) == {10}


@given(generators)
def test_neighbour_groups_are_closer_than_random_poses(rng):
    """Poses of a group are closer to each other than poses drawn at random."""
    q = rng.uniform(-2, 2, (120, 3))
    group = group_neighbours(q, 12)
    radius = [np.linalg.norm(q[group == k] - q[group == k].mean(axis=0), axis=1).mean() for k in range(12)]
    assert np.mean(radius) < 0.6 * np.linalg.norm(q - q.mean(axis=0), axis=1).mean()


@given(generators)
def test_trajectory_is_split_into_segments(rng):
    """A trajectory is split into segments although each row is close to the next."""
    turn = np.linspace(0.0, 3.0, 400)[:, None] * rng.uniform(0.5, 1.0, 6)
    group = group_neighbours(turn, 10)
    assert len(set(group)) == 10
    assert (np.diff(group) != 0).sum() == 9


@given(generators, st.integers(2, 12))
def test_rows_of_one_posture_stay_together(rng, count):
    posture = rng.uniform(-2, 2, (12, 6))
    q = np.repeat(posture, 5, axis=0) + np.radians(rng.uniform(-0.1, 0.1, (60, 6)))
    order = rng.permutation(60)
    group = group_neighbours(q[order], count)
    for k in range(12):
        assert len(set(group[order // 5 == k])) == 1


def test_no_more_groups_than_postures():
    assert len(set(group_neighbours(np.repeat(np.eye(3), 4, axis=0), 20))) == 3


@given(generators, st.integers(2, 8))
def test_groups_do_not_hang_on_rounding(rng, count):
    """Sweeps of one joint after another, as wide as each other: equal singular values, whose vectors rounding turns."""
    q = np.concatenate([np.outer(np.linspace(-1, 1, 6), axis) for axis in np.eye(6)]) + rng.uniform(-1, 1, 6)
    group = group_neighbours(q, count)
    for _ in range(5):
        np.testing.assert_array_equal(group_neighbours(q + rng.uniform(-1e-13, 1e-13, q.shape), count), group)
