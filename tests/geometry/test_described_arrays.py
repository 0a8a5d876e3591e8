"""Arrays and rigid transforms as files describe them."""

import numpy as np
import pytest
from hypothesis import given

from taskcal.errors import TaskcalError
from taskcal.geometry.se3 import array_of, rigid
from tests.laws.campaigns import random_pose
from tests.laws.robots import generators


@given(generators)
def test_array_survives_its_lists(rng):
    """An array comes back from its lists and null is not a number."""
    array = rng.normal(size=(3, 2))
    np.testing.assert_array_equal(array_of("key", array.tolist(), (3, 2)), array)
    assert np.isnan(array_of("key", [[None, 1.0]], (1, 2))[0, 0])


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ([[1.0, 2.0], [3.0]], "the rows of 'key' differ in length"),
        ([[1.0], [2.0]], r"'key' has shape \(2, 1\), not \(2, 2\)"),
        ([], r"'key' has shape \(0,\), not \(2, 2\)"),
    ],
)
def test_another_shape_is_refused(values, message):
    with pytest.raises(TaskcalError, match=message):
        array_of("key", values, (2, 2))


@given(generators)
def test_only_rigid_transforms_pass(rng):
    """Rigid transforms pass and what scales mirrors or shears does not."""
    T = np.stack([random_pose(rng, 2.0) for _ in range(3)])
    assert rigid("key", T) is T
    scale, mirror, shear = np.eye(4), np.diag([1.0, 1.0, -1.0, 1.0]), np.eye(4)
    scale[:3, :3] *= 1.001
    shear[0, 1] = 0.001
    for wrong in (scale, mirror, shear):
        spoilt = T.copy()
        spoilt[1] = T[1] @ wrong
        with pytest.raises(TaskcalError, match="'key' 2 is not a rigid transform"):
            rigid("key", spoilt)
