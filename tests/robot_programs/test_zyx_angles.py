"""Three angles about z, y and x: against independent libraries."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pytransform3d import rotations
from scipy.spatial.transform import Rotation

from robot_programs.core.program import angles, rotation

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
