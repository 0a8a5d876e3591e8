"""Figures of effects show the numbers of their table."""

import numpy as np
import pytest

from taskcal.analysis.sensitivity import Sensitivity
from taskcal.report.sensitivity import draw_effects, tabulate_effects
from taskcal.report.task import draw_bands
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel


def test_bands_are_95_percent_in_millimetres() -> None:
    figure = draw_bands({"before": np.full((5, 3), 1e-3), "after": np.full((5, 3), 1e-4)})
    heights = {round(float(np.max(trace.y)), 6) for trace in figure.data}
    assert heights == {1.96, 0.196}


def test_effects_are_those_of_the_table() -> None:
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
