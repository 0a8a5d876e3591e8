"""Figures of the demonstration show the numbers they are given, in the units their axes name."""

import numpy as np
import pytest
from scipy.stats import chi2

from taskcal_demo.procedure import SEVERAL, Predictions, Procedure
from taskcal_demo.procedure_report import draw_coverage, draw_error_over_angle, draw_held_out, draw_workspace
from tests.report.drawn import axis_titles, series


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


def test_held_out_errors_are_drawn_in_micrometres(procedure: Procedure) -> None:
    figure = draw_held_out(procedure.fits)
    drawn = np.concatenate([one.x for one in series(figure)])
    expected = [v * 1e6 for f in procedure.fits for e in (f.inside, f.outside) for v in (e.mean, e.maximum)]
    assert set(np.round(drawn, 6)) == set(np.round(expected, 6))
    assert all(panel.x.log and panel.x.unit == "µm" for panel in figure.panels)


def test_coverage_of_a_right_statement_is_the_diagonal(predictions: list[Predictions]) -> None:
    figure = draw_coverage(predictions)
    curve = figure.panels[1].series[0]
    np.testing.assert_allclose(curve.y, curve.x, atol=3.0)  # 3000 poses: one standard deviation is 0.9 % at most
    assert "%" in axis_titles(figure)
    assert predictions[0].share_inside(0.95) == pytest.approx(0.95, abs=0.02)


def test_squared_distance_has_three_degrees_of_freedom(predictions: list[Predictions]) -> None:
    assert predictions[0].squared_distance.mean() == pytest.approx(chi2.mean(3), rel=0.1)
    assert predictions[0].stated[0] ** 2 == pytest.approx(np.mean(predictions[0].length ** 2), rel=0.1)


def test_views_of_the_workspace_share_their_colours(predictions: list[Predictions]) -> None:
    larger = predictions_of(predictions[0].covariance[0], 10.0 * predictions[0].error[:50], "turned farther")
    layers = draw_workspace([predictions[0], larger], {SEVERAL: np.zeros((4, 3))}).layers
    assert len({layer["most"] for layer in layers if "most" in layer}) == 1
    assert [layer["off"] for layer in layers] == [False, True, False]
    assert layers[1]["at"][-1][2] == 1000.0


def test_errors_are_drawn_over_degrees(predictions: list[Predictions]) -> None:
    figure = draw_error_over_angle(predictions)
    assert max(series(figure)[0].x) == pytest.approx(np.degrees(0.5))
    assert "°" in axis_titles(figure)
