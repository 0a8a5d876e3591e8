"""``taskcal sensitivity``: the influence of each parameter on the TCP, and which parameters are identifiable."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import typer

import taskcal
from taskcal.cli.command import option, output_option
from taskcal.cli.options.campaign import MeasuredOptions
from taskcal.cli.options.common import REACHING, RobotOption, SpreadOptions, read_and_reach, task_option
from taskcal.cli.options.page import PageOptions
from taskcal.cli.run import File, Result, Run
from taskcal.planning.options import ModelError
from taskcal.tables.frame import csv_of

if TYPE_CHECKING:
    import numpy as np
    from jaxtyping import Float

    import taskcal.report.sensitivity
    from taskcal.analysis.identifiability import EliminationTable
    from taskcal.analysis.sensitivity import MeasuringNoise
    from taskcal.report.page import Report


SPACES = ("x", "y", "z", "space")
"""Axes of the robot's base, and all of them together."""

TELLING, MAPPING = "identifiability", "maps over the task"


def command(
    *,
    run: Run,
    robot: RobotOption,
    task: Path | None = task_option("Poses of a task."),
    measured: MeasuredOptions,
    spread: SpreadOptions,
    sort: Literal["model", "influence"] = option(
        "model", help="List parameters in the model's order, or by influence at their tolerance."
    ),
    output: Path | None = output_option(None, "FILE.csv", "Output CSV: the table."),
    model_error: ModelError = None,
    page: PageOptions,
) -> Result:
    """Report parameter sensitivity and identifiability."""
    if (task is None) == (measured.campaign is None):
        raise typer.BadParameter("give exactly one of them, which has the poses", param_hint="--task / --campaign")
    from taskcal.analysis.identifiability import tabulate_elimination
    from taskcal.analysis.sensitivity import measuring_noise

    model = taskcal.ErrorModel(taskcal.load_robot(robot))
    begin = run.bar([*([REACHING] if task else []), TELLING, *([MAPPING] if page.asked else [])])
    q, unreachable, campaign = _poses(model, task, measured, spread, begin)
    begin(TELLING)
    influence, elimination = taskcal.sensitivity(model, q), tabulate_elimination(model, {"poses": q})
    result = _result(influence, elimination, unreachable)
    noise = measuring_noise(model, q, campaign, model_error)
    told_apart = elimination.eliminations["poses"].distinguishable(noise=noise.total)
    result["told_apart"] = {**told_apart.summary(), **noise.summary()}
    if sort == "influence":
        result["parameters"].sort(key=lambda p: -p["tolerance_scaled_um"]["space"])
    columns = influence.columns()
    rows = {row[0]: dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)}

    def make() -> "Report":
        begin(MAPPING)
        return _page(influence, elimination, (told_apart, noise), task, spread.seed)

    return Result(
        summary=result,
        sections=lambda: [
            taskcal.report.sensitivity.sensitivity_section(
                result["parameters"], influence, elimination, told_apart, noise
            )
        ],
        files=[File("table", output, csv_of(rows[p["name"]] for p in result["parameters"]))],
        page=make,
    )


def _poses(
    model: "taskcal.ErrorModel",
    task: Path | None,
    measured: MeasuredOptions,
    spread: SpreadOptions,
    begin: Callable[[str], None],
) -> "tuple[Float[np.ndarray, 'n joints'], float, taskcal.Campaign | None]":
    """Joint positions, the share of a task that is out of reach, and the campaign where it is one's."""
    if measured.campaign is not None:
        campaign = measured.read(measured.campaign, model.robot).campaign
        return campaign.q, 0.0, campaign
    assert task is not None
    poses = read_and_reach(model, task, spread.count, spread.seed, begin)
    return poses.q, float(poses.unreachable.mean()), None


def _page(
    found: "taskcal.analysis.Sensitivity",
    elimination: "EliminationTable",
    apart: "tuple[taskcal.analysis.DistinguishableDirections, MeasuringNoise]",
    task: Path | None,
    seed: int,
) -> "Report":
    model, poses = found.model, f"{len(found.matrix)} poses of a campaign"
    maps = None
    if task is not None:
        from taskcal.planning.selection import design_for
        from taskcal.planning.task_map import map_task

        asked = taskcal.load_task(task)
        poses = f"{len(found.matrix)} poses of {asked.name}"
        made, hyper, _ = design_for(
            model,
            taskcal.reach_task(model, asked, seed=seed),
            asked,
            options=taskcal.planning.SelectionOptions(seed=seed),
        )
        poses += f", model error {taskcal.report.content.state_model_error(hyper.model_error[0] * 1e3, hyper.origin)}"
        maps = map_task(model, asked, made, seed=seed)
    told_apart, noise = apart
    return taskcal.report.sensitivity.sensitivity_page(found, elimination, told_apart, noise, maps=maps, poses=poses)


def _result(found: "taskcal.analysis.Sensitivity", table: "EliminationTable", unreachable: float) -> dict[str, Any]:
    from dataclasses import asdict

    model, elimination = found.model, table.eliminations["poses"]

    def influences(*, scaled: bool) -> "dict[str, np.ndarray]":
        """Largest and root mean square effect of each parameter, by its name in the result."""
        kinds = {"max": (found.maximum, found.maximum_in_space), "rms": (found.rms_per_axis, found.rms)}
        return {
            f"{kind}_{axis}": values
            for kind, (per_axis, in_space) in kinds.items()
            for axis, values in zip(SPACES, [*per_axis(scaled=scaled), in_space(scaled=scaled)], strict=True)
        }

    raw = influences(scaled=False)
    scaled = {name.removeprefix("max_"): 1e6 * values for name, values in influences(scaled=True).items()}
    parameters = [
        {
            "name": p.name,
            "symbol": p.symbol,
            "unit": "mm/mm" if p.unit == "m" else "mm/mrad",
            **{name: float(values[i]) for name, values in raw.items()},
            "tolerance": p.tolerance * 1e3,
            "tolerance_scaled_um": {name: float(values[i]) for name, values in scaled.items()},
        }
        for i, p in enumerate(model.parameters)
    ]
    published = model.robot.published
    return {
        "robot": model.robot.name,
        "poses": len(found.matrix),
        "unreachable_share": unreachable,
        "parameters": parameters,
        "identifiability": {
            **{key: getattr(elimination, key) for key in ("rank", "zero", "dependent", "kept")},
            "repeats": {name: {other: c} for name, (other, c) in elimination.repeats.items()},
            **{key: getattr(elimination, key) for key in ("singular_values", "gap", "condition_number")},
            "observability": asdict(elimination.observability()),
        },
        "elimination": [
            {
                **{key: getattr(row, key) for key in ("name", "symbol", "published", "repeats")},
                "eliminated": row.eliminated["poses"],
            }
            for row in table.rows
        ],
        "published": {"source": published.source, "kept": taskcal.analysis.published_kept(model)}
        if published.source
        else None,
    }
