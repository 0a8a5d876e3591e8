"""Where tracker frame and targets come from, as commands are told: from all poses, from axis circles, or a file."""

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from taskcal.campaigns.campaign import Campaign
    from taskcal.registration.registration import Registration
    from taskcal.robot.error_model import ErrorModel


class Method(StrEnum):
    """Ways to register."""

    poses = "poses"
    circles = "circles"


RegistrationOption = Annotated[
    str,
    typer.Option(
        "--registration",
        metavar="poses|circles|REG.json",
        help="Tracker frame and targets that the fit starts from, or holds with --frames fixed: from all poses, from the "
        "circles of axes that turn alone, or a file of taskcal register.",
    ),
]


def register_by(method: Method, model: "ErrorModel", campaign: "Campaign") -> "Registration":
    """The registration of a campaign.

    Raises:
        CampaignError: the campaign does not give it, or is not of this robot.
    """
    from taskcal.registration.circles import register_from_circles
    from taskcal.registration.consensus import check_plausible
    from taskcal.registration.registration import register

    registered = register_from_circles(model, campaign) if method is Method.circles else register(model, campaign)
    check_plausible(registered, model, campaign)
    return registered


def registration_of(chosen: str, model: "ErrorModel", campaign: "Campaign") -> "Registration | None":
    """What `RegistrationOption` names; None where the fit is to find it from all poses.

    Raises:
        CampaignError: the campaign does not give it.
        FileError: the file is no registration of this robot and these targets.
    """
    if chosen == Method.poses.value:
        return None
    if chosen == Method.circles.value:
        return register_by(Method.circles, model, campaign)
    from taskcal.registration.registration_file import load_registration

    return load_registration(chosen, model, campaign)


def registration_file(chosen: str) -> Path | None:
    """The file that `RegistrationOption` names, if it names one."""
    return None if chosen in {method.value for method in Method} else Path(chosen)
