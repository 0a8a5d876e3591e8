"""``taskcal report``: a calibration as a page."""

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

import taskcal
from taskcal.cli.command import option, output_option
from taskcal.cli.options.campaign import MeasuredOptions
from taskcal.cli.options.common import CalibrationArgument, UnsealedOption, look_at, read_calibration, task_option
from taskcal.cli.options.page import PageOptions
from taskcal.cli.output import info
from taskcal.cli.run import File, Result, Run
from taskcal_groundwork.options import Seed

if TYPE_CHECKING:
    from taskcal.planning.selection import Rung
    from taskcal.planning.task_map import TaskUncertainty
    from taskcal.report.content import Section
    from taskcal.report.page import Report


OVER_TASK, DEPENDING = "uncertainty over the task", "residual analysis"
CLIMBING = "error reduction by model stage"

ON_CERTIFICATE = ("number", "serial_number", "place", "date", "operator", "instrument", "temperature_C")
"""Fields of the head that a certificate has in any case."""


@dataclass(frozen=True, kw_only=True)
class ReportOptions(PageOptions):
    """The page and how the result is given."""

    report: Path | None = output_option(Path("report.html"), "REPORT.html", "Output: the page.", named="output")
    certificate: Path | None = option(
        None,
        "CERT.html",
        "Output: a certificate of one page, to be signed; fields that --header leaves out are blank. As CERT.pdf it is printed by "
        "Chromium, Chrome or Edge.",
        writes="new",
    )
    seed: Seed = 0

    @property
    def is_printed(self) -> bool:
        """Whether the certificate is a PDF."""
        return self.certificate is not None and self.certificate.suffix.lower() == ".pdf"

    def check(self) -> None:
        """Check what the page and the certificate need beside their files.

        Raises:
            FileError: as of the page's.
            TaskcalError: something is to be printed, and there is no browser.
        """
        super().check()
        if self.is_printed:
            from taskcal.report.page import find_browser

            find_browser()


def command(
    *,
    run: Run,
    calibration: CalibrationArgument,
    unsealed: UnsealedOption = False,
    task: Path | None = task_option("Judge the expected error over this task; show the TCP uncertainty."),
    corrected: Path | None = option(
        None,
        "RESULT.json",
        "Output of taskcal correct --json with the same calibration and task: its program is judged, too.",
        callback=look_at,
    ),
    measured: MeasuredOptions,
    out: ReportOptions,
) -> Result:
    """Write an HTML report of a calibration.

    The verdict, the robot in space with its errors before and after, residuals at each pose, the uncertainty of predictions, the
    parameters with their intervals and status, outliers, and provenance. With --task, the TCP uncertainty over a task; with
    --campaign, residual analysis and the error reduction by model stage.
    """
    if corrected is not None and task is None:
        raise typer.BadParameter(
            "requires --task, the one for which the program was corrected", param_hint="--corrected"
        )
    calibrated = read_calibration(calibration, unsealed=unsealed)
    described = None if task is None else taskcal.load_task(task)
    from taskcal.correction.verdict import judge  # after the files were read: it takes a while
    from taskcal.planning.task_map import uncertainty_over

    steps = [OVER_TASK] * (described is not None) + [DEPENDING, CLIMBING] * (measured.campaign is not None)
    begin = run.bar(steps)
    uncertainty = verdict = None
    written: Sequence[Path] = ()
    if described is not None:
        begin(OVER_TASK)
        uncertainty = uncertainty_over(calibrated, described, out.seed)
        verdict = judge(calibrated, described, seed=out.seed).summary()
        if corrected is not None:
            verdict, written = _with_program(verdict, corrected)
    campaign = _read(calibrated, measured)
    remainder, rungs = _examine(calibrated, measured, campaign, out.seed, begin)

    def sections() -> "list[Section]":
        from taskcal.report.calibration import residual_analysis_section, task_uncertainty_section
        from taskcal.report.verdict import verdict_section

        made = [] if verdict is None else [verdict_section(verdict)]
        made += [] if uncertainty is None else [task_uncertainty_section(uncertainty)]
        return made if remainder is None else [*made, residual_analysis_section(remainder)]

    def make() -> "Report":
        from taskcal.report.calibration import calibration_page, calibration_sections
        from taskcal.report.verdict import verdict_section

        told = calibration_sections(
            calibrated,
            judged=verdict,
            over=uncertainty,
            space=None if described is None else described.workspace,
            campaign=campaign,
            images=measured.image_folder,
            remainder=remainder,
            rungs=rungs,
        )
        return calibration_page(calibrated, told if verdict is None else [verdict_section(verdict), *told])

    signed: str | bytes = ""
    if out.certificate is not None:
        from taskcal.report.certificate import BLANK, certificate_page
        from taskcal.report.page import print_page

        page = certificate_page(calibrated, verdict, described, _digests([calibration, *written]))
        page = out.headed(page, ON_CERTIFICATE, BLANK)
        signed = print_page(page) if out.is_printed else page.html()
    return Result(
        summary=_result(calibrated, verdict, uncertainty, remainder),
        sections=sections,
        files=[File("certificate", out.certificate, signed)],
        page=make,
    )


def _digests(files: Sequence[Path]) -> Mapping[str, str]:
    """SHA-256 of files, by their names; empty for one that is no longer where it was written."""
    import hashlib

    return {file.name: hashlib.sha256(file.read_bytes()).hexdigest() if file.is_file() else "" for file in files}


def _with_program(verdict: Mapping[str, Any], corrected: Path) -> tuple[Mapping[str, Any], Sequence[Path]]:
    """The verdict of a correction, and the files that it wrote.

    Raises:
        FileError: it is of another calibration or another task.
    """
    from taskcal.errors import FileError
    from taskcal.io.json_file import parse_json
    from taskcal.io.text_file import read_text
    from taskcal.report.verdict import with_program

    result = None
    with suppress(ValueError, RecursionError):  # what is no JSON is no result either
        result = parse_json(read_text(corrected), corrected)
    found = with_program(verdict, result)
    if found is None or result is None:
        raise FileError(
            corrected,
            "is not of a program that was corrected by this calibration for this task; correct it again: taskcal correct --task "
            "… --json",
        )
    return found, [Path(file) for file in result["written"]]


def _result(
    calibration: "taskcal.Calibration",
    verdict: Mapping[str, Any] | None,
    uncertainty: "TaskUncertainty | None",
    remainder: "taskcal.identification.ResidualAnalysis | None",
) -> dict[str, Any]:
    result: dict[str, Any] = {
        "robot": calibration.model.robot.name,
        "rows": len(calibration.residuals),
        "outliers": len(calibration.outliers),
    }
    if verdict is not None:
        result["verdict"] = verdict
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
