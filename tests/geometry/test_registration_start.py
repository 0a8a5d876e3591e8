"""Closed forms that are exact without noise, and the orientations from which a registration is searched."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from taskcal.geometry.point_registration import (
    Moments,
    alternate,
    closed_form,
    closed_form_rotations,
    orientations,
    products,
)
from tests.laws.clouds import cloud
from tests.laws.robots import generators


def angle(A, B):
    return np.linalg.norm(Rotation.from_matrix(A.T @ B).as_rotvec())


@settings(max_examples=20)
@given(generators, st.integers(1, 3))
def test_the_closed_form_alone_is_exact_without_noise(rng, count):
    R, p, y, target, (Z, t, offsets) = cloud(rng, count=count)
    moments = Moments.of(R, p, y, target, count)
    found = closed_form(moments)
    assert angle(found, Z) < 1e-7
    placed = moments.offsets(found)
    np.testing.assert_allclose(placed[0], t, atol=1e-6)
    np.testing.assert_allclose(placed[1], offsets, atol=1e-6)


@settings(max_examples=20)
@given(generators, st.floats(0.0, 0.5))
def test_the_alternation_alone_finds_both_rotations_from_near_by(rng, away):
    R = Rotation.random(30, random_state=rng).as_matrix()
    Z, X = Rotation.random(2, random_state=rng).as_matrix()
    start = Rotation.from_rotvec(away * np.array([0.0, 0.6, 0.8])).as_matrix() @ Z
    found = alternate(start, products(R, Z @ R @ X), rounds=200)
    assert angle(found[0], Z) < 1e-6
    assert angle(found[1], X) < 1e-6
    # with noise each is the best there is for the other, as Procrustes' problem says
    Y = Z @ R @ X @ Rotation.from_rotvec(1e-3 * rng.normal(size=(30, 3))).as_matrix()
    own_Z, own_X = alternate(Z, products(R, Y), rounds=200)
    best_Z, _ = Rotation.align_vectors(np.swapaxes(Y, 1, 2).reshape(-1, 3), np.swapaxes(R @ own_X, 1, 2).reshape(-1, 3))
    best_X, _ = Rotation.align_vectors(
        np.swapaxes(np.swapaxes(own_Z @ R, 1, 2) @ Y, 1, 2).reshape(-1, 3), np.tile(np.eye(3), (30, 1))
    )
    assert angle(own_Z, best_Z.as_matrix()) < 1e-6
    assert angle(own_X, best_X.as_matrix()) < 1e-6


@settings(max_examples=20)
@given(generators)
def test_closed_form_of_rotations_is_exact(rng):
    """The closed form of rotations alone is exact without noise."""
    R = Rotation.random(20, random_state=rng).as_matrix()
    Z, X = Rotation.random(2, random_state=rng).as_matrix()
    found = closed_form_rotations(products(R, Z @ R @ X))
    assert angle(found[0], Z) < 1e-6
    assert angle(found[1], X) < 1e-6


def test_the_search_starts_from_48_different_rotations():
    starts = np.array(orientations())
    np.testing.assert_allclose(np.linalg.det(starts), 1.0, rtol=1e-12)
    np.testing.assert_allclose(starts @ np.swapaxes(starts, 1, 2), np.broadcast_to(np.eye(3), starts.shape), atol=1e-12)
    apart = np.einsum("aij,bij->ab", starts, starts) - 4.0 * np.eye(len(starts))
    assert len(starts) == 48
    assert apart.max() < 2.99  # none twice
