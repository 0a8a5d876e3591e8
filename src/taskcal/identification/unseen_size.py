"""Campaigns that no length is in: a robot of any size fits them, and the smallest fits best."""

from dataclasses import replace

from taskcal.errors import CampaignError
from taskcal.identification.fit_options import FitOptions
from taskcal.measurement.campaign import Campaign
from taskcal.measurement.enough_rows import named_file
from taskcal.robot.error_model import ErrorModel

LARGEST_SCALE = 3.0
"""Of the tolerances: beyond, the residuals of a shrinking robot gain more than its lengths lose."""


def with_size_held(model: ErrorModel, campaign: Campaign, options: FitOptions) -> FitOptions:
    """Options that take the stated tolerances of the lengths as they are, where nothing that was measured tells the size.

    The residuals of a ball in its sockets are as small as the robot is. Where the scale of the tolerances is estimated beside
    the model error, the fit that explains all is a robot of no size, which no tolerance then forbids.

    Raises:
        CampaignError: lengths are to be fitted without a prior, or with one that is too wide.
    """
    if not size_is_unseen(campaign):
        return options
    kept = range(len(model)) if options.keep is None else model.indices(options.keep)
    lengths = [model.parameters[i].name for i in kept if model.parameters[i].unit == "m"]
    if not lengths:
        return options
    if options.prior is None or (options.prior_scale != "estimate" and options.prior_scale > LARGEST_SCALE):
        raise CampaignError(
            f"{named_file(campaign)}has no length that was measured or stated, so that a robot of any size fits it, the smallest "
            "best; state a distance between two sockets (--distances FILE), touch opposite faces of a cube, hold the lengths "
            f"({lengths[0]} and others) by a prior of at most {LARGEST_SCALE:g} tolerances, or keep none of them"
        )
    return replace(options, prior_scale=1.0) if options.prior_scale == "estimate" else options


def size_is_unseen(campaign: Campaign) -> bool:
    """Whether a smaller robot leaves smaller residuals of all that was measured."""
    return bool(campaign.observations) and all(kind.shrinks for kind in campaign.observations)
