"""Three angles about z, y and x: against independent libraries."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pytransform3d import rotations
from scipy.spatial.transform import Rotation

from robot_programs.core.program import angles, rotation, with_axis
from tests.laws.robots import generators

degrees = st.floats(-360.0, 360.0)


@given(degrees, degrees, degrees)
def test_a_b_c_turn_about_z_y_and_x_of_the_turned_axes(A, B, C):
    R = rotation(A, B, C)
    np.testing.assert_allclose(R, Rotation.from_euler("ZYX", [A, B, C], degrees=True).as_matrix(), atol=1e-12)
    other = rotations.matrix_from_euler(np.radians([A, B, C]), 2, 1, 0, extrinsic=False)
    np.testing.assert_allclose(R, other, atol=1e-12)


@given(degrees, degrees, degrees, degrees, degrees, degrees)
def test_angles_give_the_rotation_back_near_any_others(A, B, C, a, b, c):
    R = rotation(A, B, C)
    found = angles(R, (a, b, c))
    np.testing.assert_allclose(rotation(*found), R, atol=1e-7)


@given(degrees, degrees, degrees)
def test_angles_near_themselves_are_the_same(A, B, C):
    found = angles(rotation(A, B, C), (A, B, C))
    if abs(np.cos(np.radians(B))) > 1e-4:
        np.testing.assert_allclose(found, (A, B, C), atol=1e-7)


@pytest.mark.parametrize("B", [90.0, -90.0])
@given(A=degrees, C=degrees)
def test_angles_where_a_and_c_turn_about_one_axis_stay(B, A, C):
    np.testing.assert_allclose(angles(rotation(A, B, C), (A, B, C)), (A, B, C), atol=1e-9)


@given(*[st.floats(-180.0, 180.0)] * 6)
def test_angles_stay_within_half_a_turn(A, B, C, a, b, c):
    assert max(map(abs, angles(rotation(A, B, C), (a, b, c)))) <= 180.0 + 1e-9


# Orientations of which only the tool's axis is known.


@given(generators)
def test_z_points_against_the_axis_in_a_proper_rotation(rng):
    axis = rng.normal(size=(20, 3)) * rng.uniform(0.1, 10)
    R = with_axis(axis)
    np.testing.assert_allclose(R[:, :, 2], -axis / np.linalg.norm(axis, axis=1, keepdims=True), atol=1e-12)
    np.testing.assert_allclose(np.swapaxes(R, 1, 2) @ R, np.broadcast_to(np.eye(3), (20, 3, 3)), atol=1e-12)
    np.testing.assert_allclose(np.linalg.det(R), 1.0, atol=1e-12)
    np.testing.assert_allclose(with_axis(axis[0]), R[0], atol=1e-15)


@pytest.mark.parametrize(("axis", "x"), [((0, 0, 1), (1, 0, 0)), ((0, 1, 0), (1, 0, 0)), ((1, 0, 0), (0, 1, 0))])
def test_x_lies_near_the_first_axis_of_the_part_or_the_second(axis, x):
    np.testing.assert_allclose(with_axis(np.array(axis, dtype=float))[:, 0], x, atol=1e-15)
