"""Small covariances factored at once, beside LAPACK."""

import numpy as np
import pytest

from taskcal.estimation.matrices import inverse_factors


@pytest.mark.parametrize("b", [1, 3, 6])
def test_the_factors_are_the_inverses_of_choleskys(b: int) -> None:
    root = np.random.default_rng(b).normal(size=(40, 2, b, b))
    covariance = root @ np.swapaxes(root, -1, -2) + 1e-3 * np.eye(b)
    expected = np.linalg.inv(np.linalg.cholesky(covariance))
    np.testing.assert_allclose(inverse_factors(covariance), expected, rtol=1e-8, atol=1e-9 * np.abs(expected).max())


def test_what_is_not_positive_definite_has_none() -> None:
    covariance = np.stack([np.eye(3), np.diag([1.0, -1.0, 1.0]), np.diag([1.0, 1.0, 0.0])])
    found = inverse_factors(covariance)
    np.testing.assert_array_equal(found[0], np.eye(3))
    assert np.isnan(found[1:, -1, -1]).all()
