"""The table of a study says what its rows hold, and judges the accuracy at single poses."""

import numpy as np
import pytest

from taskcal.adaptation.study import Study
from taskcal.presentation.study_report import study_html
from taskcal.presentation.study_table import tabulate_study
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.task.task import Task

GEOMETRY = np.array([0.01, 0.02, 0.03, 0.04])


def study(accuracy: float | None) -> Study:
    rows = tuple(
        {
            "robot": k, "plan": "grid", "count": 12, "model": "all", "rms_mm": e, "max_mm": 2 * e,
            "rms_with_model_error_mm": float(np.hypot(e, 0.05)),
        }
        for k, e in enumerate(GEOMETRY)
    )  # fmt: skip
    return Study(rows=rows, robots=4, seed=0, accuracy=accuracy, model_error=5e-5 / 3.0**0.5, model_error_origin="here")


def test_each_column_is_what_it_is_called():
    table = tabulate_study(study(None), "milling")
    (row,) = table.rows
    cells = dict(zip(table.header, row, strict=True))
    assert (cells["plan"], cells["poses"], cells["model"]) == ("grid", "12", "all")
    assert float(cells["median"]) == pytest.approx(0.025)
    assert float(cells["rms"]) == pytest.approx(np.sqrt(np.mean(GEOMETRY**2)), abs=1e-4)
    assert float(cells["at a pose"]) == pytest.approx(np.sqrt(np.mean(GEOMETRY**2) + 0.05**2), abs=1e-4)
    assert float(cells["5 % below"]) < float(cells["median"]) < float(cells["95 % below"])
    assert "'milling', 4 virtual robots" in table.title


def test_the_accuracy_is_judged_with_the_model_error():
    """All robots' geometry is within 0.055 mm, but only two of four are at single poses."""
    table = tabulate_study(study(5.5e-5), "milling")
    assert table.header[-1] == "within 0.055 mm"
    assert table.rows[0][-1] == "50%"
    assert study(5.5e-5).geometry_allowance == pytest.approx(np.sqrt(0.055**2 - 0.05**2) * 1e-3)
    assert study(4e-5).geometry_allowance == 0.0


def test_the_page_has_the_same_table():
    task = Task(name="milling", poses=np.eye(4)[None])
    page = study_html(ErrorModel(load_robot("ur5")), task, study(5.5e-5), version="0")
    table = tabulate_study(study(5.5e-5), "milling")
    assert all(cell in page for cell in (*table.header, *table.rows[0]))
