"""Where a calibration comes from."""

from dataclasses import replace

import numpy as np

from taskcal.identification.calibration import load_calibration
from taskcal.identification.identify import identify
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from tests.laws.campaigns import measure
from tests.laws.robots import irb6660_positions


def test_provenance_keeps_excluded_rows(tmp_path):
    """Rows excluded from the campaign are recorded in the calibration."""
    rng = np.random.default_rng(0)
    model = ErrorModel(load_robot("abb-irb6660-205-1.9"))
    campaign, _ = measure(rng, model, irb6660_positions(rng, 30), np.zeros(len(model)), sigma=3e-5)
    noted = identify(model, replace(campaign, notes=("column left out: comment",)))
    assert noted.provenance.notes == ("column left out: comment",)
    noted.save(tmp_path / "cal.json")
    assert load_calibration(tmp_path / "cal.json").provenance == noted.provenance
