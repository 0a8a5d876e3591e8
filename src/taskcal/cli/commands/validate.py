"""``taskcal validate``: how well a calibration predicts another campaign."""

from pathlib import Path
from typing import Annotated

import typer

from taskcal.cli.drift import DriftChoice, DriftOption, compensate
from taskcal.cli.options import JsonOption, ReferencePointsOption, RowsOption, TargetsOption, split_names
from taskcal.cli.output import announce_compilation, note, write_json


def command(
    calibration: Annotated[
        Path, typer.Argument(metavar="CAL.json", readable=False, help="Calibration written by taskcal identify.")
    ],
    campaign: Annotated[Path, typer.Argument(metavar="OTHER.csv", readable=False, help="Campaign to predict.")],
    reregister: Annotated[
        bool,
        typer.Option(
            "--reregister", help="Refit tracker frame and targets to this campaign, with the robot's geometry frozen."
        ),
    ] = False,
    targets: TargetsOption = None,
    reference_points: ReferencePointsOption = None,
    rows: RowsOption = None,
    drift: DriftOption = DriftChoice.follow,
    as_json: JsonOption = False,
) -> None:
    """Compare a campaign with a calibration's predictions."""
    wanted, fixed = split_names(targets, "--targets"), split_names(reference_points, "--reference-points")
    from taskcal.cli.errors_table import show_errors
    from taskcal.cli.rows import choose_rows
    from taskcal.identification.calibration_file import load_calibration
    from taskcal.identification.validation import validate
    from taskcal.measurement.reader import read_campaign

    known = load_calibration(calibration)
    measured = read_campaign(campaign, known.model.robot, targets=wanted, reference_points=fixed)
    measured, _ = compensate(measured, drift)
    if wanted is None and not reregister:
        shared = [name for name in measured.targets if name in known.targets]
        if shared and len(shared) < len(measured.targets):
            left_out = ", ".join(name for name in measured.targets if name not in shared)
            note(f"leaving out {left_out}: the calibration knows {', '.join(known.targets)}")
            measured = measured.of_targets(shared)
    if rows is not None:
        measured = measured.take(choose_rows(rows, len(measured), campaign))
    announce_compilation()
    found = validate(known, measured, reregister=reregister)
    for remark in found.remarks:
        note(remark)
    result = found.summary()
    if as_json:
        write_json(result)
    else:
        frames = "tracker frame and targets refitted" if reregister else "frames of the calibration"
        show_errors(f"Position error of {known.model.robot.name} on {campaign} ({frames})", {"predicted": result})
