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
from tests.report.drawn import axis_titles, series


def test_effects_figure_matches_the_table() -> None:
    model = ErrorModel(load_robot("ur5"))
    found = Sensitivity(model=model, matrix=np.random.default_rng(0).normal(size=(7, 3, len(model))))
    np.testing.assert_allclose((found.rms_per_axis() ** 2).sum(axis=0), found.rms() ** 2)
    views, table = draw_effects(found), tabulate_effects(found)
    scaled, raw = (series(one) for one in views.values())
    assert len(scaled) == 8
    rows = table.groups[0][1]
    assert len(rows) == len(model)
    assert float(rows[0][-1]) == pytest.approx(scaled[7].x[0], abs=0.51)
    assert float(rows[3][2]) == pytest.approx(raw[0].x[3], abs=1e-3)


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
    views = draw_sensitivities(sensitivities, elimination.eliminations)
    scaled, raw = (series(one) for one in views.values())
    assert len(scaled) == 6
    found = sensitivities["arm"]
    np.testing.assert_allclose(scaled[5].x, found.maximum(scaled=True)[2] * 1e6)
    np.testing.assert_allclose(raw[5].x, found.maximum()[2])
    assert list(scaled[3].hollow).count(False) == elimination.eliminations["arm"].rank
    assert "µm" in axis_titles(views["scaled by tolerance"])


def test_singular_values_figure_counts_the_rank(model: ErrorModel, elimination: EliminationTable) -> None:
    figure = draw_singular_values(elimination.eliminations)
    ranks = [found.rank for found in elimination.eliminations.values()]
    assert ranks[0] > ranks[1]
    assert [one.name.split(": ")[1] for one in series(figure)] == [f"{r} of {len(model)} count" for r in ranks]
    assert all((one.y > 0.0).all() for one in series(figure))
    assert [one.hollow.count(False) for one in series(figure)] == ranks


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
