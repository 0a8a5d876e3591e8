from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from scipy.spatial.transform import Rotation

from taskcal.geometry.chain import Chain, ErrorFrame, Joint
from taskcal.geometry.normal_equations import (
    CAUCHY,
    HUBER,
    SQUARED,
    Observations,
    Points,
    Walked,
    normal_equations,
    spread,
)
from taskcal.geometry.walk import CHUNK, Columns
from tests.laws.chains import MeasuredCase, measured
from tests.laws.robots import generators


def whiteners(rng: np.random.Generator, case: MeasuredCase) -> np.ndarray:
    b = case.seen.rows
    W = np.tril(rng.normal(size=(*case.seen.valid.shape, b, b)))
    return np.ascontiguousarray(W)


def rho(loss: int, square: float, rows: int, threshold: float) -> tuple[float, float]:
    """Twice the cost and the weight of a block, from the root mean square of its whitened residuals."""
    z = np.sqrt(square / rows)
    if loss == HUBER and z > threshold:
        return rows * (2 * threshold * z - threshold**2), threshold / z
    if loss == CAUCHY:
        return rows * threshold**2 * np.log(1 + (z / threshold) ** 2), 1 / (1 + (z / threshold) ** 2)
    return square, 1.0


@pytest.mark.parametrize("loss", [SQUARED, HUBER, CAUCHY])
@given(measured(), generators)
def test_streamed_normal_equations_equal_those_of_the_explicit_jacobian(loss, case, rng):
    W = whiteners(rng, case)
    threshold = float(rng.uniform(0.2, 3.0))
    cost, g, H = normal_equations(case.walked, case.seen, W, loss, threshold)
    p = len(case.z)
    expected_cost, expected_g, expected_H = 0.0, np.zeros(p), np.zeros((p, p))
    for row, target, r, J in case.blocks():
        r, J = W[row, target] @ r, W[row, target] @ J
        double, weight = rho(loss, r @ r, len(r), threshold)
        expected_cost += 0.5 * double
        expected_g += weight * J.T @ r
        expected_H += weight * J.T @ J
    close = {"rtol": 1e-10, "atol": 1e-10 * (1 + np.abs(expected_H).max(initial=0) + abs(expected_cost))}
    np.testing.assert_allclose(cost, expected_cost, rtol=1e-10, atol=1e-14)
    np.testing.assert_allclose(g, expected_g, **close)
    np.testing.assert_allclose(H, expected_H, **close)


@given(measured(), generators)
def test_spread_is_the_residual_and_the_jacobian_around_a_matrix(case, rng):
    M = rng.normal(size=(len(case.z),) * 2)
    M = M @ M.T
    residual, out = spread(case.walked, case.seen, M)
    assert np.isnan(residual[~case.seen.valid]).all()
    assert np.isnan(out[~case.seen.valid]).all()
    for row, target, r, J in case.blocks():
        np.testing.assert_allclose(residual[row, target], r, rtol=1e-10, atol=1e-10)
        expected = J @ M @ J.T
        np.testing.assert_allclose(out[row, target], expected, rtol=1e-9, atol=1e-10 * (1 + np.abs(expected).max()))


@given(measured(pose=False), generators)
def test_a_lost_beam_counts_for_nothing(case, rng):
    W = whiteners(rng, case)
    expected = normal_equations(case.walked, case.seen, W)
    W[~case.seen.valid] = np.nan
    got = normal_equations(case.walked, case.seen, W)
    for a, b in zip(got, expected, strict=True):
        np.testing.assert_array_equal(a, b)


def test_the_rotation_residual_turns_the_predicted_pose_into_the_measured_one():
    rng = np.random.default_rng(0)
    angles = np.array([0.0, 1e-9, 1e-5, 0.99e-4, 1.01e-4, 0.1, 1.5, 3.0, 3.14])
    axis = rng.normal(size=(len(angles), 3))
    turned = Rotation.from_rotvec(angles[:, None] * axis / np.linalg.norm(axis, axis=1, keepdims=True)).as_matrix()
    s = rng.normal(size=(len(angles), 1))
    predicted = Rotation.from_euler("Z", s).as_matrix()
    seen = Observations(np.zeros((len(angles), 1, 3)), turned @ predicted, np.ones((len(angles), 1), dtype=bool))
    layout = Columns(frames=np.arange(6)[None], joint=np.empty(0, dtype=int), column=np.empty(0, dtype=int), count=6)
    held = Points(np.zeros((1, 3)), np.full((1, 3), -1))
    walked = Walked(Chain.of([ErrorFrame(), Joint()]), s, np.zeros((1, 6)), layout, np.empty((len(s), 0)), held)
    residual, _ = spread(walked, seen, np.eye(6))
    np.testing.assert_allclose(
        Rotation.from_rotvec(residual[:, 0, 3:]).as_matrix() @ predicted, turned @ predicted, atol=1e-8
    )


@given(measured(poses=5), generators)
def test_many_poses_on_threads_equal_the_same_few_over_and_over(case, rng):
    W = whiteners(rng, case)
    times = 2 * CHUNK // 5 + 3
    few = case.walked
    many = replace(few, s=np.tile(few.s, (times, 1)), factor=np.tile(few.factor, (times, 1)))
    rotation = None if case.seen.rotation is None else np.tile(case.seen.rotation, (times, 1, 1))
    seen = Observations(np.tile(case.seen.position, (times, 1, 1)), rotation, np.tile(case.seen.valid, (times, 1)))
    for a, b in zip(
        normal_equations(many, seen, np.tile(W, (times, 1, 1, 1))), normal_equations(few, case.seen, W), strict=True
    ):
        np.testing.assert_allclose(a, times * np.asarray(b), rtol=1e-10, atol=1e-9)
    M = np.eye(len(case.z))
    for a, b in zip(spread(many, seen, M), spread(few, case.seen, M), strict=True):
        np.testing.assert_array_equal(a, np.tile(b, (times, *[1] * (b.ndim - 1))))
