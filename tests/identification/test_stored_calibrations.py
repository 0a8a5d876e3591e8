"""Calibrations that earlier versions of Taskcal wrote are read, and predict what those versions predicted.

Each was written by the last state of the sources that wrote its version of the format, of the same virtual campaign, together with
its predictions at four poses.
"""

import json
from pathlib import Path

import numpy as np
import pytest

from taskcal.identification.calibration import load_calibration
from taskcal.identification.calibration_format import FORMAT_VERSION

STORED = Path(__file__).parent / "stored"
VERSIONS = range(1, FORMAT_VERSION + 1)


@pytest.mark.parametrize("version", VERSIONS)
def test_a_stored_calibration_of_every_version_predicts_what_it_predicted(version: int, tmp_path: Path) -> None:
    path = STORED / f"calibration-{version}.json"
    assert json.loads(path.read_text(encoding="utf-8"))["format_version"] == version
    calibration = load_calibration(path)
    said = {
        name: np.array(values)
        for name, values in json.loads((STORED / f"predicted-{version}.json").read_text()).items()
    }
    calibration.save(tmp_path / "again.json")
    for read in (calibration, load_calibration(tmp_path / "again.json")):
        np.testing.assert_allclose(read.predict(said["q"]), said["points"], rtol=0, atol=1e-12)
        np.testing.assert_allclose(read.predict_covariance(said["q"]), said["covariance"], rtol=1e-9, atol=1e-20)
