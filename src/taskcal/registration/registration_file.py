"""The file of a registration, which the fit starts from or holds."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, ValidationError

from taskcal.campaigns.campaign import Campaign
from taskcal.errors import FileError, TaskcalError, shown
from taskcal.geometry.se3 import array_of, rigid
from taskcal.io.files import write_whole
from taskcal.io.json_file import ON_PURPOSE, note_of_edits, read_versioned, sealed, unseal
from taskcal.io.toml_file import Finite, NotNegative, Section, explain
from taskcal.registration.registration import Method, Registration
from taskcal.robot.error_model import ErrorModel

FORMAT, FORMAT_VERSION = "taskcal registration", 3

Matrix = list[list[Finite]]


class RegistrationSection(Section):
    """Tracker frame and targets, in metres."""

    method: Method = "poses"
    file: str = ""
    T_tracker_base: Matrix
    T_tool_target: list[Matrix]
    rms: NotNegative
    unobservable: Matrix

    def registration(self, targets: int) -> Registration:
        """The registration of so many targets.

        Raises:
            TaskcalError: a transform is not one, or has another shape.
        """
        base, tool = "registration, T_tracker_base", "registration, T_tool_target"
        return Registration(
            T_tracker_base=rigid(base, array_of(base, self.T_tracker_base, (4, 4))),
            T_tool_target=rigid(tool, array_of(tool, self.T_tool_target, (targets, 4, 4))),
            rms=self.rms,
            method=self.method,
            file=self.file,
            unobservable=array_of("registration, unobservable", self.unobservable, (3 * targets, 3 * targets)),
        )


class RegistrationFile(Section):
    """A registration, and what it is of."""

    format: Literal["taskcal registration"]
    format_version: Annotated[int, Field(strict=True)]
    robot: str
    robot_digest: str
    campaign: str
    units: Literal["metres and radians"]
    pose: Annotated[bool, Field(strict=True)]
    targets: list[str] = Field(min_length=1)
    registration: RegistrationSection


def registration_text(registration: Registration, model: ErrorModel, campaign: Campaign) -> str:
    """The file's text.

    Args:
        registration: what was found.
        model: of the robot.
        campaign: from which it was found.
    """
    content = {
        "format": FORMAT,
        "format_version": FORMAT_VERSION,
        "robot": model.robot.name,
        "robot_digest": model.robot.digest,
        "campaign": campaign.source,
        "units": "metres and radians",
        "pose": campaign.rotations is not None,
        "targets": list(campaign.targets),
        "registration": describe_registration(registration),
    }
    return json.dumps(sealed(content), indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def describe_registration(registration: Registration) -> dict[str, Any]:
    """Describe a registration as `RegistrationSection` reads it, in this file and in a calibration's."""
    return {
        "method": registration.method,
        "file": registration.file,
        "T_tracker_base": registration.T_tracker_base.tolist(),
        "T_tool_target": registration.T_tool_target.tolist(),
        "rms": registration.rms,
        "unobservable": registration.unobservable.tolist(),
    }


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
    data = read_versioned(path, "registration", FORMAT, FORMAT_VERSION, "register")
    data, edited = unseal(path, data, f"restore it, or register again; {ON_PURPOSE}", accept=unsealed)
    try:
        content = RegistrationFile.model_validate(data)
        registration = content.registration.registration(len(content.targets))
    except ValidationError as error:
        raise FileError(path, f"{explain(error, RegistrationFile)}; it may have been edited: register again") from error
    except TaskcalError as error:
        raise FileError(path, f"is inconsistent: {error}; it may have been edited: register again") from error
    _check_belongs(path, content, model, campaign)
    return replace(registration, file=note_of_edits(path.name, edited))


def _check_belongs(path: Path, content: RegistrationFile, model: ErrorModel, campaign: Campaign) -> None:
    """See that a registration is of this robot and of what the campaign measured."""
    if content.robot_digest != model.robot.digest:
        raise FileError(
            path,
            f"is a registration of {shown(content.robot)} with digest {shown(content.robot_digest)}; this robot is "
            f"{model.robot.name} with digest {model.robot.digest}: register again with it",
        )
    if tuple(content.targets) != campaign.targets:
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
