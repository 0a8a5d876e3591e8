"""``--drift``: what becomes of reference points that were measured beside the poses."""

from enum import StrEnum
from typing import TYPE_CHECKING, Annotated, Any

import typer

from taskcal.cli.output import note

if TYPE_CHECKING:
    from taskcal.measurement.campaign import Campaign
    from taskcal.measurement.tracker import TrackerNoise


class DriftChoice(StrEnum):
    """Whether reference points are followed."""

    follow = "follow"
    ignore = "ignore"


DriftOption = Annotated[
    DriftChoice,
    typer.Option(
        "--drift",
        help="Follow the reference points beside the robot, where they moved by more than their noise, or ignore them.",
    ),
]


def compensate(
    measured: "Campaign", choice: DriftChoice, noise: "TrackerNoise | None" = None
) -> tuple["Campaign", dict[str, Any] | None]:
    """The campaign in the frame of its reference points, as far as they are to be followed, and what was done.

    None where the campaign has none.
    """
    if choice is DriftChoice.ignore or not measured.reference_points:
        return measured, None
    from taskcal.measurement.drift import compensate_drift

    drift = compensate_drift(measured, noise)
    for remark in drift.remarks:
        note(remark)
    done = {"followed": drift.followed, "largest_mm": drift.largest * 1e3, "noise_mm": drift.noise * 1e3}
    return drift.campaign, {**done, "remarks": list(drift.remarks)}
