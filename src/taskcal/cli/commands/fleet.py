"""``taskcal fleet``: many robots in one table."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import typer

import taskcal
from taskcal.cli.command import argument, option
from taskcal.cli.options.common import EngineOptions, OutputOptions, UnsealedOption, above_zero
from taskcal.cli.output import count_as_written, info, show, show_facts, tell
from taskcal.cli.progress import bar_by_parts
from taskcal.tables.frame import csv_of

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
    robot: str | None = option(None, "ROBOT", "With --identify: the nominal robot of these campaigns.", also="-r")
    folds: int = option(5, "K", "With --identify: parts held out in turn, and predicted.", min=2)

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
    accuracy_mm: float | None = option(
        None,
        "MM",
        "Required accuracy: exit status 1 if a robot's latest held-out error exceeds it.",
        callback=above_zero,
    ),
    output: Path | None = option(None, "TABLE.csv", "Output CSV: a row per calibration.", also="-o"),
    unsealed: UnsealedOption = False,
    running: EngineOptions,
    out: OutputOptions,
) -> None:
    """Monitor a fleet: latest calibrations, changes and outliers.

    Unreadable files are listed and left out; the exit status is 1 then.
    """
    outputs = out.begin("fleet", [("--output", output)], [robots])
    refused = _identify(robots, identifying, running) if identifying.identify else []

    with bar_by_parts("robots") as bar:
        fleet = taskcal.planning.review_fleet(
            robots,
            engine=running.engine_name,
            workers=running.max_workers,
            unsealed=unsealed,
            progress=lambda done, total: bar("robots", done, max(total, 1)),
        )
    if output is not None:
        outputs.write({output: csv_of(fleet.calibrations)})
    beyond = [] if accuracy_mm is None else list(fleet.beyond(accuracy_mm * 1e-3))
    left_out = [*refused, *fleet.skipped]
    _tell_of(fleet, left_out)
    result = fleet.summary() | {
        "skipped": [{"file": name, "reason": reason} for name, reason in left_out],
        "accuracy_mm": accuracy_mm,
        "beyond": beyond,
        **({} if output is None else {"rows": output}),
    }
    out.give(result, lambda: _show(fleet, result))
    if left_out or beyond:
        raise typer.Exit(1)


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


def _show(fleet: "taskcal.planning.Fleet", result: Mapping[str, Any]) -> None:
    from taskcal.report import fleet as tables

    table = tables.tabulate_fleet(fleet)
    show(table, spare=tables.SPARE)
    changes, outliers = tables.tabulate_fleet_changes(fleet), tables.tabulate_outliers_of_fleet(fleet)
    for one in (changes, outliers):
        if len(one):
            show(one)
    facts = [("fleet", f"{len(fleet.robots)} robots, {len(fleet.calibrations)} calibrations")]
    if not len(changes):
        facts.append(("changed", "none" if fleet.changes else "no robot has two calibrations"))
    facts.append(("alarms", tables.describe_level(fleet)))
    if result["accuracy_mm"] is not None:
        beyond = ", ".join(result["beyond"][:MAX_NAMED]) or "none"
        facts.append((f"above {result['accuracy_mm']:g} mm", f"latest held-out mean error: {beyond}"))
    if "rows" in result:
        facts.append(("table", f"wrote {result['rows']}"))
    show_facts(facts)
    tell()
