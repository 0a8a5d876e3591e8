"""``--drift``: what becomes of reference points that were measured beside the poses."""

from enum import StrEnum
from typing import TYPE_CHECKING, Any

from taskcal.cli.output import info

if TYPE_CHECKING:
    from taskcal.measurement.campaign import Campaign
    from taskcal.measurement.tracker import TrackerNoise


class DriftChoice(StrEnum):
    """Whether reference points are followed."""

    follow = "follow"
    ignore = "ignore"


def compensate(
    campaign: "Campaign", choice: DriftChoice, noise: "TrackerNoise | None" = None
) -> tuple["Campaign", dict[str, Any] | None]:
    """The campaign in the frame of its reference points, as far as they are to be followed, and what was done.

    None was done where there are no reference points, or where they are ignored.
    """
    if choice is DriftChoice.ignore or not campaign.reference_points:
        return campaign, None
    from taskcal.measurement.drift import compensate_drift

    drift = compensate_drift(campaign, noise)
    for remark in drift.remarks:
        info(remark)
    summary = {"followed": drift.followed, "largest_mm": drift.largest * 1e3, "noise_mm": drift.noise * 1e3}
    return drift.campaign, {**summary, "remarks": list(drift.remarks)}
