"""What is wrong with a campaign's file, for the doctor and behind refusals."""

from pathlib import Path
from typing import TYPE_CHECKING

from taskcal.cli.steps_bar import bar_by_parts
from taskcal.errors import TaskcalError, UnitError

if TYPE_CHECKING:
    from taskcal.diagnosis.diagnose import Diagnosis
    from taskcal.robot.robot import Robot


def diagnose_file(path: Path, robot: "Robot") -> "Diagnosis":
    """The diagnosis of a file, which may lie outside the robot's limits; how far it is is shown on a terminal.

    Raises:
        FileError: it cannot be read as a campaign of so many joints.
    """
    from taskcal.diagnosis.open_limits import open_limits
    from taskcal.measurement.reader import read_campaign

    campaign = read_campaign(path, open_limits(robot))
    with bar_by_parts("looking for what is wrong") as show:
        from taskcal.diagnosis.diagnose import diagnose  # only for what could be read: it takes a second to import

        return diagnose(campaign, robot, progress=show)


def with_first_finding(refusal: TaskcalError, path: Path, robot: "Robot") -> str:
    """A refusal's message, and what mends it if the doctor knows."""
    message = str(refusal)
    if isinstance(refusal, UnitError):  # nothing else can be told before that is mended
        return message
    try:
        findings = diagnose_file(path, robot).findings
    except TaskcalError:
        return message
    first = findings[0] if findings else None
    if first is None or first.error_before is None:  # too few rows, which the refusal says
        return message
    concerned = f" of {', '.join(first.subject[:6])}" if first.subject else ""
    then = "" if first.error_after is None else f", then {first.error_after * 1e3:.1f} mm"
    return (
        f"{message}\ntaskcal doctor finds {first.id}{concerned} ({first.error_before * 1e3:.1f} mm off{then}; "
        f"{first.confidence:.0%} sure): {first.fix}"
    )
