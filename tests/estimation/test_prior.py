import numpy as np
import pytest
from hypothesis import given

from taskcal.estimation.prior import GaussianPrior
from tests.laws.robots import generators


@given(generators)
def test_mapped_prior_is_distribution_of_mapped_parameters(rng):
    """A mapped prior is the distribution of the mapped parameters."""
    root, B, mean = rng.normal(size=(4, 4)), rng.normal(size=(2, 4)), rng.normal(size=4)
    prior = GaussianPrior(mean, root @ root.T + np.eye(4))
    mapped = prior.mapped(B)
    samples = rng.multivariate_normal(mean, prior.covariance, size=20000) @ B.T
    scale = np.sqrt(np.diag(mapped.covariance))
    np.testing.assert_allclose((samples.mean(axis=0) - mapped.mean) / scale, 0.0, atol=0.05)
    np.testing.assert_allclose((np.cov(samples.T) - mapped.covariance) / scale / scale[:, None], 0.0, atol=0.08)


@given(generators)
def test_taking_parameters_is_mapping_by_rows_of_the_identity(rng):
    root = rng.normal(size=(5, 5))
    prior = GaussianPrior(rng.normal(size=5), root @ root.T + np.eye(5))
    rows = rng.permutation(5)[:3]
    taken, mapped = prior.take(rows), prior.mapped(np.eye(5)[rows])
    np.testing.assert_array_equal(taken.mean, mapped.mean)
    np.testing.assert_allclose(taken.covariance, mapped.covariance)


def test_deviations_become_independent_parameters_about_nil():
    prior = GaussianPrior.of_deviations(np.array([1e-3, 2e-5]))
    np.testing.assert_array_equal(prior.mean, [0.0, 0.0])
    np.testing.assert_allclose(prior.covariance, [[1e-6, 0.0], [0.0, 4e-10]])


@pytest.mark.parametrize(
    "covariance", [np.zeros((2, 2)), np.diag([1.0, -1.0]), np.array([[1.0, 2.0], [2.0, 1.0]]), np.diag([1.0, np.nan])]
)
def test_a_covariance_must_be_positive_definite(covariance):
    with pytest.raises((ValueError, np.linalg.LinAlgError), match=r"positive definite|row 1 is not finite"):
        GaussianPrior(np.zeros(2), covariance)


def test_mean_and_covariance_must_have_one_size():
    with pytest.raises((ValueError, TypeError), match="covariance"):
        GaussianPrior(np.zeros(3), np.eye(2))
