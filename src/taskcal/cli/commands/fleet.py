"""``taskcal fleet``: many robots in one table."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import typer

import taskcal
from taskcal.cli.command import argument, option, output_option
from taskcal.cli.options.common import EngineOptions, UnsealedOption, accuracy_option, robot_option
from taskcal.cli.output import info
from taskcal.cli.progress import bar_by_parts
from taskcal.cli.run import File, OutputOptions, Result, count_as_written
from taskcal.tables.frame import csv_of

if TYPE_CHECKING:
    import taskcal.report.fleet

MAX_NAMED = 20
"""Files that are named on standard error."""


@dataclass(frozen=True, kw_only=True)
class IdentifyOptions:
    """Identification of campaigns without a calibration.

    Raises:
        typer.BadParameter: one option without the other.
    """

    identify: bool = option(
        False, help="Identify campaigns without a calibration: march.csv gives march.json beside it."
    )
    robot: str | None = robot_option("With --identify: the nominal robot of these campaigns.")
    folds: int = option(5, "K", "With --identify: parts held out in turn, and predicted.", low=2)

    def __post_init__(self) -> None:
        if self.identify and self.robot is None:
            raise typer.BadParameter(
                "--identify needs --robot: the nominal model of these campaigns", param_hint="--identify / --robot"
            )
        if self.robot is not None and not self.identify:
            raise typer.BadParameter("--robot requires --identify: calibrations name their robot", param_hint="--robot")


def command(
    *,
    robots: Path = argument(
        ..., "ROBOTS/", "Folder with one folder (or file) per robot, which has its calibrations and campaigns."
    ),
    identifying: IdentifyOptions,
    accuracy_mm: float | None = accuracy_option(
        "Required accuracy, 3D rms: exit status 1 if a robot's latest held-out error exceeds it."
    ),
    output: Path | None = output_option(None, "FLEET.csv", "Output CSV: a row per calibration."),
    unsealed: UnsealedOption = False,
    running: EngineOptions,
    out: OutputOptions,
) -> Result:
    """Monitor a fleet: latest calibrations, changes and outliers.

    Unreadable files are listed and left out; the exit status is 1 then.
    """
    refused = _identify(robots, identifying, running) if identifying.identify else []

    with bar_by_parts("robots") as bar:
        fleet = taskcal.planning.review_fleet(
            robots,
            engine=running.engine_name,
            workers=running.max_workers,
            unsealed=unsealed,
            progress=lambda done, total: bar("robots", done, max(total, 1)),
        )
    beyond = [] if accuracy_mm is None else list(fleet.beyond(accuracy_mm * 1e-3))
    left_out = [*refused, *fleet.skipped]
    _tell_of(fleet, left_out)
    result = fleet.summary() | {
        "skipped": [{"file": name, "reason": reason} for name, reason in left_out],
        "accuracy_mm": accuracy_mm,
        "beyond": beyond,
        **({} if output is None else {"rows": output}),
    }
    return Result(
        summary=result,
        sections=lambda: [taskcal.report.fleet.fleet_section(fleet, accuracy_mm, beyond)],
        files=[File("table", output, csv_of(fleet.calibrations))],
        failed=bool(left_out or beyond),
    )


def _identify(folder: Path, options: IdentifyOptions, running: EngineOptions) -> list[tuple[str, str]]:
    """Identify campaigns; returns those that could not be, and why."""
    assert options.robot is not None
    files = taskcal.planning.find_fleet(folder)
    total = len(files.unidentified)
    refused: list[tuple[str, str]] = []
    if total == 0:
        info("--identify: every campaign has a calibration beside it")
        return refused
    model = taskcal.ErrorModel(taskcal.load_robot(options.robot))
    with bar_by_parts("campaigns") as bar:
        bar("campaigns", 0, total)
        identified = taskcal.planning.identify_campaigns(
            files, model, folds=options.folds, engine=running.engine_name, workers=running.max_workers
        )
        for done, one in enumerate(identified, start=1):
            if one.refusal is None:
                count_as_written(folder / one.calibration)
            else:
                refused.append((one.campaign, one.refusal))
            bar("campaigns", done, total)
    info(f"identified {total - len(refused)} of {total} campaigns")
    return sorted(refused)


def _tell_of(fleet: "taskcal.planning.Fleet", left_out: list[tuple[str, str]]) -> None:
    """List each file that was left out, once, and files that were not read."""
    for _, reason in left_out[:MAX_NAMED]:
        info(f"left out: {reason}")
    if len(left_out) > MAX_NAMED:
        info(f"and {len(left_out) - MAX_NAMED} more files were left out: see --json")
    refused = {name for name, _ in left_out}
    waiting = [name for name in fleet.unidentified if name not in refused]
    if waiting:
        info(f"{len(waiting)} campaigns without a calibration, such as {waiting[0]}: --identify --robot ROBOT")
    if fleet.others:
        info(f"{len(fleet.others)} files are neither calibration nor campaign, such as {fleet.others[0]}")
    for remark in fleet.remarks:
        info(remark)
