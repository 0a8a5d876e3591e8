"""Orientations of which only the tool's axis is known."""

import numpy as np
import pytest
from hypothesis import given

from robot_programs.core.program import with_axis
from tests.laws.robots import generators


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
