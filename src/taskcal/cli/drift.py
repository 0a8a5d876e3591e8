"""``--drift``: what becomes of nests that were measured beside the poses."""

from enum import StrEnum
from typing import TYPE_CHECKING, Annotated, Any

import typer

from taskcal.cli.output import note

if TYPE_CHECKING:
    from taskcal.measurement.campaign import Campaign
    from taskcal.measurement.tracker import TrackerNoise


class DriftChoice(StrEnum):
    """Whether nests are followed."""

    follow = "follow"
    ignore = "ignore"


DriftOption = Annotated[
    DriftChoice,
    typer.Option(
        "--drift", help="Follow the nests beside the robot, where they moved by more than their noise, or ignore them."
    ),
]


def settle(
    measured: "Campaign", choice: DriftChoice, noise: "TrackerNoise | None" = None
) -> tuple["Campaign", dict[str, Any] | None]:
    """The campaign in the frame of its nests, as far as they are to be followed, and what was done; None for no nests."""
    if choice is DriftChoice.ignore or not measured.nests:
        return measured, None
    from taskcal.measurement.drift import follow_nests

    drift = follow_nests(measured, noise)
    for remark in drift.remarks:
        note(remark)
    done = {"followed": drift.followed, "largest_mm": drift.largest * 1e3, "noise_mm": drift.noise * 1e3}
    return drift.campaign, {**done, "remarks": list(drift.remarks)}
