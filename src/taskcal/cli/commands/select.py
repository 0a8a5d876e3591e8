"""``taskcal select``: which parameters are worth fitting for a task."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

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
from taskcal.cli.output import (
    announce_compilation,
    note,
    show_facts,
    show_table,
    working,
    write_json,
)
from taskcal.cli.outputs import check_outputs, files_of_task

if TYPE_CHECKING:
    from taskcal.adaptation.selection import Selection
    from taskcal.measurement.campaign import Campaign
    from taskcal.robot.error_model import ErrorModel
    from taskcal.task.task import Task


def command(
    task: TaskOption,
    robot: OptionalRobotOption = None,
    calibration: CalibrationOption = None,
    effects: EffectsOption = None,
    campaign: Annotated[
        Path | None,
        typer.Option(
            "--campaign",
            metavar="CAMPAIGN.csv",
            readable=False,
            help="Measurements, to cross-validate every size of the model.",
        ),
    ] = None,
    accuracy: Annotated[
        float | None,
        typer.Option(
            "--accuracy",
            metavar="MM",
            help="Error in space (rms) that the task allows: the smallest model that meets it.",
        ),
    ] = None,
    model_error: ModelErrorOption = None,
    seed: SeedOption = 0,
    report: ReportOption = None,
    force: ForceOption = False,
    as_json: JsonOption = False,
) -> None:
    """Choose the smallest set of parameters that serves a task.

    With --calibration its effects compete too, with the model error and the prior scale that it found.
    """
    check_source(robot, calibration)
    if accuracy is not None and not 0 < accuracy < float("inf"):
        raise typer.BadParameter(f"{accuracy:g} is not above zero", param_hint="--accuracy")
    stated = check_model_error(model_error)
    for source, option in ((campaign, "--campaign"), (calibration, "--calibration")):
        if source is not None and stated is not None:
            raise typer.BadParameter(f"the {option[2:]} says how large it is", param_hint=f"{option} / --model-error")
    read = [robot, calibration, *files_of_task(task), campaign]
    outputs = check_outputs("select", [("--report", report)], read, force=force)
    from taskcal.adaptation.hyperparameters import known_hyperparameters
    from taskcal.adaptation.selection import select
    from taskcal.identification.calibration_file import load_calibration
    from taskcal.measurement.reader import read_campaign
    from taskcal.task.task import load_task

    known = None if calibration is None else load_calibration(calibration)
    model = model_of(robot, known, effects)
    asked, hyper = load_task(task), None if known is None else known_hyperparameters(known)
    measured = None if campaign is None else read_campaign(campaign, model.robot)
    announce_compilation()
    if measured is not None:
        note(f"cross-validating {len(model) + 1} sizes of the model on {len(measured)} rows")
    wanted = None if accuracy is None else accuracy * 1e-3
    found = select(model, asked, measured, wanted, seed=seed, hyperparameters=hyper, model_error=stated)
    result = found.to_json()
    if report is not None:
        with working("maps over the task"):
            outputs.write({report: _page(model, asked, measured, found, wanted, seed)})
        result["report"] = report
    if as_json:
        write_json(result)
    else:
        _show(model, result)


def _page(
    model: "ErrorModel",
    task: "Task",
    measured: "Campaign | None",
    found: "Selection",
    accuracy: float | None,
    seed: int,
) -> str:
    from taskcal.adaptation.task_errors import map_task
    from taskcal.analysis.sensitivity import sensitivity
    from taskcal.identification.provenance import package_version
    from taskcal.presentation.selection_report import selection_html
    from taskcal.task.task import reach_task

    reached = reach_task(model, task, seed=seed)
    assert found.design is not None
    maps = map_task(model, task, found.design, found.kept, seed)
    assumed = "60 poses assumed in the task" if task.workspace is not None else "60 poses assumed around the task"
    poses = assumed if measured is None else f"the {len(measured)} rows of {measured.source}"
    effects = sensitivity(model, reached.q)
    version = package_version()
    return selection_html(model, task, found, effects, maps, accuracy=accuracy, measured=poses, version=version)


def _show(model: Any, result: Mapping[str, Any]) -> None:
    from taskcal.presentation.model_error_origin import state_model_error

    symbols = {p.name: p.symbol for p in model.parameters}
    crossed = any(nested["cross_validated_mm"] is not None for nested in result["ladder"])
    chosen = len(result["kept"])
    rows = [
        (
            str(nested["size"]),
            f"{nested['expected_mm']:.4f}",
            *(
                ["" if nested["cross_validated_mm"] is None else f"{nested['cross_validated_mm']:.4f}"]
                if crossed
                else []
            ),
            "chosen" if nested["size"] == chosen else "",
        )
        for nested in result["ladder"]
    ]
    header = ("parameters", "expected mm (rms)", *(["cross-validated mm (mean)"] if crossed else []), "")
    show_table("Error in space over the task, by size of the model", header, rows, left=(len(header) - 1,))
    dropped = [(name, symbols[name], reason) for name, reason in result["dropped"].items()]
    show_table("Dropped", ("parameter", "symbol", "why"), dropped, left=range(3))
    facts = [
        ("kept", f"{chosen}: {', '.join(result['kept'])}"),
        ("why", result["why"]),
        (
            "model error",
            state_model_error(result["model_error_mm"], result["model_error_origin"], result.get("model_error_mrad")),
        ),
        ("nominal robot", f"{result['before_mm']:.4f} mm expected, with the frames fitted"),
    ]
    facts += [
        (name, f"{r['size']} parameters, {r['expected_mm']:.4f} mm expected")
        for name, r in result["references"].items()
    ]
    if result["unreachable"]:
        facts.append(("out of reach", f"{result['unreachable']:.1%} of the task's poses"))
    if "report" in result:
        facts.append(("report", f"wrote {result['report']}"))
    show_facts(facts)
