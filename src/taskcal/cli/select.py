"""``taskcal select``: which parameters are worth fitting for a task."""

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import typer

from taskcal.cli.options import JsonOption, RobotOption, SeedOption, TaskOption
from taskcal.cli.output import announce_compilation, note, show_facts, show_table, write_json


def command(
    robot: RobotOption,
    task: TaskOption,
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
    seed: SeedOption = 0,
    as_json: JsonOption = False,
) -> None:
    """Choose the smallest set of parameters that serves a task."""
    if accuracy is not None and not 0 < accuracy < float("inf"):
        raise typer.BadParameter(f"{accuracy:g} is not above zero", param_hint="--accuracy")
    from taskcal.adaptation.selection import select
    from taskcal.measurement.reader import read_campaign
    from taskcal.robot.catalogue import load_robot
    from taskcal.robot.error_model import ErrorModel
    from taskcal.task.task import load_task

    model, asked = ErrorModel(load_robot(robot)), load_task(task)
    measured = None if campaign is None else read_campaign(campaign, model.robot)
    announce_compilation()
    if measured is not None:
        note(f"cross-validating {len(model) + 1} sizes of the model on {len(measured)} rows")
    result = select(model, asked, measured, None if accuracy is None else accuracy * 1e-3, seed=seed).to_json()
    if as_json:
        write_json(result)
    else:
        _show(model, result)


def _show(model: Any, result: Mapping[str, Any]) -> None:
    symbols = {p.name: p.symbol for p in model.parameters}
    crossed = any(rung["cross_validated_mm"] is not None for rung in result["ladder"])
    chosen = len(result["kept"])
    rows = [
        (
            str(rung["size"]),
            f"{rung['expected_mm']:.4f}",
            *(["" if rung["cross_validated_mm"] is None else f"{rung['cross_validated_mm']:.4f}"] if crossed else []),
            "chosen" if rung["size"] == chosen else "",
        )
        for rung in result["ladder"]
    ]
    header = ("parameters", "expected mm (rms)", *(["cross-validated mm (mean)"] if crossed else []), "")
    show_table("Error in space over the task, by size of the model", header, rows, left=(len(header) - 1,))
    dropped = [(name, symbols[name], reason) for name, reason in result["dropped"].items()]
    show_table("Dropped", ("parameter", "symbol", "why"), dropped, left=range(3))
    facts = [
        ("kept", f"{chosen}: {', '.join(result['kept'])}"),
        ("why", result["why"]),
        ("nominal robot", f"{result['before_mm']:.4f} mm expected, with the frames fitted"),
    ]
    facts += [
        (name, f"{r['size']} parameters, {r['expected_mm']:.4f} mm expected")
        for name, r in result["references"].items()
    ]
    if result["unreachable"]:
        facts.append(("out of reach", f"{result['unreachable']:.1%} of the task's poses"))
    show_facts(facts)
