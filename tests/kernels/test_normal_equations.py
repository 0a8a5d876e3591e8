from dataclasses import replace

import numpy as np
from hypothesis import given

from taskcal.kernels.chunks import CHUNK
from taskcal.kernels.points import SeenPoints, normal_equations
from tests.laws.chains import MeasuredCase, measured
from tests.laws.robots import generators


def whiteners(rng: np.random.Generator, case: MeasuredCase) -> np.ndarray:
    W = np.tril(rng.normal(size=(*case.seen.valid.shape, 3, 3)))
    return np.ascontiguousarray(W)


@given(measured(), generators)
def test_streamed_normal_equations_equal_explicit_jacobian(case, rng):
    """Streamed normal equations equal those of the explicit Jacobian."""
    W = whiteners(rng, case)
    cost, g, H = normal_equations(case.walked, case.seen, W)
    p = len(case.z)
    expected_cost, expected_g, expected_H = 0.0, np.zeros(p), np.zeros((p, p))
    for row, target, r, J in case.blocks():
        r, J = W[row, target] @ r, W[row, target] @ J
        expected_cost += 0.5 * r @ r
        expected_g += J.T @ r
        expected_H += J.T @ J
    close = {"rtol": 1e-10, "atol": 1e-10 * (1 + np.abs(expected_H).max(initial=0) + abs(expected_cost))}
    np.testing.assert_allclose(cost, expected_cost, rtol=1e-10, atol=1e-14)
    np.testing.assert_allclose(g, expected_g, **close)
    np.testing.assert_allclose(H, expected_H, **close)


@given(measured(), generators)
def test_a_lost_beam_counts_for_nothing(case, rng):
    W = whiteners(rng, case)
    expected = normal_equations(case.walked, case.seen, W)
    W[~case.seen.valid] = np.nan
    got = normal_equations(case.walked, case.seen, W)
    for a, b in zip(got, expected, strict=True):
        np.testing.assert_array_equal(a, b)


@given(measured(poses=5), generators)
def test_many_poses_on_threads_equal_the_same_few_over_and_over(case, rng):
    W = whiteners(rng, case)
    times = 2 * CHUNK // 5 + 3
    few = case.walked
    many = replace(few, s=np.tile(few.s, (times, 1)), factor=np.tile(few.factor, (times, 1)))
    seen = SeenPoints(np.tile(case.seen.position, (times, 1, 1)), np.tile(case.seen.valid, (times, 1)))
    for a, b in zip(
        normal_equations(many, seen, np.tile(W, (times, 1, 1, 1))), normal_equations(few, case.seen, W), strict=True
    ):
        np.testing.assert_allclose(a, times * np.asarray(b), rtol=1e-10, atol=1e-9)
