"""``taskcal report``: a calibration as a page."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from taskcal.cli.options.campaign import MeasuredOptions
from taskcal.cli.options.common import CalibrationArgument, OutputOptions, SeedOption
from taskcal.cli.options.page import BesidePageOptions
from taskcal.cli.output import check_outputs, files_of_task, show_table, tell, write_json
from taskcal.cli.progress import bar_over

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from taskcal.identification.calibration import Calibration
    from taskcal.identification.residual_analysis import ResidualAnalysis
    from taskcal.planning.selection import Rung
    from taskcal.planning.task_map import Uncertainty


OVER_TASK, DEPENDING = "uncertainty over the task", "what the residuals depend on"
CLIMBING = "what each part of the model is worth"
PAGE, WRITING = "figures and tables", "writing them"


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
    beside: BesidePageOptions,
    seed: SeedOption = 0,
    out: OutputOptions,
) -> None:
    """Write an HTML report of a calibration.

    The verdict, the robot in space with its errors before and after, what is left at each pose, the uncertainty of what is
    predicted, the parameters with their intervals and why they were kept, outliers, and where it all comes from. With
    --task, how well the tool is known over a task; with --campaign, what the residuals depend on and what each part of the
    model is worth.
    """
    inputs = [calibration, *files_of_task(task), *measured.inputs, beside.header]
    places = [("--output", output), ("--markdown", beside.markdown)]
    outputs = check_outputs("report", places, inputs, force=out.force)
    beside.kind()
    header = beside.labelled()
    from taskcal.identification.calibration import load_calibration
    from taskcal.task.task import load_task

    calibrated = load_calibration(calibration)
    described = None if task is None else load_task(task)
    from taskcal.identification.provenance import package_version
    from taskcal.planning.task_map import uncertainty_over  # after the files were read: figures take a while
    from taskcal.report.calibration import Beside, calibration_page

    steps = [OVER_TASK] * (described is not None) + [DEPENDING, CLIMBING] * (measured.campaign is not None)
    with bar_over([*steps, PAGE, WRITING]) as begin:
        uncertainty = None
        if described is not None:
            begin(OVER_TASK)
            uncertainty = uncertainty_over(calibrated, described, seed)
        remainder, rungs = _examine(calibrated, measured, seed, begin)
        begin(PAGE)
        shown = Beside(
            over=uncertainty,
            space=None if described is None else described.workspace,
            remainder=remainder,
            rungs=rungs,
            header=header,
        )
        page = calibration_page(calibrated, shown, version=package_version())
        begin(WRITING)
        files = {output: page.html(), **beside.files_of(page)}
        outputs.write(files)
    if out.as_json:
        write_json(_result(output, calibrated, uncertainty, remainder))
        return
    if uncertainty is not None:
        tell(
            f"over '{uncertainty.task}', standard deviation in space, rms: target {uncertainty.target * 1e3:.3f} mm; tool "
            f"{uncertainty.after * 1e3:.3f} mm, {uncertainty.before * 1e3:.3f} mm by the tolerances alone"
        )
    if remainder is not None:
        show_remainder(remainder)
    tell(f"wrote {beside.in_words(files)}")


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
    size = f"{remainder.rms * 1e3:.3f} mm (rms in space; {remainder.tracker * 1e3:.3f} mm by the tracker alone)"
    title = f"What the residuals, {size}, depend on"
    if rows:
        show_table(title, ("quantity", "moves", "share % of variance", "p"), rows, left=(0, 1))
    else:
        tell(f"{title}: nothing that was tried")


def _examine(
    calibration: "Calibration", measured: MeasuredOptions, seed: int, begin: "Callable[[str], None]"
) -> tuple["ResidualAnalysis | None", "Sequence[Rung]"]:
    """What the residuals on the campaign go with, and what each part of the model is worth there; nothing without a campaign.

    Raises:
        FileError: the campaign has other targets or too few poses.
    """
    if measured.campaign is None:
        return None, ()
    from taskcal.errors import CampaignError, FileError
    from taskcal.identification.residual_analysis import analyse_residuals
    from taskcal.planning.selection import climb

    targets = None if calibration.targets == ("tool",) else calibration.targets
    campaign = measured.read(measured.campaign, calibration.model.robot, targets=targets).campaign
    try:
        begin(DEPENDING)
        remainder = analyse_residuals(calibration, campaign, seed=seed)
        begin(CLIMBING)
        return remainder, climb(calibration, campaign, seed=seed)
    except CampaignError as error:
        raise FileError(measured.campaign, str(error)) from error
