"""Eight poses at a time give what each gives alone."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from taskcal.kernels import walk
from taskcal.kernels.compiled import compiled
from taskcal.kernels.lanes import (
    LANES,
    allocate_lanes,
    angle_of,
    as_lanes,
    cosine_and_sine,
    least_of,
    square_root,
    unravel,
    where_less,
)
from tests.kernels.test_walk import every_column
from tests.laws.chains import chains
from tests.laws.robots import generators


@compiled
def both(angle, cosine, sine):
    angles, cosines, sines = as_lanes(angle), as_lanes(cosine), as_lanes(sine)
    for i in range(angles.shape[0]):
        cosines[i], sines[i] = cosine_and_sine(angles[i])


def cosines_and_sines(angles):
    angle = np.resize(angles, (-(-len(angles) // LANES), LANES))
    cosine, sine = np.empty_like(angle), np.empty_like(angle)
    both(angle, cosine, sine)
    return cosine.reshape(-1)[: len(angles)], sine.reshape(-1)[: len(angles)]


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
def directions(y, x, angle, length):
    ys, xs, angles, lengths = as_lanes(y), as_lanes(x), as_lanes(angle), as_lanes(length)
    for i in range(ys.shape[0]):
        angles[i] = angle_of(ys[i], xs[i])
        lengths[i] = square_root(xs[i] * xs[i])


def angles_and_lengths(y, x):
    rows = -(-len(y) // LANES)
    y, x = (np.resize(v, (rows, LANES)) for v in (y, x))
    angle, length = np.empty_like(y), np.empty_like(y)
    directions(y, x, angle, length)
    return angle.reshape(-1), length.reshape(-1)


@pytest.mark.parametrize("stretch", [1.0, 1e-3, 1e3, 1e-12, 1e150])
def test_simd_angle_is_accurate_to_two_ulp(stretch):
    """The angle of a direction is accurate to two units in the last place."""
    rng = np.random.default_rng(0)
    turn = rng.uniform(-np.pi, np.pi, 100_000)
    turn[:9] = np.arange(-4, 5) * np.pi / 4.0
    y, x = np.sin(turn) * stretch, np.cos(turn)
    angle, length = angles_and_lengths(y, x)
    expected = np.arctan2(y, x)
    assert (np.abs(angle - expected) <= 2.0 * np.spacing(np.abs(expected))).all()
    np.testing.assert_array_equal(length, np.abs(x))


def test_along_the_axes_and_where_there_is_no_direction():
    y, x = (
        np.array([0.0, 0.0, 1.0, -1.0, 0.0, np.nan, 1.0, -0.5]),
        np.array([1.0, -1.0, 0.0, 0.0, 0.0, 1.0, np.nan, -0.5]),
    )
    np.testing.assert_array_equal(angles_and_lengths(y, x)[0], np.arctan2(y, x))
    assert np.isnan(angles_and_lengths(np.zeros(LANES), np.full(LANES, np.nan))[1]).all()


@compiled
def compared(a, b, out):
    lanes = as_lanes(out)
    lanes[0] = where_less(as_lanes(a)[0], as_lanes(b)[0], 1.0, as_lanes(b)[0])
    return least_of(lanes[0]), where_less(a[0, 0], b[0, 0], 3.0, 4.0)


def test_lanes_are_compared_each_with_its_own():
    a = np.array([[0.0, 1.0, 2.0, 3.0, -1.0, np.nan, 0.0, -0.0]])
    b = np.array([[1.0, 1.0, 1.0, 4.0, -2.0, 5.0, np.inf, 0.0]])
    out = np.empty((1, LANES))
    assert compared(a, b, out) == (-2.0, 3.0)
    np.testing.assert_array_equal(out, where_less(a, b, 1.0, b))
    assert least_of(out) == -2.0


@compiled
def unravelled(rows, out, n):
    for first in range(0, n, LANES):
        unravel(rows[first // LANES], out, first, n)


@pytest.mark.parametrize("count", [1, 7, 8, 9, 16, 135])
@pytest.mark.parametrize("n", [1, 8, 13, 24])
def test_lanes_are_copied_as_the_plain_function_says(n, count):
    rows = np.random.default_rng(n).normal(size=(-(-n // LANES), count * LANES))
    expected, found = np.empty(n * count), np.empty(n * count)
    for first in range(0, n, LANES):
        unravel(rows[first // LANES], expected, first, n)
    unravelled(rows, found, n)
    np.testing.assert_array_equal(found, expected)
    np.testing.assert_array_equal(found.reshape(n, count)[0], rows[0, ::LANES])


@given(chains(), generators, st.integers(0, 3 * LANES))
def test_simd_result_is_independent_of_neighbouring_poses(case, rng, n):
    """The result for a pose does not depend on the poses next to it in the batch."""
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


@pytest.mark.parametrize("shape", [(1,), (3, 5), (1000, 3, 5)])
def test_arrays_of_lanes_begin_where_a_register_does(shape):
    for array in allocate_lanes(shape, shape):
        assert array.shape == (*shape, LANES)
        assert array.flags.c_contiguous
        assert array.ctypes.data % (LANES * 8) == 0
