"""What is stated of a campaign's scale beside its rows: distances of sockets, or that a wire's scale is unknown."""

from dataclasses import replace
from pathlib import Path

from taskcal.campaigns.campaign import Campaign
from taskcal.errors import CampaignError, FileError


def with_distances(campaign: Campaign, path: str | Path) -> Campaign:
    """A campaign with the distances of a file: columns ``socket_a``, ``socket_b``, ``distance_mm``, and optionally ``u_mm``.

    Raises:
        FileError: the file cannot be read, names a socket that the campaign does not have, or states a distance twice.
    """
    stated = [kind.with_stated(Path(path)) for kind in campaign.observations]
    if not any(stated):
        raise FileError(
            Path(path), f"states distances of sockets, and {campaign.source or 'the campaign'} has no column socket"
        )
    kinds = tuple(own or kind for own, kind in zip(stated, campaign.observations, strict=True))
    return replace(campaign, observations=kinds)


def distances_text(campaign: Campaign) -> str:
    """The file that `with_distances` reads; empty where nothing is stated."""
    return next((text for kind in campaign.observations if (text := kind.stated_text()) is not None), "")


def with_unknown_scale(campaign: Campaign) -> Campaign:
    """A campaign with the scale of its lengths unknown.

    Raises:
        CampaignError: it has no lengths.
    """
    scaled = [kind.with_unknown_scale() for kind in campaign.observations]
    if not any(scaled):
        raise CampaignError(f"{campaign.source or 'the campaign'} has no lengths (d_mm) whose scale could be unknown")
    kinds = tuple(own or kind for own, kind in zip(scaled, campaign.observations, strict=True))
    return replace(campaign, observations=kinds)
