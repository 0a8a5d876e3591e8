"""The smooth field of a model error against the process that it approximates."""

import numpy as np
from hypothesis import given
from sklearn.gaussian_process.kernels import RBF

from taskcal.planning.experiment import LANDMARKS, SmoothField
from tests.laws.robots import generators

DEVIATION = 3e-5


@given(generators)
def test_smooth_field_variance_is_uniform_and_exact_at_landmarks(rng) -> None:
    """The variance is uniform, and the covariance at the inducing points is that of the process."""
    q = rng.normal(size=(LANDMARKS, 4)) * [1.0, 0.5, 2.0, 0.1]
    field = SmoothField.over(DEVIATION, q, q.std(axis=0))
    elsewhere = 3.0 * rng.normal(size=(10, 4)) * [1.0, 0.5, 2.0, 0.1]
    J, white = field.columns(np.concatenate([q, elsewhere]))
    variance = (J**2).sum(axis=2) + white[:, None]
    np.testing.assert_allclose(variance, DEVIATION**2, rtol=1e-4)
    covariance = np.einsum("iac,jbc->iajb", J[:LANDMARKS], J[:LANDMARKS])
    expected = np.einsum("ij,ab->iajb", RBF(1.0)(q / field.scale), np.eye(3))
    np.testing.assert_allclose(covariance, DEVIATION**2 * expected, atol=1e-4 * DEVIATION**2)
