import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from taskcal.estimation.prior import Cauchy, Huber, Squared

# half of ρ(z²), whose derivative by z is weight·z
COST = {
    Squared(): lambda z, t: 0.5 * z**2,
    Huber(1.5): lambda z, t: 0.5 * z**2 if z <= t else t * z - 0.5 * t**2,
    Huber(0.3): lambda z, t: 0.5 * z**2 if z <= t else t * z - 0.5 * t**2,
    Cauchy(2.4): lambda z, t: 0.5 * t**2 * np.log1p((z / t) ** 2),
}


@pytest.mark.parametrize("loss", COST, ids=str)
def test_a_weight_is_the_slope_of_the_cost_over_the_residual(loss):
    for z in np.linspace(0.013, 10, 200):
        h = 1e-6
        slope = (COST[loss](z + h, loss.threshold) - COST[loss](z - h, loss.threshold)) / (2 * h)
        np.testing.assert_allclose(loss.weights(np.array([z])), slope / z, rtol=1e-5)


@given(st.floats(0, 1e6))
def test_no_point_weighs_more_than_one_nor_less_the_nearer_it_is(z):
    for loss in COST:
        near, far = loss.weights(np.array([z, 1.5 * z]))
        assert 0.0 < far <= near <= 1.0


def test_outlier_influence_is_bounded_and_vanishes_for_cauchy():
    """A gross outlier has bounded influence with Huber's loss and none with Cauchy's."""
    z = np.array([1e6])
    assert (z * Huber(1.5).weights(z))[0] == pytest.approx(1.5)
    assert (z * Cauchy(2.4).weights(z))[0] < 1e-5
