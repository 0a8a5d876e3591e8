"""``taskcal validate``: how well a calibration predicts another campaign."""

from typing import TYPE_CHECKING, Annotated

import typer

from taskcal.cli.campaign_options import CampaignOptions
from taskcal.cli.option_groups import grouped
from taskcal.cli.options import CalibrationArgument, CampaignArgument, JsonOption
from taskcal.cli.output import info, write_json

if TYPE_CHECKING:
    from taskcal.identification.calibration import Calibration
    from taskcal.measurement.campaign import Campaign


@grouped
def command(
    calibration: CalibrationArgument,
    campaign: CampaignArgument,
    reregister: Annotated[
        bool,
        typer.Option(
            "--reregister", help="Refit tracker frame and targets to this campaign, with the robot's geometry frozen."
        ),
    ] = False,
    *,
    reading: CampaignOptions,
    as_json: JsonOption = False,
) -> None:
    """Compare a campaign with a calibration's predictions."""
    from taskcal.cli.errors_table import show_errors
    from taskcal.identification.calibration_file import load_calibration
    from taskcal.identification.validation import validate

    calibrated = load_calibration(calibration)
    measured = reading.read(campaign, calibrated.model.robot).campaign
    if reading.targets is None and not reregister:
        measured = _shared_targets(measured, calibrated)
    validation = validate(calibrated, measured, reregister=reregister)
    for remark in validation.remarks:
        info(remark)
    result = validation.summary()
    if as_json:
        write_json(result)
    else:
        frames = "tracker frame and targets refitted" if reregister else "frames of the calibration"
        show_errors(f"Position error of {calibrated.model.robot.name} on {campaign} ({frames})", {"predicted": result})


def _shared_targets(measured: "Campaign", calibration: "Calibration") -> "Campaign":
    """The campaign without targets that the calibration does not know, where it knows others of it."""
    shared = [name for name in measured.targets if name in calibration.targets]
    if not shared or len(shared) == len(measured.targets):
        return measured
    left_out = ", ".join(name for name in measured.targets if name not in shared)
    info(f"leaving out {left_out}: the calibration knows {', '.join(calibration.targets)}")
    return measured.of_targets(shared)
