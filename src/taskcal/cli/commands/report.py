"""``taskcal report``: a calibration as a page."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from taskcal.cli.campaign_options import MeasuredOptions
from taskcal.cli.option_groups import grouped
from taskcal.cli.options import CalibrationArgument, OutputOptions, SeedOption
from taskcal.cli.output import show_table, tell, working, write_json
from taskcal.cli.outputs import check_outputs, files_of_task

if TYPE_CHECKING:
    from taskcal.adaptation.task_uncertainty import Uncertainty
    from taskcal.identification.calibration import Calibration
    from taskcal.identification.residual_analysis import ResidualAnalysis


@grouped
def command(
    calibration: CalibrationArgument,
    task: Annotated[
        Path | None,
        typer.Option(
            "--task", "-t", metavar="TASK.toml", readable=False, help="Show the uncertainty of the tool over this task."
        ),
    ] = None,
    *,
    measured: MeasuredOptions,
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="REPORT.html", readable=False, help="Page to write.")
    ] = Path("report.html"),
    seed: SeedOption = 0,
    out: OutputOptions,
) -> None:
    """Make a page of a calibration: parameters, residuals, outliers, uncertainty over a task, and what the residuals depend on.

    With --campaign it shows what its residuals depend on: joints, gravity, approach, order, temperature.
    """
    inputs = [calibration, *files_of_task(task), *measured.inputs]
    outputs = check_outputs("report", [("--output", output)], inputs, force=out.force)
    from taskcal.adaptation.task_uncertainty import uncertainty_over
    from taskcal.identification.calibration_file import load_calibration
    from taskcal.identification.provenance import package_version
    from taskcal.presentation.calibration_report import calibration_html
    from taskcal.task.task import load_task

    calibrated = load_calibration(calibration)
    described = None if task is None else load_task(task)
    with working("uncertainty, then the page"):
        uncertainty = None if described is None else uncertainty_over(calibrated, described, seed)
        remainder = _examine(calibrated, measured, seed)
        page = calibration_html(calibrated, uncertainty, version=package_version(), remainder=remainder)
        outputs.write({output: page})
    if out.as_json:
        write_json(_result(output, calibrated, uncertainty, remainder))
        return
    if uncertainty is not None:
        tell(
            f"over '{uncertainty.task}', standard deviation in space, rms: target {uncertainty.target * 1e3:.4f} mm; tool "
            f"{uncertainty.after * 1e3:.4f} mm, {uncertainty.before * 1e3:.4f} mm by the tolerances alone"
        )
    if remainder is not None:
        show_remainder(remainder)
    tell(f"wrote {output}")


def _result(
    output: Path, calibration: "Calibration", uncertainty: "Uncertainty | None", remainder: "ResidualAnalysis | None"
) -> dict[str, Any]:
    result: dict[str, Any] = {
        "report": output,
        "robot": calibration.model.robot.name,
        "rows": len(calibration.residuals),
        "outliers": len(calibration.outliers),
    }
    if uncertainty is not None:
        result |= {
            "task": uncertainty.task,
            "before_mm": uncertainty.before * 1e3,
            "after_mm": uncertainty.after * 1e3,
            "target_mm": uncertainty.target * 1e3,
        }
    if remainder is not None:
        result["remainder"] = remainder.summary()
    return result


def show_remainder(remainder: "ResidualAnalysis") -> None:
    """Print what the remainder goes with, as far as chance does not give as much."""
    rows = [
        (e.regressor.name, e.regressor.moves, f"{100 * e.share:.1f}", f"{e.p_value:.2g}")
        for e in remainder.explained
        if e.p_value is not None and e.p_value <= 0.05
    ]
    size = f"{remainder.rms * 1e3:.4f} mm (rms in space; {remainder.tracker * 1e3:.4f} mm by the tracker alone)"
    title = f"What the residuals, {size}, depend on"
    if rows:
        show_table(title, ("quantity", "moves", "share % of variance", "p"), rows, left=(0, 1))
    else:
        tell(f"{title}: nothing that was tried")


def _examine(calibration: "Calibration", measured: MeasuredOptions, seed: int) -> "ResidualAnalysis | None":
    """What the residuals on the campaign go with; None where there is none.

    Raises:
        FileError: the campaign has other targets or too few poses.
    """
    if measured.campaign is None:
        return None
    from taskcal.errors import CampaignError, FileError
    from taskcal.identification.residual_analysis import analyse_residuals

    targets = None if calibration.targets == ("tool",) else calibration.targets
    campaign = measured.read(measured.campaign, calibration.model.robot, targets=targets).campaign
    try:
        return analyse_residuals(calibration, campaign, seed=seed)
    except CampaignError as error:
        raise FileError(measured.campaign, str(error)) from error
