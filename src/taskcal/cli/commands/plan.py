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
from taskcal.cli.observing_options import ObservingOptions, WayChoice
from taskcal.cli.option_groups import grouped
from taskcal.cli.options import ModelErrorOption, SeedOption, TaskOption, check_model_error
from taskcal.cli.output import show, show_facts, working, write_json
from taskcal.cli.outputs import check_outputs, files_of_task
from taskcal.cli.page_options import PageOptions
from taskcal.cli.what_stands import describe_standing, tell_how_to_measure

if TYPE_CHECKING:
    from taskcal.adaptation.measuring_way import MeasuringWay
    from taskcal.adaptation.planned import Plan
    from taskcal.identification.calibration import Calibration
    from taskcal.measurement.campaign import Campaign
    from taskcal.measurement.station import Station
    from taskcal.presentation.report import Page
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
class ExtendedOptions(MeasuredOptions):
    """A campaign to go on from, and how it is read; distances and a wire's scale are of a plan without a tracker too."""

    of_others = ("distances", "wire_scale")


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
            help="Tracker, reflectors and obstacles; without it one reflector at the tool point is always seen. With --observe its "
            "obstacles alone count.",
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
    way: "MeasuringWay | None" = None
    """How to measure without a tracker."""

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
    measured: ExtendedOptions,
    choice: PlanOptions,
    observing: ObservingOptions,
    programs: MeasuringOptions,
    page: PageOptions,
) -> None:
    """Choose the poses whose measurement makes a robot accurate over a task.

    They are reached, clear of the robot itself and of obstacles, seen by the tracker,
    and stand in the order in which to visit them.

    With --observe they are those of a ball in sockets, a wire or a wrist camera, without a tracker.

    With --calibration they are chosen for what the calibration still leaves uncertain, with --campaign for what they
    add to those that were measured already.
    """
    _check_sources(of, measured, choice, observing)
    observed = observing.observe is not WayChoice.tracker
    setting = _read(task, of, measured, choice, observing) if observed else None
    paths = programs.paths
    if setting is not None and setting.way is not None:
        paths = tuple(path for numbered in programs.paths_of(setting.way) for path in numbered)
    outputs = check_outputs(
        "plan",
        [("--output", output), *page.places, *(("--program", path) for path in paths)],
        [
            of.robot,
            of.calibration,
            *files_of_task(task),
            choice.station,
            *measured.inputs,
            page.header,
            *observing.files,
        ],
        force=page.force,
    )
    page.check()
    setting = setting or _read(task, of, measured, choice, observing)
    robot = setting.model.robot
    programs.check(robot)
    steps = 5 + page.asked  # candidates, choice, exchange, two rounds of refinement, page
    with working("candidates", steps) as say:
        chosen = _plan(setting, choice, measured.campaign or of.calibration, say)
        contents: dict[Path, str | bytes] = {output: _text(chosen, setting)}
        for source in (
            programs.compose_observed(setting.model, chosen) if chosen.way else programs.compose(robot, chosen.q)
        ):
            contents[source.path] = source.encode()
        made: dict[Path, str | bytes] = {}
        if page.asked:
            say("page")
            made = page.compose(_page(setting, chosen, choice.seed))
        outputs.write_beside({**contents, **made}, force=page.force)
    result = {"plan": output, "robot": robot.name, **chosen.summary(), **_visible(chosen, setting.station)}
    if choice.station is not None:
        result["station"] = choice.station
    if chosen.way is None:
        result["clearance_mm"] = _clearance(chosen, setting)
    result["measured_before"] = setting.measured
    if of.calibration is not None:
        result["calibration"] = of.calibration
    if paths:
        result["programs"] = [str(path) for path in paths]
    if chosen.way is not None:
        result["standing"] = describe_standing(chosen.way.standing)
    result |= page.summary()
    if page.as_json:
        write_json(result)
    else:
        _show(result, chosen, setting, page.in_words(made))
        if chosen.way is not None:
            tell_how_to_measure(chosen, robot, stated=observing.stated is not None)


def _text(chosen: "Plan", setting: Setting) -> str:
    """The table of joints, and without a tracker of what is to be filled in."""
    from taskcal.measurement.writer import joints_text

    if chosen.way is None or chosen.of is None:
        return joints_text(chosen.q, setting.model.robot)
    return joints_text(chosen.q, setting.model.robot, chosen.way.columns(chosen.of))


def _check_sources(
    of: ModelOptions, measured: ExtendedOptions, choice: PlanOptions, observing: ObservingOptions
) -> None:
    """See that what is known of the model error comes from one place, and that a plan without a tracker begins anew.

    Raises:
        typer.BadParameter: it comes from two, or such a plan would go on.
    """
    if observing.observe is not WayChoice.tracker and (measured.campaign or of.calibration):
        given = "--campaign" if measured.campaign else "--calibration"
        raise typer.BadParameter(
            f"a plan for --observe {observing.observe.value} begins anew; give --robot alone", param_hint=given
        )
    if measured.campaign is None:
        observing.check(measured)
    for source, option in ((measured.campaign, "campaign"), (of.calibration, "calibration")):
        if source is not None and choice.model_error_mm is not None:
            raise typer.BadParameter(f"the {option} says how large it is", param_hint=f"--{option} / --model-error-mm")
    if of.calibration is not None and measured.campaign is not None:
        raise typer.BadParameter(
            "the calibration knows its campaign; plan on with one of them", param_hint="--calibration / --campaign"
        )


def _read(
    path: Path, of: ModelOptions, measured: ExtendedOptions, choice: PlanOptions, observing: ObservingOptions
) -> Setting:
    from taskcal.measurement.station import load_station
    from taskcal.task.task import load_task

    model, calibration = of.load()
    task = load_task(path)
    station = None if choice.station is None else load_station(choice.station)
    way = observing.load(model, task, () if station is None else station.keep_out, measured)
    return Setting(
        model=model,
        calibration=calibration,
        task=task,
        station=None if way is not None else station,
        way=way,
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
            observe=setting.way,
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


def _clearance(chosen: "Plan", setting: Setting) -> dict[str, list[float] | None]:
    """Gaps at each pose, between links and from them to the station's boxes; None where there is nothing to keep clear of."""
    import numpy as np

    from taskcal.kinematics.clearance import gap_between_links, gap_to_boxes, place_links

    links = place_links(setting.model, chosen.q)
    boxes = () if setting.station is None else setting.station.keep_out
    gaps = {"between_links": gap_between_links(links), "to_keep_out": gap_to_boxes(links, boxes)}
    return {name: (gap * 1e3).tolist() if np.isfinite(gap).all() else None for name, gap in gaps.items()}


def _in_words(clearance: Mapping[str, list[float] | None], model: "ErrorModel") -> str:
    """The least gaps of all poses, and of what."""
    radii = model.robot.link_radii
    if radii is None:
        return "not looked at: the robot file states no link_radii_mm"
    said = {"between_links": "between links", "to_keep_out": "to keep-out boxes"}
    gaps = [f"{min(gap):.0f} mm {said[name]}" for name, gap in clearance.items() if gap]
    return f"at least {', '.join(gaps) or '–'}; links as capsules of {min(radii) * 1e3:g} to {max(radii) * 1e3:g} mm radius"


def _page(setting: Setting, chosen: "Plan", seed: int) -> "Page":
    from taskcal.identification.provenance import package_version
    from taskcal.presentation.plan_report import plan_page

    return plan_page(setting.model, setting.task, chosen, seed=seed, version=package_version())


def _show(result: Mapping[str, Any], chosen: "Plan", setting: Setting, pages: str) -> None:
    import numpy as np

    from taskcal.adaptation.plan_demands import describe_accuracy, describe_lost
    from taskcal.presentation.model_error_origin import state_model_error
    from taskcal.presentation.plan_tables import tabulate_by_count, tabulate_expected_errors

    show(tabulate_expected_errors(chosen, setting.task.name, measured_before=result["measured_before"]))
    show(tabulate_by_count(chosen))
    single = f"a single pose is expected to be {result['expected_with_model_error_mm']:.3f} mm off (rms in space)"
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
    if "clearance_mm" in result:
        facts.insert(-2, ("clearance", _in_words(result["clearance_mm"], setting.model)))
    counts = [result["count"]] if chosen.way is None or chosen.of is None else np.bincount(chosen.way.stages[chosen.of])
    programs = result.get("programs", [])
    facts += [("program", f"wrote {path}, {counts[k % len(counts)]} poses") for k, path in enumerate(programs)]
    if pages:
        facts.append(("report", f"wrote {pages}"))
    show_facts(facts)
