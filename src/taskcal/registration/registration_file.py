"""The file of a registration, which the fit starts from or holds."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field

from taskcal.campaigns.campaign import Campaign
from taskcal.errors import FileError, shown
from taskcal.io.codec import InFile, describe, read_sealed
from taskcal.io.files import write_whole
from taskcal.io.json_file import SealedFile, note_of_edits
from taskcal.registration.registration import Registration
from taskcal.robot.error_model import ErrorModel

FILE = SealedFile(what="registration", marker="taskcal registration", version=3, command="register")


@dataclass(frozen=True, eq=False, kw_only=True)
class RegistrationFile:
    """A registration, and what it is of."""

    robot: str
    robot_digest: str
    campaign: str
    units: Literal["metres and radians"] = "metres and radians"
    pose: bool
    targets: Annotated[tuple[str, ...], Field(min_length=1), InFile(counts="targets")]
    registration: Registration


def registration_text(registration: Registration, model: ErrorModel, campaign: Campaign) -> str:
    """The file's text.

    Args:
        registration: what was found.
        model: of the robot.
        campaign: from which it was found.
    """
    content = RegistrationFile(
        robot=model.robot.name,
        robot_digest=model.robot.digest,
        campaign=campaign.source,
        pose=campaign.rotations is not None,
        targets=campaign.targets,
        registration=registration,
    )
    return FILE.text(describe(content))


def save_registration(path: str | Path, registration: Registration, model: ErrorModel, campaign: Campaign) -> None:
    """Write a registration, which `load_registration` reads.

    Raises:
        FileError: the file cannot be written.
    """
    write_whole(Path(path), registration_text(registration, model, campaign))


def load_registration(
    path: str | Path, model: ErrorModel, campaign: Campaign, *, unsealed: bool = False
) -> Registration:
    """Read a registration for a campaign of the same robot and the same targets.

    Args:
        path: written by `save_registration` or ``taskcal register``.
        model: of the robot.
        campaign: that is to be identified.
        unsealed: read a file that was edited since it was written, too; `Registration.file` names the keys then.

    Raises:
        FileError: the file is missing, edited or no registration, or it is one of another robot, of other targets, or of points
            where poses were measured.
    """
    path = Path(path)
    content, edited = read_sealed(path, FILE, RegistrationFile, accept=unsealed)
    _check_belongs(path, content, model, campaign)
    return replace(content.registration, file=note_of_edits(path.name, edited))


def _check_belongs(path: Path, content: RegistrationFile, model: ErrorModel, campaign: Campaign) -> None:
    """See that a registration is of this robot and of what the campaign measured."""
    if content.robot_digest != model.robot.digest:
        raise FileError(
            path,
            f"is a registration of {shown(content.robot)} with digest {shown(content.robot_digest)}; this robot is "
            f"{model.robot.name} with digest {model.robot.digest}: register again with it",
        )
    if content.targets != campaign.targets:
        raise FileError(
            path,
            f"is a registration of the targets {shown(', '.join(content.targets))}; the campaign has "
            f"{', '.join(campaign.targets)}: choose the same with --targets, in the same order",
        )
    if content.pose != (campaign.rotations is not None):
        has, needs = ("poses", "points") if content.pose else ("points", "poses")
        raise FileError(
            path, f"is a registration of measured {has}; the campaign has {needs}: register again with them"
        )
