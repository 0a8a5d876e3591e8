"""The robot as its file describes it, with only tracker frame and targets found: what a calibration has to be better than."""

from dataclasses import replace

from taskcal.identification.calibration import Calibration
from taskcal.identification.fit_options import FitOptions
from taskcal.identification.identify import identify
from taskcal.measurement.campaign import Campaign
from taskcal.robot.error_model import ErrorModel


def fit_nominal(model: ErrorModel, campaign: Campaign, options: FitOptions) -> Calibration:
    """Fit tracker frame and targets of the nominal robot, to all rows.

    Args:
        model: its effects are left out.
        campaign: the measurements, without rows that cannot be right.
        options: of the fit that it is compared with.

    Raises:
        CampaignError: too few rows.
        FitError: the fit did not converge.
    """
    nominal = ErrorModel(model.robot, lengths_only=model.lengths_only)
    frames_only = replace(options, keep=(), prior=None, prior_scale="estimate", gross_errors="keep")
    return identify(nominal, campaign, options=frames_only)
