"""The refinement of tracker frame and targets beside SciPy's least squares."""

import numpy as np
import pytest
import scipy.optimize
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from taskcal.measurement.registration_refinement import place, placing_jacobian, refine, rms_length
from tests.laws.clouds import cloud
from tests.laws.robots import generators


def angle(A, B):
    return np.linalg.norm(Rotation.from_matrix(A.T @ B).as_rotvec())


@settings(max_examples=20)
@given(generators, st.floats(0.01, 0.5))
def test_the_refinement_alone_ends_at_the_least_squares_of_scipy(rng, away):
    R, p, y, target, (Z, _, _) = cloud(rng, noise=1e-3)
    start = Rotation.from_rotvec(away * np.array([0.6, -0.8, 0.0])).as_matrix() @ Z
    found, (t, offsets), rms = refine(start, R, p, y, target, 2)

    def residuals(z):
        turned = Rotation.from_rotvec(z[:3]).as_matrix() @ Z
        local = p + np.einsum("nij,nj->ni", R, z[6:].reshape(2, 3)[target])
        return (y - local @ turned.T - z[3:6]).reshape(-1)

    best = scipy.optimize.least_squares(residuals, np.zeros(12), xtol=1e-15, ftol=1e-15, gtol=1e-15)
    assert angle(found, Rotation.from_rotvec(best.x[:3]).as_matrix() @ Z) < 1e-7
    np.testing.assert_allclose(t, best.x[3:6], atol=1e-7)
    np.testing.assert_allclose(offsets, best.x[6:].reshape(2, 3), atol=1e-7)
    assert rms == pytest.approx(np.sqrt(2.0 * best.cost / len(y)), rel=1e-9)


@settings(max_examples=20)
@given(generators, st.integers(1, 3))
def test_translation_and_offsets_are_the_linear_least_squares_of_a_rotation(rng, count):
    R, p, y, target, (Z, _, _) = cloud(rng, count=count, noise=1e-2)
    t, offsets, residual = place(Z, R, p, y, target, count)
    A = placing_jacobian(Z, R, target, count).reshape(-1, 3 + 3 * count)
    best, cost, *_ = np.linalg.lstsq(A, (y - p @ Z.T).reshape(-1), rcond=None)
    np.testing.assert_allclose(np.concatenate([t, offsets.reshape(-1)]), best, atol=1e-8)
    assert rms_length(residual) == pytest.approx(np.sqrt(cost[0] / len(y)), rel=1e-9)


@settings(max_examples=20)
@given(generators)
def test_a_direction_that_is_held_leaves_the_offsets_at_zero_along_it(rng):
    R, p, y, target, (Z, _, _) = cloud(rng, count=2)
    axis = rng.normal(size=6)
    axis /= np.linalg.norm(axis)
    _, offsets, _ = place(Z, R, p, y, target, 2, held=np.outer(axis, axis))
    assert abs(offsets.reshape(-1) @ axis) < 1e-9
    _, free, _ = place(Z, R, p, y, target, 2)
    assert np.linalg.norm(free - offsets) > 0.5 * abs(free.reshape(-1) @ axis)
