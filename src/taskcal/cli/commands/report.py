"""``taskcal report``: a calibration as a page."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from taskcal.cli.drift import DriftChoice, DriftOption, compensate
from taskcal.cli.options import ForceOption, JsonOption, SeedOption
from taskcal.cli.output import announce_compilation, tell, working, write_json
from taskcal.cli.outputs import check_outputs, files_of_task

if TYPE_CHECKING:
    from taskcal.identification.calibration import Calibration
    from taskcal.identification.residual_analysis import ResidualAnalysis


def command(
    calibration: Annotated[
        Path, typer.Argument(metavar="CAL.json", readable=False, help="Calibration written by taskcal identify.")
    ],
    task: Annotated[
        Path | None,
        typer.Option(
            "--task", "-t", metavar="TASK.toml", readable=False, help="Show the uncertainty of the tool over this task."
        ),
    ] = None,
    campaign: Annotated[
        Path | None,
        typer.Option(
            "--campaign",
            metavar="CAMPAIGN.csv",
            readable=False,
            help="Show what the residuals on this campaign go with: joints, gravity, approach, order, temperature.",
        ),
    ] = None,
    drift: DriftOption = DriftChoice.follow,
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="REPORT.html", readable=False, help="Page to write.")
    ] = Path("report.html"),
    seed: SeedOption = 0,
    force: ForceOption = False,
    as_json: JsonOption = False,
) -> None:
    """Make a page of a calibration: parameters, residuals, outliers, uncertainty over a task, what the remainder goes with."""
    read = [calibration, *files_of_task(task), campaign]
    outputs = check_outputs("report", [("--output", output)], read, force=force)
    from taskcal.adaptation.task_uncertainty import uncertainty_over
    from taskcal.identification.calibration_file import load_calibration
    from taskcal.identification.provenance import package_version
    from taskcal.presentation.calibration_report import calibration_html
    from taskcal.task.task import load_task

    known = load_calibration(calibration)
    asked = None if task is None else load_task(task)
    announce_compilation()
    with working("uncertainty and page"):
        over = None if asked is None else uncertainty_over(known, asked, seed)
        left = None if campaign is None else _examine(known, campaign, drift, seed)
        outputs.write({output: calibration_html(known, over, version=package_version(), remainder=left)})
    result: dict[str, Any] = {"report": output, "robot": known.model.robot.name, "rows": len(known.residuals)}
    result["outliers"] = len(known.outliers)
    if over is not None:
        result |= {
            "task": over.task,
            "before_mm": over.before * 1e3,
            "after_mm": over.after * 1e3,
            "target_mm": over.target * 1e3,
        }
    if left is not None:
        result["remainder"] = left.to_json()
    if as_json:
        write_json(result)
        return
    if over is not None:
        tell(
            f"over '{over.task}', standard deviation in space, rms: target {over.target * 1e3:.4f} mm; tool "
            f"{over.after * 1e3:.4f} mm, {over.before * 1e3:.4f} mm by the tolerances alone"
        )
    if left is not None:
        show_remainder(left)
    tell(f"wrote {output}")


def show_remainder(left: "ResidualAnalysis") -> None:
    """Print what the remainder goes with, as far as chance does not give as much."""
    from taskcal.cli.output import show_table

    rows = [
        (e.regressor.name, e.regressor.moves, f"{100 * e.share:.1f}", f"{e.p_value:.2g}")
        for e in left.explained
        if e.p_value is not None and e.p_value <= 0.05
    ]
    size = f"{left.rms * 1e3:.4f} mm (rms in space; {left.tracker * 1e3:.4f} mm by the tracker alone)"
    title = f"What the remainder of {size} goes with"
    if rows:
        show_table(title, ("quantity", "moves", "share % of variance", "p"), rows, left=(0, 1))
    else:
        tell(f"{title}: nothing that was tried")


def _examine(calibration: "Calibration", campaign: Path, drift: DriftChoice, seed: int) -> "ResidualAnalysis":
    """What the residuals on a campaign go with.

    Raises:
        FileError: the campaign has other targets or too few poses.
    """
    from taskcal.errors import CampaignError, FileError
    from taskcal.identification.residual_analysis import analyse_residuals
    from taskcal.measurement.reader import read_campaign

    wanted = None if calibration.targets == ("tool",) else calibration.targets
    measured = read_campaign(campaign, calibration.model.robot, targets=wanted)
    measured, _ = compensate(measured, drift)
    try:
        return analyse_residuals(calibration, measured, seed=seed)
    except CampaignError as error:
        raise FileError(campaign, str(error)) from error
