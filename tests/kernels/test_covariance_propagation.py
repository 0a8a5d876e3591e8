from dataclasses import replace

import numpy as np
from hypothesis import given
from scipy.spatial.transform import Rotation

from taskcal.kernels.chain import Chain, ErrorFrame, Joint
from taskcal.kernels.chunks import CHUNK
from taskcal.kernels.covariance import propagate
from taskcal.kernels.observations import Observations, Points, Walked
from taskcal.kernels.walk import Columns
from tests.laws.chains import measured
from tests.laws.robots import generators


@given(measured(), generators)
def test_a_propagated_covariance_is_the_residual_and_the_jacobian_around_a_matrix(case, rng):
    M = rng.normal(size=(len(case.z),) * 2)
    M = M @ M.T
    residual, out = propagate(case.walked, case.seen, M)
    assert np.isnan(residual[~case.seen.valid]).all()
    assert np.isnan(out[~case.seen.valid]).all()
    for row, target, r, J in case.blocks():
        np.testing.assert_allclose(residual[row, target], r, rtol=1e-10, atol=1e-10)
        expected = J @ M @ J.T
        np.testing.assert_allclose(out[row, target], expected, rtol=1e-9, atol=1e-10 * (1 + np.abs(expected).max()))


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
    residual, _ = propagate(walked, seen, np.eye(6))
    np.testing.assert_allclose(
        Rotation.from_rotvec(residual[:, 0, 3:]).as_matrix() @ predicted, turned @ predicted, atol=1e-8
    )


@given(measured(poses=5))
def test_many_poses_on_threads_equal_the_same_few_over_and_over(case):
    times = 2 * CHUNK // 5 + 3
    few = case.walked
    many = replace(few, s=np.tile(few.s, (times, 1)), factor=np.tile(few.factor, (times, 1)))
    rotation = None if case.seen.rotation is None else np.tile(case.seen.rotation, (times, 1, 1))
    seen = Observations(np.tile(case.seen.position, (times, 1, 1)), rotation, np.tile(case.seen.valid, (times, 1)))
    M = np.eye(len(case.z))
    for a, b in zip(propagate(many, seen, M), propagate(few, case.seen, M), strict=True):
        np.testing.assert_array_equal(a, np.tile(b, (times, *[1] * (b.ndim - 1))))
