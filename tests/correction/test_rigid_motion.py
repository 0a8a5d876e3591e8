"""Rigid motions nearest to how points move."""

import numpy as np
import pytest
from hypothesis import given
from scipy.spatial.transform import Rotation

from taskcal.correction.frames import fit_points, rigid_twists
from taskcal.errors import TaskcalError
from taskcal.geometry import se3
from tests.laws.robots import generators


@given(generators)
def test_points_moved_rigidly_give_the_motion_and_its_twist(rng):
    points, at = rng.uniform(-1.0, 1.0, (5, 3)), rng.uniform(-1.0, 1.0, 3)
    R, p = Rotation.random(random_state=rng).as_matrix(), rng.normal(size=3)
    T, farthest = fit_points(points, points @ R.T + p)
    np.testing.assert_allclose(T[:3, :3], R, atol=1e-9)
    np.testing.assert_allclose(T[:3, 3], p, atol=1e-9)
    assert farthest < 1e-9
    v, w = rng.normal(size=(2, 3))
    moved = v + np.cross(w, points - at)
    twist = rigid_twists(points[None], moved[None, :, :, None], at[None])[0, :, 0]
    np.testing.assert_allclose(se3.by_twist(points - at) @ twist, moved, atol=1e-8)


@pytest.mark.parametrize("points", [np.outer([0.0, 1.0, 2.0], [1.0, 2.0, 3.0]), np.zeros((3, 3))])
def test_points_that_locate_no_frame_are_refused(points):
    with pytest.raises(TaskcalError, match="lie in a line or at one place"):
        fit_points(points, points)
