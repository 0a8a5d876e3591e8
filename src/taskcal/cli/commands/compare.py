"""``taskcal compare``: what changed between calibrations of one robot, or how far a model is from one."""

from pathlib import Path
from typing import TYPE_CHECKING

import typer

import taskcal
from taskcal.cli.command import argument, option
from taskcal.cli.options.common import (
    REACHING,
    ConventionOption,
    CountOption,
    UnsealedOption,
    accuracy_option,
    look_at_calibration,
    metres,
    read_and_reach,
    read_calibration,
    split_names,
    task_option,
)
from taskcal.cli.run import JsonOption, Result, Run
from taskcal_groundwork.options import Seed

if TYPE_CHECKING:
    import taskcal.report.comparison


def command(
    *,
    run: Run,
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
        named="with",
    ),
    convention: ConventionOption = None,
    joints: str | None = option(
        None, "LIST", "Joints of the model in the order of the robot's, where their names differ."
    ),
    task: Path | None = task_option("Compare over this task; by default at the measured poses."),
    accuracy_mm: float | None = accuracy_option(
        "Required accuracy, for whether recalibration is due; by default the task's."
    ),
    all_parameters: bool = option(
        False, named="parameters", help="List all parameters, not only those that changed significantly."
    ),
    count: CountOption = 200,
    seed: Seed = 0,
    as_json: JsonOption = False,
) -> Result:
    """Compare calibrations of one robot, or a model with a calibration.

    Tracker frames and targets do not count, nor does it matter which parameters each calibration estimates.
    """
    with_model = {"--convention": convention, "--joints": joints}
    without = {"--accuracy-mm": accuracy_mm, "--parameters": all_parameters or None}
    for name, value in (with_model if model is None else without).items():
        if value is not None:
            raise typer.BadParameter(f"has no use {'without' if model is None else 'with'} --with", param_hint=name)
    if (len(calibrations) < 2) != (model is not None):
        message = "name two calibrations or more, or a model (--with)" if model is None else "name one beside --with"
        raise typer.BadParameter(message, param_hint="CAL.json")

    first, *others = [read_calibration(path, unsealed=unsealed) for path in calibrations]
    accuracy, q = metres(accuracy_mm), None
    names, compared = [f"comparing {path}" for path in calibrations[1:]], dict[Path, "taskcal.Comparison"]()
    steps = [*([] if task is None else [REACHING]), *names]
    begin = run.bar(steps)
    if task is not None:
        q = read_and_reach(first.model, task, count, seed, begin).q
        accuracy = taskcal.load_task(task).accuracy if accuracy is None else accuracy
    for name, path, other in zip(names, calibrations[1:], others, strict=True):
        begin(name)
        compared[path] = taskcal.compare(first, other, q)
    if model is not None:
        read = taskcal.export.read_model(model, convention)
        distances = taskcal.export.compare_model(first, read, q, joints=split_names(joints, "--joints")).summary()
        return Result(
            summary={"first": calibrations[0], "model": model, **distances},
            sections=lambda: [taskcal.report.comparison.model_section(f"{model} against {calibrations[0]}", distances)],
        )
    entries = [
        {"second": path, **one.summary(), "due": None if accuracy is None else one.is_due(accuracy)}
        for path, one in compared.items()
    ]
    millimetres = None if accuracy is None else accuracy * 1e3
    return Result(
        summary={"first": calibrations[0], "accuracy_mm": millimetres, "comparisons": entries},
        sections=lambda: [
            taskcal.report.comparison.comparison_section(
                f"{path} against {calibrations[0]}", one, accuracy, all_parameters=all_parameters
            )
            for path, one in compared.items()
        ],
    )
