"""The refinement of tracker frame and targets beside SciPy's least squares."""

import numpy as np
import pytest
import scipy.optimize
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from taskcal.geometry.point_registration import Moments, refine
from tests.laws.clouds import cloud
from tests.laws.robots import generators


def angle(A, B):
    return np.linalg.norm(Rotation.from_matrix(A.T @ B).as_rotvec())


@settings(max_examples=20)
@given(generators, st.floats(0.01, 0.5))
def test_the_refinement_alone_ends_at_the_least_squares_of_scipy(rng, away):
    R, p, y, target, (Z, _, _) = cloud(rng, noise=1e-3)
    start = Rotation.from_rotvec(away * np.array([0.6, -0.8, 0.0])).as_matrix() @ Z
    moments = Moments.of(R, p, y, target, 2)
    found, rms = refine(start, moments)
    t, offsets = moments.offsets(found)

    def residuals(z):
        turned = Rotation.from_rotvec(z[:3]).as_matrix() @ Z
        local = p + np.einsum("nij,nj->ni", R, z[6:].reshape(2, 3)[target])
        return (y - local @ turned.T - z[3:6]).reshape(-1)

    best = scipy.optimize.least_squares(residuals, np.zeros(12), xtol=1e-15, ftol=1e-15, gtol=1e-15)
    assert angle(found, Rotation.from_rotvec(best.x[:3]).as_matrix() @ Z) < 1e-7
    np.testing.assert_allclose(t, best.x[3:6], atol=1e-7)
    np.testing.assert_allclose(offsets, best.x[6:].reshape(2, 3), atol=1e-7)
    assert rms == pytest.approx(np.sqrt(2.0 * best.cost / len(y)), rel=1e-9)
