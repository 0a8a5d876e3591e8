from dataclasses import replace

import numpy as np
from hypothesis import assume, given

from taskcal.kernels.chunks import CHUNK
from taskcal.kernels.points import SeenPoints, propagate_points
from tests.laws.chains import measured
from tests.laws.robots import generators


@given(measured(), generators)
def test_propagated_covariance_is_jacobian_matrix_product(case, rng):
    """The propagated covariance is J·M·Jᵀ, next to the residual of the same point."""
    assume(len(case.z) > 0)
    M = rng.normal(size=(len(case.z),) * 2)
    M = M @ M.T
    residual, out = propagate_points(case.walked, case.seen, M)
    assert np.isnan(residual[~case.seen.valid]).all()
    assert np.isnan(out[~case.seen.valid]).all()
    for row, target, r, J in case.blocks():
        np.testing.assert_allclose(residual[row, target], r, rtol=1e-10, atol=1e-10)
        expected = J @ M @ J.T
        np.testing.assert_allclose(out[row, target], expected, rtol=1e-9, atol=1e-10 * (1 + np.abs(expected).max()))


@given(measured(poses=5))
def test_many_poses_on_threads_equal_the_same_few_over_and_over(case):
    assume(len(case.z) > 0)
    times = 2 * CHUNK // 5 + 3
    few = case.walked
    many = replace(few, s=np.tile(few.s, (times, 1)), factor=np.tile(few.factor, (times, 1)))
    seen = SeenPoints(np.tile(case.seen.position, (times, 1, 1)), np.tile(case.seen.valid, (times, 1)))
    M = np.eye(len(case.z))
    for a, b in zip(propagate_points(many, seen, M), propagate_points(few, case.seen, M), strict=True):
        np.testing.assert_array_equal(a, np.tile(b, (times, *[1] * (b.ndim - 1))))
