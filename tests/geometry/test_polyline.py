"""Paths of points against minimisation by SciPy and figures known by heart."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import minimize_scalar

from taskcal.geometry import polyline, se3

SQUARE = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 0]])


@given(seed=st.integers(0, 10_000))
def test_the_distance_is_the_least_over_all_segments(seed):
    rng = np.random.default_rng(seed)
    path, point = rng.normal(size=(5, 3)), rng.normal(size=3)
    least = min(
        minimize_scalar(
            lambda t, a=a, b=b: np.linalg.norm(a + t * (b - a) - point),
            bounds=(0.0, 1.0),
            method="bounded",
            options={"xatol": 1e-10},
        ).fun
        for a, b in pairwise(path)
    )
    least = min(least, np.linalg.norm(path - point, axis=1).min())
    (distance,), _ = polyline.distances(point[None], path)
    assert distance == pytest.approx(least, abs=1e-8)


def test_points_are_off_an_end_only_where_they_lie_beyond_it():
    path = SQUARE[:3]
    points = np.array([[-0.1, 0.0, 0.0], [0.1, 0.3, 0.0], [1.2, -0.2, 0.0], [1.0, 1.4, 0.0], [0.0, -0.5, 0.0]])
    distances, off = polyline.distances(points, path)
    np.testing.assert_allclose(distances, [0.1, 0.3, np.sqrt(0.08), 0.4, 0.5])
    np.testing.assert_array_equal(off, [True, False, False, True, False])
    assert not polyline.distances(points, SQUARE)[1].any()


def test_many_points_are_the_same_as_few():
    rng = np.random.default_rng(0)
    path, points = np.cumsum(rng.normal(size=(700, 3)), axis=0), rng.normal(size=(3000, 3))
    whole, _ = polyline.distances(points, path)
    part, _ = polyline.distances(points[1990:2010], path)
    np.testing.assert_array_equal(whole[1990:2010], part)


def test_tangents_halve_corners_and_close_with_the_path():
    diagonal = np.sqrt(0.5)
    half = np.array([[diagonal, -diagonal], [diagonal, diagonal], [-diagonal, diagonal], [-diagonal, -diagonal]])
    np.testing.assert_allclose(polyline.tangents(SQUARE)[:, :2], [*half, half[0]])
    opened = polyline.tangents(SQUARE[:-1])
    np.testing.assert_allclose(opened[[0, -1], :2], [[1, 0], [-1, 0]])
    back = polyline.tangents(np.array([[0.0, 0, 0], [1, 0, 0], [0.2, 0, 0]]))
    np.testing.assert_array_equal(back[1], 0.0)


@given(seed=st.integers(0, 10_000))
def test_a_straight_path_crosses_a_plane_where_geometry_says(seed):
    rng = np.random.default_rng(seed)
    normal = se3.exp(rng.normal(size=3))[:, 0]
    origin, foot = rng.normal(size=3), rng.normal(size=3)
    direction = normal + 0.3 * rng.normal(size=3)
    direction *= np.sign(direction @ normal)
    along = (origin - foot) @ normal / (direction @ normal)
    meeting = foot + along * direction
    path = meeting + np.array([-2.0, -0.7, 0.5, 2.0])[:, None] * direction
    found = polyline.cross_planes(path, origin[None], normal[None], np.inf)
    np.testing.assert_allclose(found.points, meeting[None], atol=1e-12)
    assert (found.planes[0], found.segments[0]) == (0, 1)
    assert found.fractions[0] == pytest.approx(0.7 / 1.2)
    backwards = polyline.cross_planes(path[::-1], origin[None], normal[None], np.inf)
    assert not len(backwards.planes)
    near = np.linalg.norm(meeting - origin)
    assert not len(polyline.cross_planes(path, origin[None], normal[None], 0.99 * near).planes)


def test_the_nearest_of_several_crossings_is_taken():
    path = np.array([[-1.0, 3, 0], [1, 3, 0], [-1, 2, 0], [1, 1, 0]])
    found = polyline.cross_planes(path, np.zeros((1, 3)), np.array([[1.0, 0, 0]]), 10.0)
    np.testing.assert_allclose(found.points, [[0, 1.5, 0]])
