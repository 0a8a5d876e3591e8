"""Figures of a study."""

import numpy as np
import pytest

from taskcal.planning.study import Study
from taskcal.report.study import draw_study


def test_a_study_has_a_box_for_every_model() -> None:
    rows = tuple(
        {"robot": r, "plan": plan, "count": 10, "model": model, "rms_mm": 0.1 + r, "max_mm": 1.0}
        for r in range(3) for plan in ("planned", "grid") for model in ("all", "selected")
    )  # fmt: skip
    figure = draw_study(Study(rows=rows, robots=3, seed=0, accuracy=1e-4))
    assert [trace.name for trace in figure.data] == ["all", "selected"]
    assert len(figure.data[0].y) == 6
    assert figure.layout.annotations[0].y == pytest.approx(-1.0)
    off = draw_study(Study(rows=rows, robots=3, seed=0, accuracy=5e-4, model_error=4e-4 / 3.0**0.5))
    assert off.layout.annotations[0].y == pytest.approx(np.log10(0.3))
    assert not draw_study(Study(rows=rows, robots=3, seed=0, accuracy=4e-4, model_error=4e-4)).layout.annotations
