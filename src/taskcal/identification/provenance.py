"""Where a calibration comes from."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from typing import Any

from taskcal.campaigns.campaign import Campaign
from taskcal.robot.error_model import ErrorModel


@dataclass(frozen=True, kw_only=True)
class Provenance:
    """Where a calibration comes from."""

    robot: str
    robot_digest: str
    campaign: str
    """File of the campaign."""
    campaign_digest: str
    rows: int
    version: str
    created: str
    options: Mapping[str, Any] = field(default_factory=dict[str, Any])
    """Of the identification: parameters kept, prior, loss, noise, and what was given instead of estimated."""
    notes: tuple[str, ...] = ()
    """What the reader of the campaign left out and decided."""

    @classmethod
    def of(cls, model: ErrorModel, campaign: Campaign, options: Mapping[str, Any]) -> "Provenance":
        """Provenance of a fit made now with these options."""
        return cls(
            robot=model.robot.name,
            robot_digest=model.robot.digest,
            campaign=campaign.source,
            campaign_digest=campaign.digest,
            rows=len(campaign),
            version=package_version(),
            created=datetime.now(UTC).isoformat(timespec="seconds"),
            options=options,
            notes=campaign.notes,
        )


@cache
def package_version() -> str:
    """Version of the installed package."""
    try:
        return version("taskcal")
    except PackageNotFoundError:
        return "unknown"
