"""What is identified does not depend on how a cell is told: order, names, frames, signs, zero positions, form of the robot file."""

from functools import cache

import numpy as np
import pytest

from taskcal.geometry import se3
from taskcal.identification.identify import identify
from tests.laws.cells import STRUCTURES, TOLD_ANEW, cell, unseen


@cache
def identified(structure):
    """A cell, a calibration of it, other poses and what is predicted there, with its covariance."""
    some = cell(structure)
    calibration, q = identify(some.model, some.campaign), unseen(some)
    return some, q, calibration.predict(q), calibration.predict_covariance(q)


def assert_the_same(structure, *ways):
    """To a two-hundredth of the noise: a target that few axes do not locate entirely stays at the tool point, which another
    tool frame has elsewhere."""
    some, q, points, covariance = identified(structure)
    for way in ways:
        some, q = way(some, q)
    again = identify(some.model, some.campaign)
    np.testing.assert_allclose(again.predict(q), se3.apply(some.T_moved, points), rtol=0.0, atol=1e-7)
    R = some.T_moved[:3, :3]
    expected = R @ covariance @ R.T
    np.testing.assert_allclose(again.predict_covariance(q), expected, rtol=0.0, atol=1e-3 * np.abs(expected).max())


@pytest.mark.parametrize("way", TOLD_ANEW, ids=lambda way: way.__name__)
def test_a_cell_told_in_another_way_is_predicted_the_same(way):
    assert_the_same("coupled axes", way)


@pytest.mark.parametrize("structure", STRUCTURES)
def test_prediction_is_invariant_to_description_of_cell(structure):
    """A cell of any structure is predicted the same in every equivalent description."""
    assert_the_same(structure, *TOLD_ANEW)
