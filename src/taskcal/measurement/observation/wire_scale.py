"""A campaign whose instrument of lengths has an unknown scale."""

from dataclasses import replace

from taskcal.errors import CampaignError
from taskcal.measurement.campaign import Campaign
from taskcal.measurement.observation.distance import Lengths


def with_unknown_scale(campaign: Campaign) -> Campaign:
    """A campaign with the scale of its lengths unknown.

    Raises:
        CampaignError: it has no lengths.
    """
    if not any(isinstance(kind, Lengths) for kind in campaign.observations):
        raise CampaignError(f"{campaign.source or 'the campaign'} has no lengths (d_mm) whose scale could be unknown")
    kinds = tuple(replace(kind, scaled=True) if isinstance(kind, Lengths) else kind for kind in campaign.observations)
    return replace(campaign, observations=kinds)
