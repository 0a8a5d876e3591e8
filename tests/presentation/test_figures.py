"""Figures show the numbers they are given, in the units their axes name."""

from collections.abc import Mapping

import numpy as np
import plotly.graph_objects as go
import pytest

from taskcal.analysis.elimination_table import EliminationTable, tabulate_elimination
from taskcal.analysis.sensitivity import Sensitivity, sensitivity
from taskcal.identification.calibration import Calibration
from taskcal.identification.identify import identify
from taskcal.measurement.virtual_cell import Truth, simulate
from taskcal.presentation.fit_figures import draw_parameters, draw_residuals
from taskcal.presentation.model_figures import draw_sensitivities, draw_singular_values
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel


def axis_titles(figure: go.Figure) -> str:
    layout = figure.to_dict()["layout"]
    axes = [value for key, value in layout.items() if key[1:5] == "axis"]
    axes += [value for key, value in layout.get("scene", {}).items() if key[1:] == "axis"]
    return " ".join(axis.get("title", {}).get("text", "") for axis in axes)


@pytest.fixture(scope="module")
def model() -> ErrorModel:
    return ErrorModel(load_robot("abb-irb120"))


@pytest.fixture(scope="module")
def poses(model: ErrorModel) -> Mapping[str, np.ndarray]:
    """All joints move; the first three alone."""
    q = np.random.default_rng(3).uniform(*0.5 * model.robot.limits.T, size=(30, 6))
    return {"all": q, "arm": np.where(np.arange(6) < 3, q, 0.3)}


@pytest.fixture(scope="module")
def sensitivities(model: ErrorModel, poses: Mapping[str, np.ndarray]) -> Mapping[str, Sensitivity]:
    return {label: sensitivity(model, q) for label, q in poses.items()}


@pytest.fixture(scope="module")
def elimination(model: ErrorModel, poses: Mapping[str, np.ndarray]) -> EliminationTable:
    return tabulate_elimination(model, dict(poses))


@pytest.fixture(scope="module")
def truth_and_fits(model: ErrorModel, poses: Mapping[str, np.ndarray]) -> tuple[Truth, dict[str, Calibration]]:
    campaign, truth = simulate(model, poses["all"], rng=np.random.default_rng(4))
    return truth, {"frames only": identify(model, campaign, keep=()), "whole": identify(model, campaign)}


def test_sensitivities_are_drawn_scaled_and_per_unit(
    sensitivities: Mapping[str, Sensitivity], elimination: EliminationTable
) -> None:
    figure = draw_sensitivities(sensitivities, elimination.eliminations)
    assert len(figure.data) == 6
    found = sensitivities["arm"]
    np.testing.assert_allclose(figure.data[5].y, found.maximum(scaled=True)[2] * 1e6)
    scaled, raw = (button.args[0]["y"] for button in figure.layout.updatemenus[0].buttons)
    np.testing.assert_allclose(scaled[5], figure.data[5].y)
    np.testing.assert_allclose(raw[5], found.maximum()[2])
    pale = [opacity < 1.0 for opacity in figure.data[3].marker.opacity]
    assert pale.count(False) == elimination.eliminations["arm"].rank
    assert "µm" in axis_titles(figure)


def test_singular_values_say_how_many_count(model: ErrorModel, elimination: EliminationTable) -> None:
    figure = draw_singular_values(elimination.eliminations)
    ranks = [found.rank for found in elimination.eliminations.values()]
    assert ranks[0] > ranks[1]
    assert [trace.name.split(": ")[1] for trace in figure.data[:2]] == [f"{r} of {len(model)} count" for r in ranks]
    assert all((np.asarray(trace.y) > 0.0).all() for trace in figure.data)


def test_one_model_of_residuals_is_shown_at_a_time(truth_and_fits: tuple[Truth, dict[str, Calibration]]) -> None:
    fits = truth_and_fits[1]
    figure = draw_residuals({"a": fits, "b": fits}, "whole")
    shown = [i for i, trace in enumerate(figure.data) if trace.visible]
    assert len(shown) == 6
    menu = figure.layout.updatemenus[0]
    assert np.flatnonzero(menu.buttons[menu.active].args[0]["visible"]).tolist() == shown
    lengths = np.linalg.norm([figure.data[i].y for i in shown[:3]], axis=0)
    np.testing.assert_allclose(lengths, 1e6 * np.linalg.norm(fits["whole"].residuals[:, 0], axis=1))
    assert "µm" in axis_titles(figure)


def test_parameters_are_drawn_in_millimetres_and_milliradians(
    truth_and_fits: tuple[Truth, dict[str, Calibration]],
) -> None:
    truth, fits = truth_and_fits
    figure = draw_parameters({"whole": fits["whole"]}, truth.x)
    drawn = np.concatenate([trace.y for trace in figure.data if trace.name == "truth"])
    assert sorted(drawn) == pytest.approx(sorted(truth.x * 1e3))
    assert "defect (mm)" in axis_titles(figure)
    assert "defect (mrad)" in axis_titles(figure)
