"""The squared-exponential correlation."""

import numpy as np
from hypothesis import given
from sklearn.gaussian_process.kernels import RBF

from taskcal.estimation.matrices import squared_exponential
from tests.laws.robots import generators


@given(generators)
def test_it_is_scikit_learns_kernel(rng):
    a, b, lengths = rng.normal(size=(7, 3)), rng.normal(size=(5, 3)), rng.uniform(0.3, 3.0, size=3)
    square = (((a[:, None] - b[None]) / lengths) ** 2).sum(axis=2)
    np.testing.assert_allclose(squared_exponential(square), RBF(lengths)(a, b), rtol=1e-12)


def test_a_distance_that_rounding_left_below_zero_counts_as_none():
    assert (squared_exponential(np.array([-1e-12, 0.0])) == 1.0).all()
