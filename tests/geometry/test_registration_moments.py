"""Sums over points say what the points themselves say of a rotation, a translation and offsets."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from taskcal.geometry.point_registration import Moments
from tests.laws.clouds import cloud
from tests.laws.robots import generators


def residuals(R, p, y, target, Z, t, offsets):
    return y - (p + np.einsum("nij,nj->ni", R, offsets[target])) @ Z.T - t


@settings(max_examples=20)
@given(generators, st.integers(1, 3))
def test_offsets_are_the_least_squares_of_a_rotation(rng, count):
    """Translation and offsets are the linear least squares of a rotation."""
    R, p, y, target, (Z, _, _) = cloud(rng, count=count, noise=1e-2)
    moments = Moments.of(R, p, y, target, count)
    t, offsets = moments.offsets(Z)
    A = np.zeros((len(R), 3, 3 + 3 * count))
    A[:, :, :3] = np.eye(3)
    for k in range(count):
        A[target == k, :, 3 + 3 * k : 6 + 3 * k] = Z @ R[target == k]
    best, cost, *_ = np.linalg.lstsq(A.reshape(-1, A.shape[2]), (y - p @ Z.T).reshape(-1), rcond=None)
    np.testing.assert_allclose(np.concatenate([t, offsets.reshape(-1)]), best, atol=1e-8)
    assert moments.squares(Z) == pytest.approx(cost[0], rel=1e-9)


@settings(max_examples=20)
@given(generators, st.integers(1, 3))
def test_the_sum_of_squares_and_its_fall_are_those_of_the_points(rng, count):
    R, p, y, target, (Z, _, _) = cloud(rng, count=count, noise=1e-3)
    moments = Moments.of(R, p, y, target, count)
    near, nearer = (Rotation.from_rotvec(angle * np.array([0.6, 0.0, -0.8])).as_matrix() @ Z for angle in (0.1, 0.09))
    own = [np.sum(residuals(R, p, y, target, A, *moments.offsets(A)) ** 2) for A in (near, nearer)]
    squares = moments.quadratic
    assert squares(near.T.reshape(-1)) == pytest.approx(own[0], rel=1e-6)
    assert squares.fall(near.T.reshape(-1), nearer.T.reshape(-1)) == pytest.approx(own[0] - own[1], rel=1e-6)


@settings(max_examples=20)
@given(generators)
def test_held_direction_keeps_offsets_at_zero(rng):
    """A direction that is held leaves the offsets at zero along it."""
    R, p, y, target, (Z, _, _) = cloud(rng, count=2)
    moments = Moments.of(R, p, y, target, 2)
    axis = rng.normal(size=6)
    axis /= np.linalg.norm(axis)
    _, offsets = moments.offsets(Z, held=np.outer(axis, axis))
    assert abs(offsets.reshape(-1) @ axis) < 1e-9
    _, free = moments.offsets(Z)
    assert np.linalg.norm(free - offsets) > 0.5 * abs(free.reshape(-1) @ axis)
