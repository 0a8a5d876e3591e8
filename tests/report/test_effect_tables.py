"""Tables of effects."""

import numpy as np

from taskcal.analysis.sensitivity import sensitivity
from taskcal.identification.calibration import Calibration
from taskcal.identification.residual_analysis import ResidualAnalysis
from taskcal.report.sensitivity import tabulate_effects


def test_tables_of_effects_name_their_units(fitted: tuple[Calibration, ResidualAnalysis]) -> None:
    model = fitted[0].model
    q = np.random.default_rng(0).uniform(-1.0, 1.0, (10, 6))
    rows = {row[0]: row for _, group in tabulate_effects(sensitivity(model, q)).groups for row in group}
    assert rows["J2.gain"][1] == "mm/(mrad/rad)"
    assert rows["J2.sag_tool"][1] == "mm/(mrad/m)"
    assert rows["J2.gain"][10] == "0.3 mrad/rad"
