"""Page, table and figure of a study."""

from dataclasses import replace

import numpy as np
import pytest

from taskcal.planning.study import Study
from taskcal.report.study import describe_unlearnt, draw_study, study_page, tabulate_study
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.task.task import Task
from tests.report.drawn import levels, series

GEOMETRY = np.array([0.01, 0.02, 0.03, 0.04])


def study(accuracy: float | None) -> Study:
    rows = tuple(
        {
            "robot": k, "observe": "tracker", "plan": "grid", "count": 12, "model": "all", "rms_mm": e, "max_mm": 2 * e,
            "rms_with_model_error_mm": float(np.hypot(e, 0.05)), "learnt": True, "failed": "",
        }
        for k, e in enumerate(GEOMETRY)
    )  # fmt: skip
    return Study(rows=rows, robots=4, seed=0, accuracy=accuracy, model_error=5e-5 / 3.0**0.5, model_error_origin="here")


def test_study_figure_has_a_box_for_each_model() -> None:
    rows = tuple(
        {"robot": r, "plan": plan, "count": 10, "model": model, "rms_mm": 0.1 + r, "max_mm": 1.0, "failed": ""}
        for r in range(3) for plan in ("planned", "grid") for model in ("all", "selected")
    )  # fmt: skip
    figure = draw_study(Study(rows=rows, robots=3, seed=0, accuracy=1e-4))
    assert [one.name for one in series(figure)] == ["all", "selected"]
    names = figure.panels[0].y.categories
    for trace in series(figure):
        own = [row for row in rows if row["model"] == trace.name]
        assert trace.x == [row["rms_mm"] for row in own]
        assert [names[k] for k in trace.y] == [f"{row['plan']}, 10 poses" for row in own]
    assert list(levels(figure).values()) == [pytest.approx(0.1)]
    off = draw_study(Study(rows=rows, robots=3, seed=0, accuracy=5e-4, model_error=4e-4 / 3.0**0.5))
    assert list(levels(off).values()) == [pytest.approx(0.3)]
    assert not levels(draw_study(Study(rows=rows, robots=3, seed=0, accuracy=4e-4, model_error=4e-4)))


def test_study_page_has_the_table():
    task = Task(name="milling", poses=np.eye(4)[None])
    page = study_page(ErrorModel(load_robot("ur5")), task, study(5.5e-5)).html()
    table = tabulate_study(study(5.5e-5), "milling")
    assert all(cell in page for cell in (*table.header, *table.rows[0]))


def test_study_table_columns():
    table = tabulate_study(study(None), "milling")
    (row,) = table.rows
    cells = dict(zip(table.header, row, strict=True))
    assert (cells["plan"], cells["poses"], cells["model"]) == ("grid", "12", "all")
    assert float(cells["median mm"]) == pytest.approx(0.025)
    assert float(cells["rms mm"]) == pytest.approx(np.sqrt(np.mean(GEOMETRY**2)), abs=6e-4)
    assert float(cells["at a pose mm"]) == pytest.approx(np.sqrt(np.mean(GEOMETRY**2) + 0.05**2), abs=6e-4)
    assert float(cells["p05 mm"]) < float(cells["median mm"]) < float(cells["p95 mm"])
    assert "'milling', 4 simulated robots" in table.title


def test_study_judges_accuracy_with_model_error():
    """All robots' geometry is within 0.055 mm, but only two of four are at single poses."""
    table = tabulate_study(study(5.5e-5), "milling")
    assert table.header[-1] == "within 0.055 mm"
    assert table.rows[0][-1] == "50%"
    assert study(5.5e-5).geometry_allowance == pytest.approx(np.sqrt(0.055**2 - 0.05**2) * 1e-3)
    assert study(4e-5).geometry_allowance == 0.0


def test_study_counts_uninformative_campaigns():
    made = study(None)
    rows = tuple({**row, "learnt": row["robot"] > 0} for row in made.rows)
    assert made.unlearnt == 0
    assert describe_unlearnt(replace(made, rows=rows)).startswith("from 1 of 4 campaigns")
