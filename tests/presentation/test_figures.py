"""Figures show the numbers they are given, in the units their axes name."""

import numpy as np
import plotly.graph_objects as go
import pytest
from scipy.stats import chi2

from taskcal.adaptation.predictions import Predictions
from taskcal.adaptation.procedure import SEVERAL, Procedure
from taskcal.presentation.fit_figures import draw_parameters, draw_residuals
from taskcal.presentation.model_figures import draw_sensitivities, draw_singular_values
from taskcal.presentation.prediction_figures import (
    draw_coverage,
    draw_error_over_angle,
    draw_held_out,
    draw_workspace,
)


def axis_titles(figure: go.Figure) -> str:
    layout = figure.to_dict()["layout"]
    axes = [value for key, value in layout.items() if key[1:5] == "axis"]
    axes += [value for key, value in layout.get("scene", {}).items() if key[1:] == "axis"]
    return " ".join(axis.get("title", {}).get("text", "") for axis in axes)


def predictions_of(covariance: np.ndarray, error: np.ndarray, where: str = "same orientations") -> Predictions:
    n = len(error)
    return Predictions(
        campaign=SEVERAL,
        model="all 45, prior",
        where=where,
        q=np.zeros((len(error), 6)),
        position=np.linspace(0.0, 1.0, 3 * n).reshape(n, 3),
        angle=np.linspace(0.0, 0.5, n),
        error=error,
        covariance=np.broadcast_to(covariance, (n, 3, 3)),
    )


@pytest.fixture(scope="module")
def predictions() -> list[Predictions]:
    rng = np.random.default_rng(1)
    factor = 1e-5 * rng.normal(size=(3, 3))
    return [predictions_of(factor @ factor.T, rng.normal(size=(3000, 3)) @ factor.T)]


def test_sensitivities_are_drawn_scaled_and_per_unit(procedure: Procedure) -> None:
    figure = draw_sensitivities(procedure.sensitivities, procedure.elimination.eliminations)
    assert len(figure.data) == 6
    found = procedure.sensitivities[SEVERAL]
    np.testing.assert_allclose(figure.data[5].y, found.maximum(scaled=True)[2] * 1e6)
    scaled, raw = (button.args[0]["y"] for button in figure.layout.updatemenus[0].buttons)
    np.testing.assert_allclose(scaled[5], figure.data[5].y)
    np.testing.assert_allclose(raw[5], found.maximum()[2])
    pale = [opacity < 1.0 for opacity in figure.data[3].marker.opacity]
    assert pale.count(False) == procedure.elimination.eliminations[SEVERAL].rank
    assert "µm" in axis_titles(figure)


def test_singular_values_say_how_many_count(procedure: Procedure) -> None:
    figure = draw_singular_values(procedure.elimination.eliminations)
    assert [trace.name.split(": ")[1] for trace in figure.data[:2]] == ["24 of 45 count", "25 of 45 count"]
    assert all((np.asarray(trace.y) > 0.0).all() for trace in figure.data)


def test_one_model_of_residuals_is_shown_at_a_time(procedure: Procedure) -> None:
    panels = {
        label: {f.model: f.calibration for f in procedure.fits if f.campaign == label} for label in procedure.campaigns
    }
    figure = draw_residuals(panels, "published 33, prior")
    shown = [i for i, trace in enumerate(figure.data) if trace.visible]
    assert len(shown) == 6
    menu = figure.layout.updatemenus[0]
    assert np.flatnonzero(menu.buttons[menu.active].args[0]["visible"]).tolist() == shown
    fit = next(f for f in procedure.fits if f.model == "published 33, prior")
    lengths = np.linalg.norm([figure.data[i].y for i in shown[:3]], axis=0)
    np.testing.assert_allclose(lengths, 1e6 * np.linalg.norm(fit.calibration.residuals[:, 0], axis=1))
    assert "µm" in axis_titles(figure)


def test_parameters_are_drawn_in_millimetres_and_milliradians(procedure: Procedure) -> None:
    whole = {f.campaign: f.calibration for f in procedure.fits if f.parameters == len(procedure.model)}
    figure = draw_parameters(whole, procedure.truth.x)
    truth = np.concatenate([trace.y for trace in figure.data if trace.name == "truth"])
    assert sorted(truth) == pytest.approx(sorted(procedure.truth.x * 1e3))
    assert "defect (mm)" in axis_titles(figure)
    assert "defect (mrad)" in axis_titles(figure)


def test_held_out_errors_are_all_inside_the_axis(procedure: Procedure) -> None:
    figure = draw_held_out(procedure.fits)
    low, high = figure.layout.xaxis.range
    drawn = np.concatenate([np.asarray(trace.x, dtype=float) for trace in figure.data])
    expected = [v * 1e6 for f in procedure.fits for e in (f.inside, f.outside) for v in (e.mean, e.maximum)]
    assert set(np.round(drawn, 6)) == set(np.round(expected, 6))
    assert low < np.log10(drawn).min()
    assert np.log10(drawn).max() < high


def test_coverage_of_a_right_statement_is_the_diagonal(predictions: list[Predictions]) -> None:
    figure = draw_coverage(predictions)
    curve = next(trace for trace in figure.data if trace.mode == "lines")
    np.testing.assert_allclose(curve.y, curve.x, atol=3.0)  # 3000 poses: one standard deviation is 0.9 % at most
    assert "%" in axis_titles(figure)
    assert predictions[0].share_inside(0.95) == pytest.approx(0.95, abs=0.02)


def test_squared_distance_has_three_degrees_of_freedom(predictions: list[Predictions]) -> None:
    assert predictions[0].squared_distance.mean() == pytest.approx(chi2.mean(3), rel=0.1)
    assert predictions[0].stated[0] ** 2 == pytest.approx(np.mean(predictions[0].length ** 2), rel=0.1)


def test_views_of_the_workspace_share_their_colours(predictions: list[Predictions]) -> None:
    larger = predictions_of(predictions[0].covariance[0], 10.0 * predictions[0].error[:50], "turned farther")
    figure = draw_workspace([predictions[0], larger], {SEVERAL: np.zeros((4, 3))})
    assert len({trace.marker.cmax for trace in figure.data if trace.name == "new poses"}) == 1
    assert [trace.visible for trace in figure.data] == [True, True, False, False]
    assert "X (mm)" in axis_titles(figure)


def test_errors_are_drawn_over_degrees(predictions: list[Predictions]) -> None:
    figure = draw_error_over_angle(predictions)
    assert max(figure.data[0].x) == pytest.approx(np.degrees(0.5))
    assert "°" in axis_titles(figure)
