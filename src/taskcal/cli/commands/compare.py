"""``taskcal compare``: what changed between calibrations of one robot."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from taskcal.cli.options.common import CountOption, JsonOption, SeedOption, check_above_zero, look_at_calibrations
from taskcal.cli.options.task import REACHING, read_and_reach
from taskcal.cli.output import info, say, show, show_facts, write_json
from taskcal.cli.progress import bar_over

if TYPE_CHECKING:
    import numpy as np

    from taskcal.identification.comparison import Comparison
    from taskcal.robot.error_model import ErrorModel


def command(
    calibrations: Annotated[
        list[Path],
        typer.Argument(
            metavar="CAL.json CAL.json…",
            readable=False,
            callback=look_at_calibrations,
            help="Calibrations; each is compared with the first.",
        ),
    ],
    task: Annotated[
        Path | None,
        typer.Option(
            "--task",
            "-t",
            metavar="TASK.toml",
            readable=False,
            help="Where it matters; by default at the poses measured.",
        ),
    ] = None,
    accuracy_mm: Annotated[
        float | None,
        typer.Option(
            "--accuracy-mm",
            metavar="MM",
            help="Accuracy needed, for whether the robot is due again; by default the task's.",
        ),
    ] = None,
    all_parameters: Annotated[
        bool, typer.Option("--parameters", help="List all parameters, not only those that clearly changed.")
    ] = False,
    count: CountOption = 200,
    seed: SeedOption = 0,
    as_json: JsonOption = False,
) -> None:
    """Compare calibrations of one robot and test for change.

    Tracker frames and targets do not count, nor does it matter which parameters each calibration has.
    """
    check_above_zero(accuracy_mm, "--accuracy-mm")
    if len(calibrations) < 2:
        raise typer.BadParameter("name two calibrations or more", param_hint="CAL.json")
    from taskcal.identification.calibration import load_calibration
    from taskcal.identification.comparison import compare

    first, *others = [load_calibration(path) for path in calibrations]
    accuracy = None if accuracy_mm is None else accuracy_mm * 1e-3
    names = [f"comparing {path}" for path in calibrations[1:]]
    with bar_over([*([] if task is None else [REACHING]), *names]) as begin:
        q, compared = None, []
        if task is not None:
            q, stated = _poses_of(first.model, task, count, seed, begin)
            accuracy = stated if accuracy is None else accuracy
        for name, other in zip(names, others, strict=True):
            begin(name)
            compared.append(compare(first, other, q))
    if as_json:
        write_json({
            "first": calibrations[0],
            "accuracy_mm": None if accuracy is None else accuracy * 1e3,
            "comparisons": [
                _summary(path, comparison, accuracy)
                for path, comparison in zip(calibrations[1:], compared, strict=True)
            ],
        })  # fmt: skip
        return
    for path, comparison in zip(calibrations[1:], compared, strict=True):
        _show(f"{path} against {calibrations[0]}", comparison, accuracy, all_parameters=all_parameters)


def _poses_of(
    model: "ErrorModel", path: Path, count: int, seed: int, begin: Callable[[str], None]
) -> "tuple[np.ndarray, float | None]":
    from taskcal.task.task import load_task

    return read_and_reach(model, path, count, seed, begin).q, load_task(path).accuracy


def _summary(path: Path, comparison: "Comparison", accuracy: float | None) -> dict[str, Any]:
    due = None if accuracy is None else comparison.is_due(accuracy)
    return {"second": path, **comparison.summary(), "due": due}


def _show(title: str, comparison: "Comparison", accuracy: float | None, *, all_parameters: bool) -> None:
    from taskcal.report.comparison import (
        describe_chance,
        describe_comparison,
        describe_due,
        describe_resemblance,
        tabulate_changes,
    )

    for remark in comparison.remarks:
        info(remark)
    say(title)
    facts = [
        ("changed", describe_comparison(comparison)),
        ("largest", f"{comparison.maximum * 1e3:.3f} mm at one of {len(comparison.q)} poses"),
        ("by chance", describe_chance(comparison)),
    ]
    if comparison.verdict != "unchanged" and comparison.resembles:
        facts.append(("looks like", describe_resemblance(comparison)))
    if accuracy is not None:
        facts.append(("due again", describe_due(comparison, accuracy)))
    show_facts(facts)
    table = tabulate_changes(comparison, None) if all_parameters else tabulate_changes(comparison)
    if len(table):
        show(table)
