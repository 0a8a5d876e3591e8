import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import LinAlgError

from taskcal.estimation.matrices import factor_positive, invert_scaled, pseudo_invert_scaled, solve_scaled
from tests.laws.robots import generators


@given(generators, st.floats(0, 12))
def test_scaled_solve_is_accurate_for_mixed_magnitudes(rng, decades):
    """Scaled solving stays accurate for parameters of very different magnitudes."""
    root = rng.normal(size=(9, 5))
    A = root.T @ root + 0.1 * np.eye(5)
    size = 10.0 ** rng.uniform(-decades, decades, 5)
    b = rng.normal(size=(5, 2))
    x = solve_scaled(A * size * size[:, None], b * size[:, None])
    np.testing.assert_allclose(x * size[:, None], np.linalg.solve(A, b), rtol=1e-9, atol=1e-10)
    np.testing.assert_allclose(solve_scaled(A * size * size[:, None], b[:, 0] * size), x[:, 0])


def test_scaled_solving_refuses_what_is_not_positive_definite():
    with pytest.raises(LinAlgError):
        solve_scaled(np.array([[1.0, 2.0], [2.0, 1.0]]), np.ones(2))


@given(generators, st.floats(0, 12))
def test_scaled_inverse_is_accurate_for_mixed_magnitudes(rng, decades):
    """Scaled inverses stay accurate for parameters of very different magnitudes."""
    root = rng.normal(size=(9, 5))
    A = root.T @ root + 0.1 * np.eye(5)
    size = 10.0 ** rng.uniform(-decades, decades, 5)
    for inverse in (
        invert_scaled(A * size * size[:, None]),
        pseudo_invert_scaled(A * size * size[:, None], rcond=1e-12),
    ):
        np.testing.assert_allclose(inverse * size * size[:, None], np.linalg.inv(A), rtol=1e-9, atol=1e-10)


def test_a_pseudo_inverse_gives_zero_along_what_is_not_seen():
    A = np.diag([4.0, 0.0, 1e-12])
    np.testing.assert_allclose(pseudo_invert_scaled(A, rcond=1e-10), np.diag([0.25, 0.0, 1e12]))


@given(generators, st.integers(0, 5), st.floats(0, 12))
def test_a_factor_gives_back_any_semidefinite_matrix(rng, rank, decades):
    """Of any rank and mixed magnitudes, rows without variance among them."""
    root = rng.normal(size=(5, rank)) * (10.0 ** rng.uniform(-decades, decades, 5) * (rng.random(5) < 0.8))[:, None]
    C = root @ root.T
    L = factor_positive(C, 1e-9)
    np.testing.assert_array_equal(L, np.tril(L))
    assert (np.diag(L) >= 0.0).all()
    scale = np.sqrt(np.outer(np.diag(C), np.diag(C))) + 1e-300
    np.testing.assert_allclose(L @ L.T / scale, C / scale, atol=1e-7)


@pytest.mark.parametrize("scale", [1.0, 1e-9])
def test_a_factor_takes_for_rounding_what_the_tolerance_allows(scale):
    """Of two parameters that are correlated by more than one, the least eigenvalue on unit diagonal is what is too much."""
    tolerance = 1e-6

    def correlated(excess):
        C = np.eye(3)
        C[0, 2] = C[2, 0] = 1.0 + excess
        return C * np.outer([1.0, 1.0, scale], [1.0, 1.0, scale])

    L = factor_positive(correlated(0.5 * tolerance), tolerance)
    np.testing.assert_allclose(L @ L.T, correlated(0.0), rtol=tolerance)
    with pytest.raises(LinAlgError, match="least eigenvalue on unit diagonal is -2e-06"):
        factor_positive(correlated(2.0 * tolerance), tolerance)
