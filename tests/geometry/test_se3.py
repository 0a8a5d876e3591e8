import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pytransform3d import rotations as pr
from pytransform3d import transformations as pt
from scipy.spatial.transform import Rotation

from taskcal.geometry import se3
from tests.laws import plain
from tests.laws.chains import rigid
from tests.laws.robots import generators

angles = st.floats(-10, 10)


@given(generators)
def test_inverse_undoes_a_transform(rng):
    T = np.array([rigid(rng) for _ in range(4)])
    np.testing.assert_allclose(se3.inverse(T) @ T, np.broadcast_to(np.eye(4), T.shape), atol=1e-14)
    np.testing.assert_allclose(se3.inverse(T[0]), pt.invert_transform(T[0]), atol=1e-14)


@given(st.sampled_from("xyz"), angles)
def test_rotation_agrees_with_pytransform3d(axis, angle):
    expected = pr.active_matrix_from_angle("xyz".index(axis), angle)
    np.testing.assert_allclose(se3.rotation(axis, angle)[:3, :3], expected, atol=1e-12)


@pytest.mark.parametrize("axis", "xyz")
@pytest.mark.parametrize("quarters", range(-4, 5))
def test_right_angles_are_exact(axis, quarters):
    R = se3.rotation(axis, np.radians(90.0 * quarters))
    assert set(R.reshape(-1)) <= {-1.0, 0.0, 1.0}
    np.testing.assert_allclose(R, plain.turn("xyz".index(axis), quarters * np.pi / 2), atol=1e-12)


@given(generators)
def test_exp_and_log_are_inverse_and_agree_with_pytransform3d(rng):
    w = rng.uniform(-1.8, 1.8, (5, 3))  # less than half a turn
    np.testing.assert_allclose(se3.exp(w)[0], pr.matrix_from_compact_axis_angle(w[0]), atol=1e-12)
    np.testing.assert_allclose(se3.log(se3.exp(w)), w, atol=1e-9)


@given(generators)
def test_quaternions_have_their_scalar_last_and_not_negative(rng):
    R = np.array([rigid(rng)[:3, :3] for _ in range(3)])
    q = se3.to_quaternion(R)
    assert (q[:, 3] >= 0).all()
    np.testing.assert_allclose(se3.from_quaternion(2.5 * q), R, atol=1e-12)
    np.testing.assert_allclose(pr.matrix_from_quaternion(np.roll(q[0], 1)), R[0], atol=1e-12)


@given(generators)
def test_error_transform_is_translation_then_x_then_y_then_z(rng):
    e = rng.uniform(-1, 1, (3, 6))
    for row, T in zip(e, se3.error_transform(e), strict=True):
        np.testing.assert_allclose(T, plain.error_frame(row), atol=1e-12)


@given(generators)
def test_nearest_rotation_is_proper_and_nearer_than_any_other(rng):
    M = rng.normal(size=(3, 3))
    R = se3.nearest_rotation(M)
    np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(R) > 0
    distance = np.linalg.norm(R - M)
    for size in (1e-3, 0.1, 1.0):
        assert np.linalg.norm(se3.exp(size * rng.normal(size=3)) @ R - M) >= distance - 1e-12


@given(generators)
def test_apply_moves_points_as_homogeneous_coordinates_do(rng):
    T, points = rigid(rng), rng.normal(size=(4, 3))
    expected = (T @ np.c_[points, np.ones(4)].T).T[:, :3]
    np.testing.assert_allclose(se3.apply(T, points), expected, atol=1e-14)


@given(generators)
def test_fit_points_agrees_with_scipy(rng):
    """Fitted points agree with SciPy and are carried onto each other."""
    a, T = rng.normal(size=(5, 3)), rigid(rng)
    np.testing.assert_allclose(se3.fit_points(a, se3.apply(T, a)), T, atol=1e-10)
    b = se3.apply(T, a) + 0.1 * rng.normal(size=a.shape)
    expected = Rotation.align_vectors(b - b.mean(axis=0), a - a.mean(axis=0))[0].as_matrix()
    fitted = se3.fit_points(a, b)
    np.testing.assert_allclose(fitted[:3, :3], expected, atol=1e-7)
    np.testing.assert_allclose(se3.apply(fitted, a.mean(axis=0)), b.mean(axis=0), atol=1e-12)


@given(generators)
def test_a_twist_moves_points_as_a_small_transform_does(rng):
    points, twist, h = rng.normal(size=(4, 3)), rng.normal(size=6), 1e-5
    there, back = (se3.apply(se3.pose(se3.exp(s * twist[3:]), s * twist[:3]), points) for s in (h, -h))
    np.testing.assert_allclose(se3.by_twist(points) @ twist, (there - back) / (2.0 * h), atol=1e-7)
    carried = se3.carry(np.broadcast_to(twist[:, None], (4, 6, 1)), points)
    np.testing.assert_allclose(carried[:, :3, 0], se3.by_twist(points) @ twist, atol=1e-12)
    np.testing.assert_array_equal(carried[:, 3:, 0], np.broadcast_to(twist[3:], (4, 3)))


@pytest.mark.parametrize("length", [0.0, 1e-300, 1e-12, 1e-5, 1.0, 3.0, np.pi - 1e-9])
def test_rotation_vectors_of_every_length_agree_with_scipy(length):
    rng = np.random.default_rng(0)
    w = rng.normal(size=(2, 7, 3))
    w *= length / np.linalg.norm(w, axis=-1, keepdims=True)
    expected = Rotation.from_rotvec(w.reshape(-1, 3))
    np.testing.assert_allclose(se3.exp(w).reshape(-1, 3, 3), expected.as_matrix(), atol=1e-15)
    np.testing.assert_allclose(se3.log(se3.exp(w)), w, rtol=1e-8, atol=3e-16)
    q = se3.to_quaternion(se3.exp(w)).reshape(-1, 4)
    np.testing.assert_allclose(np.abs(np.sum(q * expected.as_quat(), axis=1)), 1.0, atol=1e-15)


def test_half_turns_about_every_axis_are_found_back():
    axes = np.vstack([np.eye(3), -np.eye(3), np.random.default_rng(1).normal(size=(5, 3))])
    R = se3.exp(np.pi * axes / np.linalg.norm(axes, axis=1, keepdims=True))
    np.testing.assert_allclose(se3.exp(se3.log(R)), R, atol=1e-15)
    np.testing.assert_allclose(np.linalg.norm(se3.log(R), axis=1), np.pi, atol=1e-7)


@pytest.mark.parametrize("axes", ["x", "xyz", "zyx", "zyz"])
def test_turns_agree_with_scipy_about_moving_and_fixed_axes(axes):
    angles = np.random.default_rng(2).uniform(-4.0, 4.0, (6, len(axes)))
    moving = Rotation.from_euler(axes.upper(), angles).as_matrix()
    np.testing.assert_allclose(se3.turns(axes, angles), moving, atol=1e-15)
    fixed = Rotation.from_euler(axes, angles).as_matrix()
    np.testing.assert_allclose(se3.turns(axes[::-1], angles[:, ::-1]), fixed, atol=1e-15)


def test_a_quaternion_of_length_zero_is_refused():
    with pytest.raises(ValueError, match="length zero"):
        se3.from_quaternion(np.zeros((2, 4)))
