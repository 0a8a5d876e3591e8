"""Page, tables and figures of a sensitivity analysis."""

from collections.abc import Mapping

import numpy as np
import pytest

from taskcal.analysis.identifiability import EliminationTable, find_distinguishable, tabulate_elimination
from taskcal.analysis.sensitivity import MeasuringNoise, Sensitivity, sensitivity
from taskcal.identification.calibration import Calibration
from taskcal.identification.residual_analysis import ResidualAnalysis
from taskcal.report.sensitivity import (
    count_distinguishable,
    draw_effects,
    draw_sensitivities,
    draw_singular_values,
    sensitivity_page,
    tabulate_distinguishable,
    tabulate_effects,
)
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot import ModelError
from tests.report.axis_titles import axis_titles


def test_effects_figure_matches_the_table() -> None:
    model = ErrorModel(load_robot("ur5"))
    found = Sensitivity(model=model, matrix=np.random.default_rng(0).normal(size=(7, 3, len(model))))
    np.testing.assert_allclose((found.rms_per_axis() ** 2).sum(axis=0), found.rms() ** 2)
    figure, table = draw_effects(found), tabulate_effects(found)
    assert len(figure.data) == 8
    rows = table.groups[0][1]
    assert len(rows) == len(model)
    assert float(rows[0][-1]) == pytest.approx(figure.data[7].y[0], abs=0.51)
    raw = figure.layout.updatemenus[0].buttons[1].args[0]["y"]
    assert float(rows[3][2]) == pytest.approx(raw[0][3], abs=1e-3)


def test_effects_table_names_units(fitted: tuple[Calibration, ResidualAnalysis]) -> None:
    model = fitted[0].model
    q = np.random.default_rng(0).uniform(-1.0, 1.0, (10, 6))
    rows = {row[0]: row for _, group in tabulate_effects(sensitivity(model, q)).groups for row in group}
    assert rows["J2.gain"][1] == "mm/(mrad/rad)"
    assert rows["J2.sag_tool"][1] == "mm/(mrad/m)"
    assert rows["J2.gain"][10] == "0.3 mrad/rad"


@pytest.fixture(scope="module")
def sensitivities(model: ErrorModel, poses: Mapping[str, np.ndarray]) -> Mapping[str, Sensitivity]:
    return {label: sensitivity(model, q) for label, q in poses.items()}


@pytest.fixture(scope="module")
def elimination(model: ErrorModel, poses: Mapping[str, np.ndarray]) -> EliminationTable:
    return tabulate_elimination(model, dict(poses))


def test_sensitivities_figure_is_scaled_or_per_unit(
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


def test_singular_values_figure_counts_the_rank(model: ErrorModel, elimination: EliminationTable) -> None:
    figure = draw_singular_values(elimination.eliminations)
    ranks = [found.rank for found in elimination.eliminations.values()]
    assert ranks[0] > ranks[1]
    assert [trace.name.split(": ")[1] for trace in figure.data[:2]] == [f"{r} of {len(model)} count" for r in ranks]
    assert all((np.asarray(trace.y) > 0.0).all() for trace in figure.data)


def test_sensitivity_page_states_determined_directions():
    model = ErrorModel(load_robot("ur5"))
    q = np.random.default_rng(0).uniform(-1.5, 1.5, size=(20, 6))
    table = tabulate_elimination(model, {"poses": q})
    noise = MeasuringNoise(tracker=3e-5, model_error=ModelError(position=4e-4, source="a guess"))
    told_apart = table.eliminations["poses"].distinguishable(noise=noise.total)
    page = sensitivity_page(sensitivity(model, q), table, told_apart, noise, maps=None, poses="20 poses").html()
    assert 0 < told_apart.count < table.eliminations["poses"].rank
    assert f"{told_apart.count} of {table.eliminations['poses'].rank} directions are determined" in page
    assert "0.401 mm per axis at every pose: tracker 0.03 mm, model error 0.4 mm (a guess)" in page
    assert all(cell in page for row in tabulate_distinguishable(told_apart, {}).rows for cell in row[1:])


def test_directions_table_begins_with_the_weakest():
    told_apart = find_distinguishable(np.diag([3.0, 1.0, 0.1]), ("a", "b", "c"), np.ones(3), 3, noise=0.5)
    table = tabulate_distinguishable(told_apart, {"a": "α"})
    assert [row[0] for row in table.rows] == ["c", "b", "α"]
    assert [float(row[1]) for row in table.rows] == pytest.approx([1.04**-0.5, 5**-0.5, 37**-0.5], abs=5e-4)
    assert [row[2] for row in table.rows] == ["no", "yes", "yes"]
    assert count_distinguishable(told_apart).startswith("2 of 3 directions are determined: ")


def test_directions_table_is_short():
    rng = np.random.default_rng(0)
    told_apart = find_distinguishable(rng.normal(size=(20, 9)), tuple("abcdefghi"), np.ones(9), 9, noise=1.0)
    table = tabulate_distinguishable(told_apart, {})
    assert len(table) == 5
    assert all(row[0].endswith(" …") and row[0].count("·") <= 5 for row in table.rows)
