"""What a calibration tells of the errors at its rows is what the campaign itself tells."""

from dataclasses import replace

import numpy as np
import pytest

from taskcal.identification.identify import fit_nominal, identify
from taskcal.identification.options import FitOptions
from taskcal.identification.validation import measured_errors
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.virtual.cell import simulate


@pytest.mark.parametrize("pose", [False, True])
def test_before_and_after_are_those_of_the_campaign(pose: bool) -> None:
    rng = np.random.default_rng(0)
    model = ErrorModel(load_robot("ur5"))
    campaign, _ = simulate(model, rng.uniform(-1.2, 1.2, (25, 6)), rng=rng, pose=pose)
    lost = campaign.points.copy()
    lost[3] = np.nan
    campaign = replace(campaign, points=lost)
    calibration = identify(model, campaign)
    errors = measured_errors(calibration)
    assert errors is not None
    np.testing.assert_allclose(errors.after, calibration.residuals_on(campaign, frame="base"), atol=1e-9)
    nominal = fit_nominal(model, campaign, FitOptions())
    np.testing.assert_allclose(errors.before, nominal.residuals_on(campaign, frame="base"), atol=1e-6)
    assert np.nanmean(np.linalg.norm(errors.before[..., :3], axis=2)) > 3 * np.nanmean(
        np.linalg.norm(errors.after[..., :3], axis=2)
    )
    assert np.isnan(errors.after[3]).all()
