"""Figures of a fit show its residuals and parameters, in the units their axes name."""

from collections.abc import Mapping

import numpy as np
import pytest

from taskcal.identification.calibration import Calibration
from taskcal.identification.identify import identify
from taskcal.report.calibration import draw_parameters, draw_residuals
from taskcal.robot.error_model import ErrorModel
from taskcal.virtual.cell import Truth, simulate
from tests.report.axis_titles import axis_titles


@pytest.fixture(scope="module")
def truth_and_fits(model: ErrorModel, poses: Mapping[str, np.ndarray]) -> tuple[Truth, dict[str, Calibration]]:
    campaign, truth = simulate(model, poses["all"], rng=np.random.default_rng(4))
    return truth, {"frames only": identify(model, campaign, keep=()), "whole": identify(model, campaign)}


def test_one_model_of_residuals_is_shown_at_a_time(truth_and_fits: tuple[Truth, dict[str, Calibration]]) -> None:
    fits = truth_and_fits[1]
    figure = draw_residuals({"a": fits, "b": fits}, "whole")
    shown = [i for i, trace in enumerate(figure.data) if trace.visible]
    assert len(shown) == 6
    menu = figure.layout.updatemenus[0]
    assert np.flatnonzero(menu.buttons[menu.active].args[0]["visible"]).tolist() == shown
    lengths = np.linalg.norm([figure.data[i].y for i in shown[:3]], axis=0)
    np.testing.assert_allclose(lengths, 1e3 * np.linalg.norm(fits["whole"].residuals[:, 0], axis=1))
    assert "mm" in axis_titles(figure)


def test_parameters_are_drawn_in_millimetres_and_milliradians(
    truth_and_fits: tuple[Truth, dict[str, Calibration]],
) -> None:
    truth, fits = truth_and_fits
    figure = draw_parameters({"whole": fits["whole"]}, truth.x)
    drawn = np.concatenate([trace.y for trace in figure.data if trace.name == "truth"])
    assert sorted(drawn) == pytest.approx(sorted(truth.x * 1e3))
    assert "defect (mm)" in axis_titles(figure)
    assert "defect (mrad)" in axis_titles(figure)
