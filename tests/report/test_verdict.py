"""The sentence about a calibration speaks of predictions, not of the robot."""

import pytest

from taskcal.report.calibration import verdict


@pytest.mark.parametrize(
    ("before", "after", "held_out", "said"),
    [
        (1.299, 0.617, 9, "falls from 1.299 mm, nominal (registered), to 0.617 mm, calibrated (ratio 2.1, 9 held-out points)."),
        (0.2, 0.3, 4, "does not fall from 0.200 mm, nominal (registered), to 0.300 mm, calibrated (ratio 0.7, 4 held-out points)."),
        (0.2, 0.1, None, "(ratio 2.0, fitted rows, optimistic: none were held out)."),
        (0.2, 0.0, 9, "to 0.000 mm, calibrated (9 held-out points)."),
    ],
    ids=["better", "worse", "fitted", "exact"],
)  # fmt: skip
def test_verdict_names_prediction_error_and_sample(
    before: float, after: float, held_out: int | None, said: str
) -> None:
    text = verdict("ur5", before, after, held_out)
    assert text.startswith("ur5: the mean 3D prediction error ")
    assert text.endswith(said)
    assert "accurate" not in text
