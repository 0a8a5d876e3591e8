"""``taskcal plan``: which poses to measure."""

from collections.abc import Mapping
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from taskcal.cli.measuring_program import JointSpeedOption, ProgramsOption, SpeedOption, WaitOption, compose_measuring
from taskcal.cli.model import EffectsOption, model_of
from taskcal.cli.options import (
    CalibrationOption,
    ForceOption,
    JsonOption,
    ModelErrorOption,
    OptionalRobotOption,
    ReportOption,
    SeedOption,
    TaskOption,
    check_model_error,
    check_source,
)
from taskcal.cli.output import announce_compilation, show_facts, show_table, working, write_json
from taskcal.cli.outputs import check_outputs, files_of_task

if TYPE_CHECKING:
    from taskcal.adaptation.plan import Plan
    from taskcal.measurement.station import Station
    from taskcal.robot.error_model import ErrorModel
    from taskcal.task.task import Task

COUNTS = (5, 8, 10, 12, 15, 20, 25, 30, 40, 50, 60, 80, 100, 150, 200, 300, 500)
"""Numbers of poses whose expected error is printed."""


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


def command(
    task: TaskOption,
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="PLAN.csv", readable=False, help="Joint positions to measure.")
    ],
    robot: OptionalRobotOption = None,
    calibration: CalibrationOption = None,
    effects: EffectsOption = None,
    count: Annotated[int, typer.Option("--count", "-n", min=1, metavar="N", help="Poses to measure.")] = 60,
    seed: SeedOption = 0,
    station: Annotated[
        Path | None,
        typer.Option(
            "--station",
            metavar="STATION.toml",
            readable=False,
            help="Tracker, reflectors and obstacles; without it one reflector at the tool point is always seen.",
        ),
    ] = None,
    criterion: Annotated[
        CriterionChoice,
        typer.Option("--criterion", help="The expected error over the task, or one of the classical criteria."),
    ] = CriterionChoice.task,
    extend: Annotated[
        Path | None,
        typer.Option(
            "--extend", metavar="CAMPAIGN.csv", readable=False, help="Measured already: choose what to add to it."
        ),
    ] = None,
    candidates: Annotated[
        int, typer.Option("--candidates", min=1, metavar="N", help="Poses to choose among.")
    ] = 10_000,
    model_error: ModelErrorOption = None,
    program: ProgramsOption = None,
    wait_s: WaitOption = 3.0,
    speed_mm_s: SpeedOption = 250.0,
    speed_percent: JointSpeedOption = 10.0,
    report: ReportOption = None,
    force: ForceOption = False,
    as_json: JsonOption = False,
) -> None:
    """Choose the poses whose measurement makes a robot accurate over a task.

    They are reached, clear of the robot itself and of obstacles, seen by the tracker,
    and stand in the order in which to visit them.

    With --calibration they are chosen for what the calibration still leaves uncertain.
    """
    check_source(robot, calibration)
    stated = check_model_error(model_error)
    if extend is not None and model_error is not None:
        raise typer.BadParameter("the campaign says how large it is", param_hint="--extend / --model-error")
    if calibration is not None and extend is not None:
        raise typer.BadParameter(
            "the calibration knows its campaign; plan on with one of them", param_hint="--calibration / --extend"
        )
    if calibration is not None and model_error is not None:
        raise typer.BadParameter("the calibration says how large it is", param_hint="--calibration / --model-error")
    programs = program or []
    outputs = check_outputs(
        "plan",
        [("--output", output), ("--report", report), *(("--program", path) for path in programs)],
        [robot, calibration, *files_of_task(task), station, extend],
        force=force,
    )
    import numpy as np

    from taskcal.adaptation.plan import plan
    from taskcal.errors import CampaignError, FileError
    from taskcal.identification.calibration_file import load_calibration
    from taskcal.measurement.reader import read_campaign
    from taskcal.measurement.station import load_station
    from taskcal.measurement.writer import joints_text
    from taskcal.task.task import load_task

    known = None if calibration is None else load_calibration(calibration)
    model = model_of(robot, known, effects)
    asked = load_task(task)
    stands = None if station is None else load_station(station)
    measured = None if extend is None else read_campaign(extend, model.robot)
    driving = {"wait_s": wait_s, "speed_mm_s": speed_mm_s, "speed_percent": speed_percent}
    nowhere = np.empty((0, len(model.robot.joints)))
    compose_measuring(programs, model.robot, nowhere, **driving)  # refuses a name before the plan is made
    announce_compilation()
    with working("candidates") as say:
        try:
            made = plan(
                model,
                asked,
                count,
                seed=seed,
                station=stands,
                criterion=criterion.value,
                campaign=measured,
                calibration=known,
                candidates=candidates,
                model_error=stated,
                progress=say,
            )
        except CampaignError as error:
            source = extend or calibration
            if source is None:
                raise
            raise FileError(source, str(error)) from error
        _check(made, count)
        contents: dict[Path, str | bytes] = {output: joints_text(made.q, model.robot)}
        for source in compose_measuring(programs, model.robot, made.q, **driving):
            contents[source.path] = source.encode()
        if report is not None:
            say("page")
            contents[report] = _page(model, asked, made, seed)
        outputs.write(contents)
    result = {"plan": output, "robot": model.robot.name, **made.to_json(), **_seen(made, stands)}
    before = measured.ids if measured is not None else () if known is None else known.ids
    result["measured_before"] = len(before)
    if calibration is not None:
        result["calibration"] = calibration
    if programs:
        result["programs"] = [str(path) for path in programs]
    if report is not None:
        result["report"] = report
    if as_json:
        write_json(result)
    else:
        _show(result, asked)


def _check(made: "Plan", count: int) -> None:
    """See that the plan gives what was asked.

    Raises:
        ReachError: fewer poses can be measured than were asked for, or the task's accuracy is out of reach.
    """
    from taskcal.errors import ReachError

    if len(made.q) < count:
        lost = ", ".join(f"{number} {reason}" for reason, number in made.lost.items() if number)
        raise ReachError(
            f"only {made.candidates} candidate poses can be measured, {count} were asked for ({lost or 'none fell away'}); "
            "give more --candidates, or ask for fewer poses"
        )
    # where the model error alone takes the accuracy, the poses are worth measuring all the same: it may turn out smaller
    wanted = made.geometry_allowance or made.accuracy
    if wanted is not None and len(made.q) * (made.expected / wanted) ** 2 > made.candidates > 0:
        raise ReachError(
            f"the task's accuracy of {(made.accuracy or wanted) * 1e3:g} mm is out of reach: {count} poses are expected to leave "
            f"{made.expected * 1e3:.4f} mm rms{_allowed(made)}, and not even all {made.candidates} that can be measured would do; "
            "state an accuracy that can be had, or leave it out of the task"
        )


def _allowed(made: "Plan") -> str:
    """How much of the accuracy the model error of a single pose takes, in words."""
    if not made.geometry_allowance or not made.model_error:
        return ""
    return (
        f", the model error of {made.model_error * 1e3:.3g} mm per axis allows {made.geometry_allowance * 1e3:.4f} mm"
    )


def _seen(made: "Plan", station: "Station | None") -> dict[str, Any]:
    """Names of the reflectors seen at each pose, where a station says so."""
    if station is None:
        return {}
    names = [reflector.name for reflector in station.reflectors]
    return {"visible": [[name for name, seen in zip(names, row, strict=True) if seen] for row in made.visible]}


def _page(model: "ErrorModel", task: "Task", made: "Plan", seed: int) -> str:
    from taskcal.identification.provenance import package_version
    from taskcal.presentation.plan_report import plan_html

    return plan_html(model, task, made, seed=seed, version=package_version())


def _show(result: Mapping[str, Any], task: "Task") -> None:
    from taskcal.presentation.model_error_origin import state_model_error

    low, high = result["random_expected_error_range_mm"]
    count = result["count"]
    rows = [
        ("this plan", f"{result['expected_error_mm']:.4f}", ""),
        ("random poses", f"{result['random_expected_error_mm']:.4f}", f"{low:.4f} to {high:.4f}"),
        ("poses spread evenly", f"{result['grid_expected_error_mm']:.4f}", ""),
        (
            "calibration as it is" if "calibration" in result else "nominal robot, frames found",
            f"{result['before_mm']:.4f}",
            "",
        ),
    ]
    before = result["measured_before"]
    added = f" added to {before}" if before else ""
    title = f"Error to be expected over '{task.name}' from {count} poses{added}: rms in space, mm"
    show_table(title, ("", "expected", "range of 20 plans"), rows)
    by_count = result["by_count_mm"]
    shown = sorted({n for n in COUNTS if n < count} | {count})
    cells = [(str(n), f"{by_count[n - 1]:.4f}") for n in shown if by_count[n - 1] < result["before_mm"]]
    show_table("After so many poses, chosen one by one", ("poses", "expected"), cells, left=())
    single = f"a single pose is expected to be {result['expected_with_model_error_mm']:.4f} mm off (rms in space)"
    facts = [
        ("accuracy", _accuracy(result)),
        ("model error", state_model_error(result["model_error_mm"], result["model_error_origin"])),
        ("with it", single),
    ]
    lost = ", ".join(f"{number} {reason}" for reason, number in result["lost"].items() if number)
    facts += [
        ("candidates", f"{result['candidates']} can be measured; fell away: {lost or 'none'}"),
        ("criterion", f"{result['criterion']}; {result['exchanges']} exchanges after the greedy start"),
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


def _accuracy(result: Mapping[str, Any]) -> str:
    wanted, allowed = result["accuracy_mm"], result["geometry_allowance_mm"]
    if wanted is None:
        return "the task states none"
    if not allowed:
        alone = 3.0**0.5 * result["model_error_mm"]
        return (
            f"the {wanted:g} mm of the task are not met by any number of poses: the model error alone leaves {alone:.4f} mm "
            "(rms in space); what identifies it, effects above all, is worth more than poses"
        )
    if result["poses_needed"] is not None:
        return (
            f"the {wanted:g} mm of the task are met by the first {result['poses_needed']} chosen, with the model error"
        )
    if result["expected_error_mm"] <= allowed:
        return f"the {wanted:g} mm of the task are met by the whole plan, with the model error"
    poses = result["count"] * (result["expected_error_mm"] / allowed) ** 2
    return f"the {wanted:g} mm of the task are not met; some {poses:.0f} poses would be needed, with the model error"
