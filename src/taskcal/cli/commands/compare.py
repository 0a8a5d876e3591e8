"""``taskcal compare``: what changed between calibrations of one robot, or how far a model is from one."""

from pathlib import Path
from typing import Any

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
    split_names,
)
from taskcal.cli.output import info, say, show, show_facts, tell_edits, write_json
from taskcal.cli.progress import bar_over


def command(
    *,
    calibrations: list[Path] = argument(
        ...,
        "CAL.json CAL.json…",
        "Calibrations; each is compared with the first. A single one with --with.",
        callback=lambda paths: [look_at_calibration(path) for path in paths],
    ),
    unsealed: UnsealedOption = False,
    model: str | None = option(
        None,
        "MODEL",
        "Compare a model that someone uses with the calibration: catalogue name, .toml, .urdf (or .urdf#TIP), .xacro, MuJoCo's "
        ".xml, or a table (.csv with --convention).",
        named="--with",
    ),
    convention: str | None = option(None, "dh|mdh", "Convention of the table."),
    joints: str | None = option(
        None, "LIST", "Joints of the model in the order of the robot's, where their names differ."
    ),
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
    """Compare calibrations of one robot, or a model with a calibration.

    Tracker frames and targets do not count, nor does it matter which parameters each calibration estimates.
    """
    of_model = {"--convention": convention, "--joints": joints}
    of_change = {"--accuracy-mm": accuracy_mm, "--parameters": all_parameters or None}
    for name, value in (of_model if model is None else of_change).items():
        if value is not None:
            raise typer.BadParameter(f"has no use {'without' if model is None else 'with'} --with", param_hint=name)
    if (len(calibrations) < 2) != (model is not None):
        message = "name two calibrations or more, or a model (--with)" if model is None else "name one beside --with"
        raise typer.BadParameter(message, param_hint="CAL.json")

    if model is not None:
        calibration = read_calibration(calibrations[0], unsealed=unsealed)
        q = None
        if task is not None:
            with bar_over([REACHING]) as begin:
                q = read_and_reach(calibration.model, task, count, seed, begin).q
        read = taskcal.export.read_model(model, convention)
        compared_with = taskcal.export.compare_model(calibration, read, q, joints=split_names(joints, "--joints"))
        result = {"first": calibrations[0], "model": model, **compared_with.summary()}
        if as_json:
            write_json(result)
        else:
            tell_edits()
            _show_model(f"{model} against {calibrations[0]}", result)
        return

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


def _show_model(title: str, result: dict[str, Any]) -> None:
    from taskcal.report.content import Column, Table

    worst = result["worst"]
    joints = ", ".join(
        f"{name.rpartition('_')[0]} {value:.1f}{'°' if name.endswith('_deg') else ' mm'}"
        for name, value in worst["joints"].items()
    )
    place = " ".join(f"{value:.1f}" for value in worst["position_mm"])
    columns = [
        Column(f"{words} {unit}", f"{name}_{key}", digits)
        for unit, key, digits in (("mm", "mm", ".3f"), ("°", "deg", ".4f"))
        for words, name in (("mean", "mean"), ("95 %", "p95"), ("max", "max"))
    ]
    kinds = {
        "as it stands": "as_it_stands",
        "base and tool fitted": "frames_fitted",
        "nominal robot, fitted": "nominal",
    }
    rows = [{"label": label, **result[key]} for label, key in kinds.items()]
    say(title)
    show(
        Table.of(
            f"distance of the TCP, and of its axes, over {result['poses']} poses",
            (Column("", "label"), *columns),
            rows,
        )
    )
    facts = [
        ("farthest, fitted", f"at {place} mm: {joints}"),
        ("uncertainty", f"of the calibration {result['uncertainty_mm']:.3f} mm (3D rms, 1σ)"),
    ]
    show_facts(facts)
