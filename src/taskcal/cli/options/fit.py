"""Options of a fit as they were written, with what their names and files stand for.

Nothing is imported before it is needed: what is wrong is refused first.
"""

from pathlib import Path
from typing import TYPE_CHECKING

from taskcal.errors import TaskcalError
from taskcal.identification.options import FitOptions
from taskcal.registration.options import register_by
from taskcal_groundwork.options import Written

if TYPE_CHECKING:
    from taskcal.campaigns.campaign import Campaign
    from taskcal.observations.base import TrackerNoise
    from taskcal.robot.error_model import ErrorModel


def fit_options(
    written: Written[FitOptions], model: "ErrorModel", campaign: "Campaign", *, unsealed: bool = False
) -> tuple[FitOptions, list[str]]:
    """Options of a fit as they were written, with what their names and files stand for; and what was edited of the files.

    Args:
        written: the options.
        model: to be fitted.
        campaign: the measurements.
        unsealed: whether files that were edited are read.

    Raises:
        CampaignError: the campaign does not determine the registration.
        FileError: the registration's file is of another robot, or of other targets; or that of ``like`` is no calibration.
        TaskcalError: nothing is published of the robot.
    """
    from taskcal.identification.calibration import load_calibration
    from taskcal.registration.registration_file import load_registration

    like = None if written.like is None else load_calibration(written.like, unsealed=unsealed)
    edited = ["" if like is None else like.edit_warning]
    registration = register_by("circles", model, campaign) if written.registration == "circles" else None
    if (path := registration_file(written)) is not None:
        registration = load_registration(path, model, campaign, unsealed=unsealed)
        edited.append("" if registration.file == path.name else f"not as it was registered: {registration.file}")
    made = written.made(
        keep=_kept(model, written.keep),
        registration=registration,
        noise=tracker_noise(written),
        like=like,
    )
    return made, list(filter(None, edited))


def tracker_noise(written: Written[FitOptions]) -> "TrackerNoise | None":
    """The tracker's; None for the default."""
    from taskcal.observations.base import TrackerNoise

    return None if written.noise is None else TrackerNoise(mpe_to_sigma=written.noise)


def registration_file(written: Written[FitOptions]) -> Path | None:
    """The file that is read, if one is named."""
    return None if written.registration in (None, "circles") else written.registration


def _kept(model: "ErrorModel", names: tuple[str, ...] | None) -> tuple[str, ...] | None:
    """Parameters to fit; ``published`` stands for a publication's choice, ``none`` for the frames alone.

    Raises:
        TaskcalError: nothing is published of the robot.
    """
    if names == ("none",):
        return ()
    if names != ("published",):
        return names
    if model.robot.published.source:
        from taskcal.analysis.identifiability import published_kept

        return published_kept(model)
    raise TaskcalError(f"'published': the robot file of {model.robot.name} names no publication; name the parameters")
