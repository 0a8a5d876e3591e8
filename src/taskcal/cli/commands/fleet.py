"""``taskcal fleet``: many robots in one table."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from taskcal.cli.options.common import EngineOptions, OutputOptions, check_above_zero
from taskcal.cli.output import check_outputs, count_as_written, info, show, show_facts, show_table, tell, write_json
from taskcal.cli.progress import bar_by_parts

if TYPE_CHECKING:
    from taskcal.planning.fleet import Fleet

MOST_NAMED = 20
"""Files that are named on standard error."""


@dataclass(frozen=True, kw_only=True)
class IdentifyOptions:
    """What becomes of campaigns without a calibration.

    Raises:
        typer.BadParameter: one option without the other.
    """

    identify: Annotated[
        bool,
        typer.Option(
            "--identify",
            help="Identify campaigns that have no calibration beside them, and write it there: march.csv gives march.json.",
        ),
    ] = False
    robot: Annotated[
        str | None,
        typer.Option(
            "--robot", "-r", metavar="ROBOT", help="With --identify: the nominal robot of all these campaigns."
        ),
    ] = None
    folds: Annotated[
        int,
        typer.Option(
            "--folds", metavar="K", min=2, help="With --identify: parts that are held out in turn, and predicted."
        ),
    ] = 5

    def __post_init__(self) -> None:
        if self.identify and self.robot is None:
            raise typer.BadParameter("whose campaigns? Name the nominal robot", param_hint="--identify / --robot")
        if self.robot is not None and not self.identify:
            raise typer.BadParameter("calibrations name their robot; it goes with --identify", param_hint="--robot")


def command(
    robots: Annotated[
        Path,
        typer.Argument(
            metavar="ROBOTS/",
            readable=False,
            help="Folder with a folder for each robot, and its calibrations and campaigns in that; or with a file for each.",
        ),
    ],
    identifying: IdentifyOptions,
    accuracy_mm: Annotated[
        float | None,
        typer.Option(
            "--accuracy-mm",
            metavar="MM",
            help="Accuracy needed: a robot whose latest held-out error is beyond it makes the exit status 1.",
        ),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", metavar="TABLE.csv", readable=False, help="Write a row for each calibration."),
    ] = None,
    *,
    running: EngineOptions,
    out: OutputOptions,
) -> None:
    """Monitor a fleet: latest calibrations, changes and outliers.

    Files that cannot be read are named and left out; the exit status is 1 then.
    """
    check_above_zero(accuracy_mm, "--accuracy-mm")
    outputs = check_outputs("fleet", [("--output", output)], [robots], force=out.force)
    refused = _identify(robots, identifying, running) if identifying.identify else []
    from taskcal.planning.fleet import review_fleet

    with bar_by_parts("robots") as bar:
        fleet = review_fleet(
            robots,
            engine=running.engine_name,
            workers=running.most_workers,
            progress=lambda done, total: bar("robots", done, max(total, 1)),
        )
    if output is not None:
        outputs.write({output: fleet.to_frame().to_csv(index=False)})
    beyond = [] if accuracy_mm is None else list(fleet.beyond(accuracy_mm * 1e-3))
    left_out = [*refused, *fleet.skipped]
    _tell_of(fleet, left_out)
    result = fleet.summary() | {
        "skipped": [{"file": name, "reason": reason} for name, reason in left_out],
        "accuracy_mm": accuracy_mm,
        "beyond": beyond,
    }
    if out.as_json:
        write_json(result | ({} if output is None else {"rows": output}))
    else:
        _show(fleet, result, output)
    if left_out or beyond:
        raise typer.Exit(1)


def _identify(folder: Path, options: IdentifyOptions, running: EngineOptions) -> list[tuple[str, str]]:
    """Identify campaigns; returns those that could not be, and why."""
    from taskcal.planning.fleet import find_fleet, identify_campaigns, without_calibration
    from taskcal.robot.catalogue import load_robot
    from taskcal.robot.error_model import ErrorModel

    assert options.robot is not None
    files = find_fleet(folder)
    total = sum(len(without_calibration(robot)) for robot in files.robots)
    refused: list[tuple[str, str]] = []
    if total == 0:
        info("--identify: every campaign has a calibration beside it")
        return refused
    model = ErrorModel(load_robot(options.robot))
    with bar_by_parts("campaigns") as bar:
        bar("campaigns", 0, total)
        identified = identify_campaigns(
            files, model, folds=options.folds, engine=running.engine_name, workers=running.most_workers
        )
        for done, one in enumerate(identified, start=1):
            if one.refusal is None:
                count_as_written(folder / one.calibration)
            else:
                refused.append((one.campaign, one.refusal))
            bar("campaigns", done, total)
    info(f"identified {total - len(refused)} of {total} campaigns")
    return sorted(refused)


def _tell_of(fleet: "Fleet", left_out: list[tuple[str, str]]) -> None:
    """Each file that was left out, once, and what else was not looked at."""
    for _, reason in left_out[:MOST_NAMED]:
        info(f"left out: {reason}")
    if len(left_out) > MOST_NAMED:
        info(f"and {len(left_out) - MOST_NAMED} more files were left out: see --json")
    refused = {name for name, _ in left_out}
    waiting = [name for name in fleet.unidentified if name not in refused]
    if waiting:
        info(f"{len(waiting)} campaigns without a calibration, such as {waiting[0]}: --identify --robot ROBOT")
    if fleet.others:
        info(f"{len(fleet.others)} files that are neither calibration nor campaign, such as {fleet.others[0]}")
    for remark in fleet.remarks:
        info(remark)


def _show(fleet: "Fleet", result: Mapping[str, Any], output: Path | None) -> None:
    from taskcal.report.fleet import (
        SPARE,
        describe_level,
        tabulate_fleet,
        tabulate_fleet_changes,
        tabulate_outliers_of_fleet,
    )

    table = tabulate_fleet(fleet)
    show_table(table.title, table.header, table.rows, left=table.text_columns, spare=SPARE)
    changes, outliers = tabulate_fleet_changes(fleet), tabulate_outliers_of_fleet(fleet)
    for one in (changes, outliers):
        if len(one):
            show(one)
    facts = [("fleet", f"{len(fleet.robots)} robots, {len(fleet.calibrations)} calibrations")]
    if not len(changes):
        facts.append(("changed", "none" if fleet.changes else "no robot has two calibrations"))
    facts.append(("alarms", describe_level(fleet)))
    if result["accuracy_mm"] is not None:
        beyond = ", ".join(result["beyond"][:MOST_NAMED]) or "none"
        facts.append(("beyond", f"{result['accuracy_mm']:g} mm on rows held out: {beyond}"))
    if output is not None:
        facts.append(("table", f"wrote {output}"))
    show_facts(facts)
    tell()
