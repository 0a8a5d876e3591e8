"""What is identified does not depend on how a cell is described: order, names, frames, signs, zero positions, robot file."""

from functools import cache

import numpy as np
import pytest

from taskcal.geometry import se3
from taskcal.identification.identify import identify
from tests.laws.cells import EQUIVALENT, STRUCTURES, cell, unseen


@cache
def identified(structure):
    """A cell, a calibration of it, other poses and what is predicted there, with its covariance."""
    some = cell(structure)
    calibration, q = identify(some.model, some.campaign), unseen(some)
    return some, q, calibration.predict(q), calibration.predict_covariance(q)


def assert_the_same(structure, *changes):
    """To a two-hundredth of the noise: a target that few axes do not locate entirely stays at the TCP, which another
    tool frame has elsewhere."""
    some, q, points, covariance = identified(structure)
    for change in changes:
        some, q = change(some, q)
    again = identify(some.model, some.campaign)
    np.testing.assert_allclose(again.predict(q), se3.apply(some.T_moved, points), rtol=0.0, atol=1e-7)
    R = some.T_moved[:3, :3]
    expected = R @ covariance @ R.T
    np.testing.assert_allclose(again.predict_covariance(q), expected, rtol=0.0, atol=1e-3 * np.abs(expected).max())


@pytest.mark.parametrize("structure", STRUCTURES)
def test_prediction_is_invariant_to_description_of_cell(structure):
    """A cell of any structure is predicted the same in every equivalent description."""
    assert_the_same(structure, *EQUIVALENT)
