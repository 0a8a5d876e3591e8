"""``taskcal plan``: which poses to measure."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from taskcal.cli.campaign_options import MeasuredOptions
from taskcal.cli.measuring_program import MeasuringOptions
from taskcal.cli.model_options import ModelOptions
from taskcal.cli.option_groups import grouped
from taskcal.cli.options import ModelErrorOption, PageOptions, SeedOption, TaskOption, check_model_error
from taskcal.cli.output import show, show_facts, working, write_json
from taskcal.cli.outputs import check_outputs, files_of_task

if TYPE_CHECKING:
    from taskcal.adaptation.plan import Plan
    from taskcal.identification.calibration import Calibration
    from taskcal.measurement.campaign import Campaign
    from taskcal.measurement.station import Station
    from taskcal.robot.error_model import ErrorModel
    from taskcal.task.task import Task


class CriterionChoice(StrEnum):
    """What a plan is good for."""

    task = "task"
    D = "D"
    A = "A"
    E = "E"
    O1 = "O1"
    O2 = "O2"
    O3 = "O3"
    O4 = "O4"
    O5 = "O5"


@dataclass(frozen=True, kw_only=True)
class PlanOptions:
    """How the poses are chosen.

    Raises:
        typer.BadParameter: the model error is negative or not finite.
    """

    count: Annotated[int, typer.Option("--count", "-n", min=1, metavar="N", help="Poses to measure.")] = 60
    seed: SeedOption = 0
    station: Annotated[
        Path | None,
        typer.Option(
            "--station",
            metavar="STATION.toml",
            readable=False,
            help="Tracker, reflectors and obstacles; without it one reflector at the tool point is always seen.",
        ),
    ] = None
    criterion: Annotated[
        CriterionChoice,
        typer.Option("--criterion", help="The expected error over the task, or one of the classical criteria."),
    ] = CriterionChoice.task
    candidates: Annotated[int, typer.Option("--candidates", min=1, metavar="N", help="Poses to choose among.")] = 10_000
    model_error_mm: ModelErrorOption = None

    def __post_init__(self) -> None:
        check_model_error(self.model_error_mm)


@dataclass(frozen=True, eq=False, kw_only=True)
class Setting:
    """What a plan is chosen from, read."""

    model: "ErrorModel"
    calibration: "Calibration | None"
    task: "Task"
    station: "Station | None"
    campaign: "Campaign | None"

    @property
    def measured(self) -> int:
        """Rows that are there already."""
        if self.campaign is not None:
            return len(self.campaign)
        return 0 if self.calibration is None else len(self.calibration.ids)


@grouped
def command(
    task: TaskOption,
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="PLAN.csv", readable=False, help="Joint positions to measure.")
    ],
    of: ModelOptions,
    measured: MeasuredOptions,
    choice: PlanOptions,
    programs: MeasuringOptions,
    page: PageOptions,
) -> None:
    """Choose the poses whose measurement makes a robot accurate over a task.

    They are reached, clear of the robot itself and of obstacles, seen by the tracker,
    and stand in the order in which to visit them.

    With --calibration they are chosen for what the calibration still leaves uncertain, with --campaign for what they
    add to those that were measured already.
    """
    _check_sources(of, measured, choice)
    outputs = check_outputs(
        "plan",
        [("--output", output), ("--report", page.report), *(("--program", path) for path in programs.paths)],
        [of.robot, of.calibration, *files_of_task(task), choice.station, *measured.inputs],
        force=page.force,
    )
    from taskcal.measurement.writer import joints_text

    setting = _read(task, of, measured, choice)
    robot = setting.model.robot
    programs.check(robot)
    steps = 5 + (page.report is not None)  # candidates, choice, exchange, two rounds of refinement, page
    with working("candidates", steps) as say:
        chosen = _plan(setting, choice, measured.campaign or of.calibration, say)
        contents: dict[Path, str | bytes] = {output: joints_text(chosen.q, robot)}
        for source in programs.compose(robot, chosen.q):
            contents[source.path] = source.encode()
        if page.report is not None:
            say("page")
            contents[page.report] = _page(setting, chosen, choice.seed)
        outputs.write(contents)
    result = {"plan": output, "robot": robot.name, **chosen.summary(), **_visible(chosen, setting.station)}
    result["measured_before"] = setting.measured
    if of.calibration is not None:
        result["calibration"] = of.calibration
    if programs.paths:
        result["programs"] = [str(path) for path in programs.paths]
    if page.report is not None:
        result["report"] = page.report
    if page.as_json:
        write_json(result)
    else:
        _show(result, chosen, setting.task)


def _check_sources(of: ModelOptions, measured: MeasuredOptions, choice: PlanOptions) -> None:
    """See that what is known of the model error comes from one place.

    Raises:
        typer.BadParameter: it comes from two.
    """
    for source, option in ((measured.campaign, "campaign"), (of.calibration, "calibration")):
        if source is not None and choice.model_error_mm is not None:
            raise typer.BadParameter(f"the {option} says how large it is", param_hint=f"--{option} / --model-error-mm")
    if of.calibration is not None and measured.campaign is not None:
        raise typer.BadParameter(
            "the calibration knows its campaign; plan on with one of them", param_hint="--calibration / --campaign"
        )


def _read(task: Path, of: ModelOptions, measured: MeasuredOptions, choice: PlanOptions) -> Setting:
    from taskcal.measurement.station import load_station
    from taskcal.task.task import load_task

    model, calibration = of.load()
    return Setting(
        model=model,
        calibration=calibration,
        task=load_task(task),
        station=None if choice.station is None else load_station(choice.station),
        campaign=None if measured.campaign is None else measured.read(measured.campaign, model.robot).campaign,
    )


def _plan(setting: Setting, choice: PlanOptions, source: Path | None, progress: Callable[[str], None]) -> "Plan":
    """The plan.

    Raises:
        FileError: the campaign or calibration of `source` does not go with robot or station.
        ReachError: fewer poses can be measured than were asked for, or the task's accuracy is out of reach.
    """
    from taskcal.adaptation.plan import plan
    from taskcal.adaptation.plan_demands import check_demands
    from taskcal.errors import CampaignError, FileError

    try:
        chosen = plan(
            setting.model,
            setting.task,
            choice.count,
            seed=choice.seed,
            station=setting.station,
            criterion=choice.criterion.value,
            campaign=setting.campaign,
            calibration=setting.calibration,
            candidates=choice.candidates,
            model_error=check_model_error(choice.model_error_mm),
            progress=progress,
        )
    except CampaignError as error:
        if source is None:
            raise
        raise FileError(source, str(error)) from error
    check_demands(chosen, choice.count)
    return chosen


def _visible(chosen: "Plan", station: "Station | None") -> dict[str, Any]:
    """Names of the reflectors seen at each pose, where a station says so."""
    if station is None:
        return {}
    names = [reflector.name for reflector in station.reflectors]
    return {"visible": [[name for name, seen in zip(names, row, strict=True) if seen] for row in chosen.visible]}


def _page(setting: Setting, chosen: "Plan", seed: int) -> str:
    from taskcal.identification.provenance import package_version
    from taskcal.presentation.plan_report import plan_html

    return plan_html(setting.model, setting.task, chosen, seed=seed, version=package_version())


def _show(result: Mapping[str, Any], chosen: "Plan", task: "Task") -> None:
    from taskcal.adaptation.plan_demands import describe_accuracy, describe_lost
    from taskcal.presentation.model_error_origin import state_model_error
    from taskcal.presentation.plan_tables import tabulate_by_count, tabulate_expected_errors

    show(tabulate_expected_errors(chosen, task.name, measured_before=result["measured_before"]))
    show(tabulate_by_count(chosen))
    single = f"a single pose is expected to be {result['expected_with_model_error_mm']:.4f} mm off (rms in space)"
    facts = [
        ("accuracy", describe_accuracy(chosen)),
        ("model error", state_model_error(result["model_error_mm"], result["model_error_origin"])),
        ("with it", single),
        ("candidates", f"{chosen.candidates} can be measured; fell away: {describe_lost(chosen) or 'none'}"),
        ("criterion", f"{chosen.criterion}; {chosen.exchanges} exchanges after the greedy start"),
        ("plan", f"wrote {result['plan']}, in the order in which to visit the poses"),
    ]
    if "visible" in result:
        seen = [len(names) for names in result["visible"]]
        number = f"{min(seen)} to {max(seen)}" if min(seen) < max(seen) else str(max(seen))
        facts.insert(4, ("reflectors", f"{number} seen at each pose"))
    facts += [("program", f"wrote {path}, {result['count']} poses") for path in result.get("programs", [])]
    if "report" in result:
        facts.append(("report", f"wrote {result['report']}"))
    show_facts(facts)
