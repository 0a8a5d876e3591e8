"""Rigid transforms as files describe them."""

import numpy as np
import pytest
from hypothesis import given

from taskcal.errors import TaskcalError
from taskcal.geometry.se3 import rigid
from tests.laws.campaigns import random_pose
from tests.laws.robots import generators


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
