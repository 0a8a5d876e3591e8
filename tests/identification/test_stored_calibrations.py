"""A stored calibration is read, predicts what it predicted, and is written again as the same bytes.

It stands for the format: whoever changes what a file holds also changes its version.
"""

import json
from pathlib import Path

import numpy as np

from taskcal.identification.calibration import load_calibration

STORED = Path(__file__).parent / "stored"


def test_stored_calibration_keeps_predictions_and_bytes(tmp_path: Path) -> None:
    """A stored calibration gives the same predictions and is written back with the same bytes."""
    calibration = load_calibration(STORED / "calibration.json")
    said = {name: np.array(values) for name, values in json.loads((STORED / "predicted.json").read_text()).items()}
    np.testing.assert_allclose(calibration.predict(said["q"]), said["points"], rtol=0, atol=1e-12)
    np.testing.assert_allclose(calibration.predict_covariance(said["q"]), said["covariance"], rtol=1e-9, atol=1e-20)
    calibration.save(tmp_path / "again.json")
    assert (tmp_path / "again.json").read_bytes() == (STORED / "calibration.json").read_bytes()
