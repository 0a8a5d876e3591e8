"""The terminal's tables of a calibration are the page's."""

from dataclasses import replace

import numpy as np

from taskcal.identification.identify import identify
from taskcal.identification.outlier import LeftOut, Outlier
from taskcal.measurement.virtual_cell import simulate
from taskcal.presentation.calibration_report import Beside, calibration_page
from taskcal.presentation.calibration_tables import tabulate_left_out, tabulate_outliers, tabulate_parameters
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel


def test_tables_stand_on_the_page_as_they_are_printed() -> None:
    model, rng = ErrorModel(load_robot("ur5")), np.random.default_rng(0)
    campaign, _ = simulate(model, rng.uniform(-1.0, 1.0, (30, 6)), rng=rng)
    outliers = (Outlier(row=7, line=9, id="p7", target="tool", studentised=6.2, residual=1.5e-3),)
    left_out = (LeftOut(row=3, line=None, id="p3", distance=0.25, studentised=900.0),)
    calibration = replace(identify(model, campaign, keep=["J2"]), outliers=outliers, left_out=left_out)
    parameters = tabulate_parameters(calibration)
    assert [row[0] for row in parameters.rows] == list(calibration.kept)
    assert [row[2] for row in parameters.rows] == [
        f"{calibration.estimate[i] * 1e3:+.4f}" for i in calibration.estimated
    ]
    assert (
        len(tabulate_parameters(calibration, leave_out=lambda name: name == calibration.kept[0])) == len(parameters) - 1
    )
    assert tabulate_outliers(calibration).rows == (("7", "9", "p7", "tool", "1.500", "6.2"),)
    assert tabulate_left_out(calibration).rows == (("3", "–", "p3", "250.00", "900"),)
    page = calibration_page(calibration, Beside(), version="1").html()
    for table in (tabulate_outliers(calibration), tabulate_left_out(calibration)):
        assert all(cell in page for row in table.rows for cell in row[2:])
        assert table.title in page
