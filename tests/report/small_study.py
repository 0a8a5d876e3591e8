"""A study of one row for each of four robots."""

import numpy as np

from taskcal.planning.study import Study

GEOMETRY = np.array([0.01, 0.02, 0.03, 0.04])


def study(accuracy: float | None) -> Study:
    rows = tuple(
        {
            "robot": k, "observe": "tracker", "plan": "grid", "count": 12, "model": "all", "rms_mm": e, "max_mm": 2 * e,
            "rms_with_model_error_mm": float(np.hypot(e, 0.05)),
        }
        for k, e in enumerate(GEOMETRY)
    )  # fmt: skip
    return Study(rows=rows, robots=4, seed=0, accuracy=accuracy, model_error=5e-5 / 3.0**0.5, model_error_origin="here")
