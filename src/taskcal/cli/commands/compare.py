"""``taskcal compare``: what changed between calibrations of one robot."""

from pathlib import Path

import typer

import taskcal
from taskcal.cli.command import argument, option
from taskcal.cli.options.common import (
    REACHING,
    CountOption,
    JsonOption,
    SeedOption,
    UnsealedOption,
    above_zero,
    look_at_calibration,
    metres,
    read_and_reach,
    read_calibration,
)
from taskcal.cli.output import info, say, show, show_facts, tell_edits, write_json
from taskcal.cli.progress import bar_over


def command(
    *,
    calibrations: list[Path] = argument(
        ...,
        "CAL.json CAL.json…",
        "Calibrations; each is compared with the first.",
        callback=lambda paths: [look_at_calibration(path) for path in paths],
    ),
    unsealed: UnsealedOption = False,
    task: Path | None = option(
        None, "TASK.toml", "Compare over this task; by default at the measured poses.", also="-t"
    ),
    accuracy_mm: float | None = option(
        None, "MM", "Required accuracy, for whether recalibration is due; by default the task's.", callback=above_zero
    ),
    all_parameters: bool = option(
        False, named="--parameters", help="List all parameters, not only those that changed significantly."
    ),
    count: CountOption = 200,
    seed: SeedOption = 0,
    as_json: JsonOption = False,
) -> None:
    """Compare calibrations of one robot and test for change.

    Tracker frames and targets do not count, nor does it matter which parameters each calibration estimates.
    """
    if len(calibrations) < 2:
        raise typer.BadParameter("name two calibrations or more", param_hint="CAL.json")

    first, *others = [read_calibration(path, unsealed=unsealed) for path in calibrations]
    accuracy, q = metres(accuracy_mm), None
    names, compared = [f"comparing {path}" for path in calibrations[1:]], dict[Path, "taskcal.Comparison"]()
    with bar_over([*([] if task is None else [REACHING]), *names]) as begin:
        if task is not None:
            q = read_and_reach(first.model, task, count, seed, begin).q
            accuracy = taskcal.load_task(task).accuracy if accuracy is None else accuracy
        for name, path, other in zip(names, calibrations[1:], others, strict=True):
            begin(name)
            compared[path] = taskcal.compare(first, other, q)
    if as_json:
        entries = [
            {"second": path, **one.summary(), "due": None if accuracy is None else one.is_due(accuracy)}
            for path, one in compared.items()
        ]
        millimetres = None if accuracy is None else accuracy * 1e3
        write_json({"first": calibrations[0], "accuracy_mm": millimetres, "comparisons": entries})
        return
    tell_edits()
    for path, comparison in compared.items():
        _show(f"{path} against {calibrations[0]}", comparison, accuracy, all_parameters=all_parameters)


def _show(title: str, comparison: "taskcal.Comparison", accuracy: float | None, *, all_parameters: bool) -> None:
    from taskcal.report import comparison as tables

    for remark in comparison.remarks:
        info(remark)
    say(title)
    facts = [
        ("change", tables.describe_comparison(comparison)),
        ("maximum", f"{comparison.maximum * 1e3:.3f} mm at one of {len(comparison.q)} poses"),
        ("significance", tables.describe_chance(comparison)),
    ]
    if comparison.verdict != "unchanged" and comparison.resembles:
        facts.append(("consistent with", tables.describe_resemblance(comparison)))
    if accuracy is not None:
        facts.append(("recalibration", tables.describe_due(comparison, accuracy)))
    show_facts(facts)
    table = tables.tabulate_changes(comparison, None) if all_parameters else tables.tabulate_changes(comparison)
    if len(table):
        show(table)
