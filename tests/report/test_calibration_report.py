"""The page of a calibration says what its residuals are, for poses in both units, and how it was registered."""

import numpy as np
import pytest

from taskcal.identification.identify import identify
from taskcal.identification.validation import Validation, validate
from taskcal.report.calibration import Beside, calibration_page, tabulate_errors
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.virtual.cell import simulate

MODEL = ErrorModel(load_robot("ur5"))
Q = np.random.default_rng(0).uniform(-1.5, 1.5, size=(24, 6))


@pytest.fixture(scope="module")
def of_poses():
    campaign, _ = simulate(MODEL, Q, rng=np.random.default_rng(1), pose=True)
    return campaign, identify(MODEL, campaign, keep=[], model_error=(4e-4, 3e-4))


def test_what_the_page_says_of_the_fitted_rows_is_what_validation_says_of_them(of_poses):
    campaign, calibration = of_poses
    summary = validate(calibration, campaign).summary()
    again = Validation.of_residuals(calibration.residuals, calibration.T_tracker_base[:3, :3]).summary()
    assert again == pytest.approx(summary)
    table = tabulate_errors("errors", {"tool": summary}, of="target")
    page = calibration_page(calibration, Beside(), version="0").html()
    assert table.header[0] == "target"
    assert "max mrad" in table.header
    assert all(cell in page for cell in (*table.header[1:], *table.rows[0]))


def test_the_model_error_of_poses_stands_in_milliradians_too(of_poses):
    page = calibration_page(of_poses[1], Beside(), version="0").html()
    assert "0.400 mm and 0.300 mrad per axis" in page
    campaign, _ = simulate(MODEL, Q, rng=np.random.default_rng(1))
    of_points = calibration_page(identify(MODEL, campaign, keep=[]), Beside(), version="0").html()
    assert " mrad per axis" not in of_points
    assert "from poses" in of_points


def test_columns_that_nobody_has_are_left_out():
    table = tabulate_errors("errors", {"a": {"mean_mm": 1.0, "n": 3}, "b": {"mean_mm": 2.0, "max_mrad": 0.5}})
    assert table.header == ("rows", "mean mm", "max mrad", "points")
    assert table.rows == (("a", "1.000", "–", "3"), ("b", "2.000", "0.500", "–"))
