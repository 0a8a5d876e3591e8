"""Cholesky's factor inside kernels, beside LAPACK's."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import cho_factor, cho_solve

from taskcal.kernels.compiled import compiled
from taskcal.kernels.fit import factor_scaled, invert_factored, solve_factored
from tests.laws.robots import generators


@compiled
def solved(A, b, x, inverse):
    p = b.shape[0]
    scale, U, work = np.empty(p), np.empty((p, p)), np.empty((p, p))
    if not factor_scaled(A, scale, U):
        return False
    solve_factored(U, scale, b, x)
    invert_factored(U, scale, work, inverse)
    return True


@given(generators, st.integers(1, 60))
def test_solution_and_inverse_are_those_of_lapack(rng, p):
    rows = rng.normal(size=(p + 5, p)) * 10.0 ** rng.uniform(-6.0, 3.0, size=p)
    A, b = rows.T @ rows, rng.normal(size=p) * np.linalg.norm(rows, axis=0)
    x, inverse = np.empty(p), np.empty((p, p))
    assert solved(np.triu(A), b, x, inverse)
    size = 1.0 / np.linalg.norm(rows, axis=0)  # on unit diagonal, where conditions are moderate
    scaled = A * size * size[:, None]
    condition = np.linalg.cond(scaled)
    expected = size * cho_solve(cho_factor(scaled), size * b)
    np.testing.assert_allclose(x / size, expected / size, rtol=0.0, atol=1e-14 * condition * np.abs(x / size).max())
    np.testing.assert_allclose((inverse / size / size[:, None]) @ scaled, np.eye(p), rtol=0.0, atol=1e-13 * condition)
    np.testing.assert_array_equal(inverse, inverse.T)


@pytest.mark.parametrize(
    "values", [(1.0, -1.0), (0.0, 1.0), (1.0, np.nan)], ids=["indefinite", "singular", "no number"]
)
def test_what_is_not_positive_definite_is_said(values):
    assert not solved(np.diag(values), np.ones(2), np.empty(2), np.empty((2, 2)))
