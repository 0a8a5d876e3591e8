"""The model error that is assumed before anything is measured, against measured robots."""

from pathlib import Path

import numpy as np
import pytest

from taskcal.robot.robot import TYPICAL
from tests.realdata.model_errors import model_errors

pytestmark = pytest.mark.realdata


def test_assumed_model_error_is_median_of_measured_robots(data_folder: Path) -> None:
    """The assumed model error is the median of the measured robots."""
    found = list(model_errors(data_folder).values())
    assert np.median(found) == pytest.approx(TYPICAL.position, abs=0.01e-3)
    assert f"{1e3 * min(found):.2f} to {1e3 * max(found):.2f} mm" in TYPICAL.source
