"""What is known of the way to each pose."""

import numpy as np
import pytest

from taskcal.errors import TaskcalError
from taskcal.robot.conditions import Conditions


def test_conditions_that_are_no_numbers_are_refused():
    with pytest.raises(TaskcalError, match="approach of pose 1 is not a number"):
        Conditions(approach=np.array([[1.0, 0.0], [np.nan, 1.0]]))


def test_some_poses_keep_what_is_known_of_them():
    rng = np.random.default_rng(0)
    whole = Conditions(move=rng.normal(size=(6, 3)), temperature=rng.normal(20.0, 1.0, size=6))
    some = whole.take(np.array([4, 1]))
    np.testing.assert_array_equal(some.move, whole.move[[4, 1]])
    np.testing.assert_array_equal(some.temperature, whole.temperature[[4, 1]])
    assert some.approach is None
    assert some.time is None


def test_mean_temperature_is_of_known_poses():
    """The mean temperature is that of the poses where it is known."""
    assert Conditions(temperature=np.array([20.0, np.nan, 21.11])).mean_temperature == 20.6
    for unknown in (Conditions(), Conditions(temperature=np.full(3, np.nan))):
        with pytest.raises(TaskcalError, match="no pose has a temperature"):
            _ = unknown.mean_temperature
