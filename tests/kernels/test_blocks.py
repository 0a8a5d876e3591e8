"""Functions of angles beside NumPy's, and poses in blocks beside each pose alone."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from taskcal.kernels import walk
from taskcal.kernels.blocks import BLOCK, angle_of, cosine_and_sine
from taskcal.kernels.compiled import compiled
from tests.kernels.test_walk import every_column
from tests.laws.chains import chains
from tests.laws.robots import generators


@compiled
def both(angle, cosine, sine):
    for i in range(angle.shape[0]):
        cosine[i], sine[i] = cosine_and_sine(angle[i])


def cosines_and_sines(angle):
    cosine, sine = np.empty_like(angle), np.empty_like(angle)
    both(angle, cosine, sine)
    return cosine, sine


@pytest.mark.parametrize("size", [1e-9, 1.0, 10.0, 1e5])
def test_cosine_and_sine_are_right_to_the_last_digit_but_one(size):
    angles = np.random.default_rng(0).uniform(-size, size, 100_000)
    for found, expected in zip(cosines_and_sines(angles), (np.cos(angles), np.sin(angles)), strict=True):
        assert np.abs(found - expected).max() <= np.finfo(float).eps
        np.testing.assert_allclose(
            found[np.abs(expected) < 0.5], expected[np.abs(expected) < 0.5], rtol=1e-15, atol=1e-17
        )


def test_quarters_of_a_turn_and_what_is_no_angle():
    angles = np.append(np.arange(-9.0, 9.0) * (np.pi / 2.0), [0.0, np.nan, np.inf])
    cosine, sine = cosines_and_sines(angles)
    np.testing.assert_allclose(cosine[:-2], np.cos(angles[:-2]), rtol=1e-15, atol=0.0)
    np.testing.assert_allclose(sine[:-2], np.sin(angles[:-2]), rtol=1e-15, atol=0.0)
    assert np.isnan([cosine[-2:], sine[-2:]]).all()


@compiled
def directions(y, x, angle):
    for i in range(y.shape[0]):
        angle[i] = angle_of(y[i], x[i])


def angles_of(y, x):
    angle = np.empty_like(y)
    directions(y, x, angle)
    return angle


@pytest.mark.parametrize("stretch", [1.0, 1e-3, 1e3, 1e-12, 1e150])
def test_angle_of_a_direction_is_accurate_to_two_units_in_the_last_place(stretch):
    rng = np.random.default_rng(0)
    turn = rng.uniform(-np.pi, np.pi, 100_000)
    turn[:9] = np.arange(-4, 5) * np.pi / 4.0
    y, x = np.sin(turn) * stretch, np.cos(turn)
    expected = np.arctan2(y, x)
    assert (np.abs(angles_of(y, x) - expected) <= 2.0 * np.spacing(np.abs(expected))).all()


def test_along_the_axes_and_where_there_is_no_direction():
    y = np.array([0.0, 0.0, 1.0, -1.0, 0.0, np.nan, 1.0, -0.5])
    x = np.array([1.0, -1.0, 0.0, 0.0, 0.0, 1.0, np.nan, -0.5])
    np.testing.assert_array_equal(angles_of(y, x), np.arctan2(y, x))


@settings(max_examples=10)
@given(chains(), generators, st.integers(0, 2 * BLOCK + 2))
def test_a_pose_does_not_depend_on_the_poses_beside_it(case, rng, n):
    s = rng.normal(size=(n, case.s.shape[1]))
    layout, _ = every_column(case)
    factor = rng.normal(size=(n, s.shape[1]))
    T = walk.poses(case.chain, s, case.e)
    J = walk.columns(case.chain, s, case.e, layout, factor, angular=True)
    assert T.shape == (n, 4, 4)
    for rows in (slice(1, None), slice(n // 2, n // 2 + 1), slice(None, None, -1)):
        q, by = np.ascontiguousarray(s[rows]), np.ascontiguousarray(factor[rows])
        np.testing.assert_array_equal(walk.poses(case.chain, q, case.e), T[rows])
        np.testing.assert_array_equal(walk.columns(case.chain, q, case.e, layout, by, angular=True), J[rows])
