"""``taskcal report``: a calibration as a page."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import taskcal
from taskcal.cli.command import option
from taskcal.cli.options.campaign import MeasuredOptions
from taskcal.cli.options.common import CalibrationArgument, SeedOption, UnsealedOption, read_calibration
from taskcal.cli.options.page import PageOptions
from taskcal.cli.output import files_of_task, info, show, show_facts, tell
from taskcal.cli.progress import bar_over
from taskcal.report.content import Column, Table

if TYPE_CHECKING:
    from taskcal.correction.verdict import Verdict
    from taskcal.planning.selection import Rung
    from taskcal.planning.task_map import Uncertainty


OVER_TASK, DEPENDING = "uncertainty over the task", "residual analysis"
CLIMBING = "error reduction by model stage"
PAGE = "figures and tables"

MAX_P_VALUE = 0.05
"""Probability that chance explains as much, up to which a quantity is listed."""


ON_CERTIFICATE = ("serial_number", "place", "date", "operator", "instrument", "temperature_C")
"""Fields of the head that a certificate has in any case."""


@dataclass(frozen=True, kw_only=True)
class ReportOptions(PageOptions):
    """The page and how the result is given."""

    named = "--output"
    report: Path | None = option(Path("report.html"), "REPORT.html", "Output: the page.", named="--output", also="-o")
    certificate: Path | None = option(
        None, "CERT.html", "Output: a certificate of one page, to be signed; fields that --header leaves out are blank."
    )
    seed: SeedOption = 0


def command(
    *,
    calibration: CalibrationArgument,
    unsealed: UnsealedOption = False,
    task: Path | None = option(
        None, "TASK.toml", "Judge the expected error over this task; show the TCP uncertainty.", also="-t"
    ),
    measured: MeasuredOptions,
    out: ReportOptions,
) -> None:
    """Write an HTML report of a calibration.

    The verdict, the robot in space with its errors before and after, residuals at each pose, the uncertainty of predictions, the
    parameters with their intervals and status, outliers, and provenance. With --task, the TCP uncertainty over a task; with
    --campaign, residual analysis and the error reduction by model stage.
    """
    outputs = out.begin(
        "report", [("--certificate", out.certificate)], [calibration, *files_of_task(task), *measured.inputs]
    )

    calibrated = read_calibration(calibration, unsealed=unsealed)
    described = None if task is None else taskcal.load_task(task)
    from taskcal.correction.verdict import judge  # after the files were read: figures take a while
    from taskcal.planning.task_map import uncertainty_over
    from taskcal.report.calibration import calibration_page
    from taskcal.report.verdict import BLANK, certificate_page, next_step, tabulate_verdict

    steps = [OVER_TASK] * (described is not None) + [DEPENDING, CLIMBING] * (measured.campaign is not None)
    with bar_over([*steps, PAGE]) as begin:
        uncertainty = verdict = None
        if described is not None:
            begin(OVER_TASK)
            uncertainty = uncertainty_over(calibrated, described, out.seed)
            verdict = judge(calibrated, described, seed=out.seed)
        campaign = _read(calibrated, measured)
        remainder, rungs = _examine(calibrated, measured, campaign, out.seed, begin)
        begin(PAGE)
        space = None if described is None else described.workspace
        signed: dict[Path, str | bytes] = {}
        if out.certificate is not None:
            signed[out.certificate] = out.headed(certificate_page(calibrated, verdict), ON_CERTIFICATE, BLANK).html()
        files = out.write(
            outputs,
            signed,
            lambda: calibration_page(
                calibrated,
                judged=verdict,
                over=uncertainty,
                space=space,
                campaign=campaign,
                images=measured.images if measured.images is not None and measured.images.is_dir() else None,
                remainder=remainder,
                rungs=rungs,
            ),
        )

    def show_all() -> None:
        if verdict is not None:
            judged = tabulate_verdict(verdict)
            show(judged)
            tell(judged.note)
        if uncertainty is not None:
            tell(
                f"over '{uncertainty.task}', 3D rms standard uncertainty: target {uncertainty.target * 1e3:.3f} mm; TCP "
                f"{uncertainty.after * 1e3:.3f} mm, {uncertainty.before * 1e3:.3f} mm from the tolerances alone"
            )
        if remainder is not None:
            show_remainder(remainder)
        if verdict is not None:
            show_facts([("next", next_step(verdict))])
        tell(f"wrote {out.in_words([*signed, *files])}")

    out.give(_result(calibrated, verdict, uncertainty, remainder), show_all)


def _result(
    calibration: "taskcal.Calibration",
    verdict: "Verdict | None",
    uncertainty: "Uncertainty | None",
    remainder: "taskcal.identification.ResidualAnalysis | None",
) -> dict[str, Any]:
    result: dict[str, Any] = {
        "robot": calibration.model.robot.name,
        "rows": len(calibration.residuals),
        "outliers": len(calibration.outliers),
    }
    if verdict is not None:
        result["verdict"] = verdict.summary()
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


EXPLAINED = (
    Column("quantity", lambda e: e.regressor.name),
    Column("moves", lambda e: e.regressor.moves),
    Column("share % of variance", lambda e: 100 * e.share, ".1f"),
    Column("p", "p_value", ".2g"),
)


def show_remainder(remainder: "taskcal.identification.ResidualAnalysis") -> None:
    """Print the quantities that the residuals depend on significantly."""
    rows = [e for e in remainder.explained if e.p_value is not None and e.p_value <= MAX_P_VALUE]
    size = f"3D rms {remainder.rms * 1e3:.3f} mm, tracker noise {remainder.tracker * 1e3:.3f} mm"
    title = f"Residual variance explained, by quantity ({size})"
    if rows:
        show(Table.of(title, EXPLAINED, rows))
    else:
        tell(f"{title}: not significant for any quantity")


def _read(calibration: "taskcal.Calibration", measured: MeasuredOptions) -> "taskcal.Campaign | None":
    """The campaign; None where none was named."""
    if measured.campaign is None:
        return None
    targets = None if calibration.targets == ("tool",) else calibration.targets
    return measured.read(measured.campaign, calibration.model.robot, targets=targets).campaign


def _examine(
    calibration: "taskcal.Calibration",
    measured: MeasuredOptions,
    campaign: "taskcal.Campaign | None",
    seed: int,
    begin: Callable[[str], None],
) -> tuple["taskcal.identification.ResidualAnalysis | None", "Sequence[Rung]"]:
    """Residual analysis on the campaign, and the error there by model stage; nothing without a campaign, or of few images.

    Raises:
        FileError: the campaign has other targets or too few poses.
    """
    if measured.campaign is None or campaign is None:
        return None, ()
    from taskcal.errors import CampaignError, FileError
    from taskcal.identification.residual_analysis import MIN_POSES
    from taskcal.planning.selection import climb

    seen = int(campaign.valid.any(axis=1).sum())
    if seen < MIN_POSES and any(kind.pictured for kind in campaign.observations):
        info(f"{seen} images: their corners are shown; the analysis of residuals takes {MIN_POSES} or more")
        return None, ()
    try:
        begin(DEPENDING)
        remainder = taskcal.identification.analyse_residuals(calibration, campaign, seed=seed)
        begin(CLIMBING)
        return remainder, climb(calibration, campaign, seed=seed)
    except CampaignError as error:
        raise FileError(measured.campaign, str(error)) from error
