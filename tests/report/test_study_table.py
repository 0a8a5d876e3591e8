"""The table of a study says what its rows hold, and judges the accuracy at single poses."""

from dataclasses import replace

import numpy as np
import pytest

from taskcal.report.study import describe_unlearnt, tabulate_study
from tests.report.small_study import GEOMETRY, study


def test_each_column_is_what_it_is_called():
    table = tabulate_study(study(None), "milling")
    (row,) = table.rows
    cells = dict(zip(table.header, row, strict=True))
    assert (cells["plan"], cells["poses"], cells["model"]) == ("grid", "12", "all")
    assert float(cells["median mm"]) == pytest.approx(0.025)
    assert float(cells["rms mm"]) == pytest.approx(np.sqrt(np.mean(GEOMETRY**2)), abs=6e-4)
    assert float(cells["at a pose mm"]) == pytest.approx(np.sqrt(np.mean(GEOMETRY**2) + 0.05**2), abs=6e-4)
    assert float(cells["p05 mm"]) < float(cells["median mm"]) < float(cells["p95 mm"])
    assert "'milling', 4 simulated robots" in table.title


def test_the_accuracy_is_judged_with_the_model_error():
    """All robots' geometry is within 0.055 mm, but only two of four are at single poses."""
    table = tabulate_study(study(5.5e-5), "milling")
    assert table.header[-1] == "within 0.055 mm"
    assert table.rows[0][-1] == "50%"
    assert study(5.5e-5).geometry_allowance == pytest.approx(np.sqrt(0.055**2 - 0.05**2) * 1e-3)
    assert study(4e-5).geometry_allowance == 0.0


def test_robots_of_which_nothing_was_learnt_are_counted():
    made = study(None)
    rows = tuple({**row, "learnt": row["robot"] > 0} for row in made.rows)
    assert made.unlearnt == 0
    assert describe_unlearnt(replace(made, rows=rows)).startswith("from 1 of 4 campaigns")
