import numpy as np
import pytest
from hypothesis import given

from taskcal.estimation.experiment_design import Observability, observability
from tests.laws.robots import generators


def test_indices_of_three_singular_values_by_hand():
    found = observability(np.array([4.0, 2.0, 1.0]), poses=4)
    assert pytest.approx(2.0 / 2.0) == found.O1  # ∛8 / √4
    assert pytest.approx(1.0 / 4.0) == found.O2
    assert pytest.approx(1.0) == found.O3
    assert pytest.approx(1.0 / 4.0) == found.O4
    assert pytest.approx(3.0 / (1.0 / 4.0 + 1.0 / 2.0 + 1.0)) == found.O5


@given(generators)
def test_indices_are_those_of_the_matrix_products(rng):
    J = rng.normal(size=(12, 5))
    found = observability(np.linalg.svd(J, compute_uv=False), poses=4)
    H = J.T @ J
    assert pytest.approx(np.linalg.det(H) ** (1 / 10) / 2) == found.O1
    assert pytest.approx(1 / np.linalg.cond(J)) == found.O2
    assert pytest.approx(np.sqrt(np.linalg.eigvalsh(H)[0])) == found.O3
    assert pytest.approx(found.O3 * found.O2) == found.O4


@pytest.mark.parametrize("values", [[], [1.0, 0.0]])
def test_unobservable_parameters_make_every_index_nil(values):
    assert observability(np.array(values), poses=3) == Observability(O1=0.0, O2=0.0, O3=0.0, O4=0.0, O5=0.0)
