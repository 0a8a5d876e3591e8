"""Figures of a model show its sensitivities and what can be identified."""

from collections.abc import Mapping

import numpy as np
import pytest

from taskcal.analysis.identifiability import EliminationTable, tabulate_elimination
from taskcal.analysis.sensitivity import Sensitivity, sensitivity
from taskcal.report.sensitivity import draw_sensitivities, draw_singular_values
from taskcal.robot.error_model import ErrorModel
from tests.report.axis_titles import axis_titles


@pytest.fixture(scope="module")
def sensitivities(model: ErrorModel, poses: Mapping[str, np.ndarray]) -> Mapping[str, Sensitivity]:
    return {label: sensitivity(model, q) for label, q in poses.items()}


@pytest.fixture(scope="module")
def elimination(model: ErrorModel, poses: Mapping[str, np.ndarray]) -> EliminationTable:
    return tabulate_elimination(model, dict(poses))


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
