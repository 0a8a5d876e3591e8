"""``taskcal sensitivity``: the influence of each parameter on the TCP, and which parameters are identifiable."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import typer

import taskcal
from taskcal.cli.command import option
from taskcal.cli.options.campaign import MeasuredOptions
from taskcal.cli.options.common import REACHING, ModelErrorOption, RobotOption, SpreadOptions, metres, read_and_reach
from taskcal.cli.options.page import PageOptions
from taskcal.cli.output import files_of_task, show, show_facts, tell
from taskcal.cli.progress import bar_over
from taskcal.tables.frame import csv_of

if TYPE_CHECKING:
    import numpy as np
    from jaxtyping import Float

    from taskcal.analysis.identifiability import EliminationTable
    from taskcal.analysis.sensitivity import MeasuringNoise
    from taskcal.report.page import Page


SPACES = ("x", "y", "z", "space")
"""Axes of the robot's base, and all of them together."""

TELLING, MAPPING, PAGE = "identifiability", "maps over the task", "page"


def command(
    *,
    robot: RobotOption,
    task: Path | None = option(None, "TASK.toml", "Poses of a task.", also="-t"),
    measured: MeasuredOptions,
    spread: SpreadOptions,
    sort: Literal["model", "influence"] = option(
        "model", help="List parameters in the model's order, or by influence at their tolerance."
    ),
    output: Path | None = option(None, "FILE.csv", "Output CSV: the table.", also="-o"),
    model_error_mm: ModelErrorOption = None,
    page: PageOptions,
) -> None:
    """Report parameter sensitivity and identifiability."""
    if (task is None) == (measured.campaign is None):
        raise typer.BadParameter("give exactly one of them, which has the poses", param_hint="--task / --campaign")
    outputs = page.begin("sensitivity", [("--output", output)], [robot, *files_of_task(task), *measured.inputs])
    from taskcal.analysis.identifiability import tabulate_elimination
    from taskcal.analysis.sensitivity import measuring_noise

    model = taskcal.ErrorModel(taskcal.load_robot(robot))
    with bar_over([*([REACHING] if task else []), TELLING, *([MAPPING, PAGE] if page.asked else [])]) as begin:
        q, unreachable, campaign = _poses(model, task, measured, spread, begin)
        begin(TELLING)
        influence, elimination = taskcal.sensitivity(model, q), tabulate_elimination(model, {"poses": q})
        result = _result(influence, elimination, unreachable)
        noise = measuring_noise(model, q, campaign, metres(model_error_mm))
        told_apart = elimination.eliminations["poses"].distinguishable(noise=noise.total)
        result["told_apart"] = {**told_apart.summary(), **noise.summary()}
        if sort == "influence":
            result["parameters"].sort(key=lambda p: -p["tolerance_scaled_um"]["space"])
        table: dict[Path, str] = {}
        if output is not None:
            columns = influence.columns()
            rows = {row[0]: dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)}
            table[output] = csv_of(rows[p["name"]] for p in result["parameters"])

        def make() -> "Page":
            begin(MAPPING)
            made = _page(influence, elimination, (told_apart, noise), task, spread.seed)
            begin(PAGE)
            return made

        made = page.write(outputs, table, make)
    written = [*table, *made]
    page.give(result, lambda: _show(result, elimination, told_apart, noise))
    if written and not page.as_json:
        tell(f"wrote {page.in_words(written)}")


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
) -> "Page":
    from taskcal.report.sensitivity import sensitivity_page

    model, poses = found.model, f"{len(found.matrix)} poses of a campaign"
    maps = None
    if task is not None:
        from taskcal.planning.selection import design_for
        from taskcal.planning.task_map import map_task
        from taskcal.report.content import state_model_error

        asked = taskcal.load_task(task)
        poses = f"{len(found.matrix)} poses of {asked.name}"
        made, hyper, _ = design_for(
            model,
            taskcal.reach_task(model, asked, seed=seed),
            asked,
            options=taskcal.planning.SelectionOptions(seed=seed),
        )
        poses += f", model error {state_model_error(hyper.model_error[0] * 1e3, hyper.origin)}"
        maps = map_task(model, asked, made, seed=seed)
    told_apart, noise = apart
    return sensitivity_page(found, elimination, told_apart, noise, maps=maps, poses=poses)


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


def _show(
    result: Mapping[str, Any],
    table: "EliminationTable",
    told_apart: "taskcal.analysis.DistinguishableDirections",
    noise: "MeasuringNoise",
) -> None:
    from taskcal.report.content import Column, Table
    from taskcal.report.sensitivity import count_distinguishable, tabulate_distinguishable, tabulate_eliminated

    found = result["identifiability"]
    fate = dict.fromkeys(found["kept"], "kept") | dict.fromkeys(found["zero"], "zero")
    fate |= dict.fromkeys(found["dependent"], "dependent")
    columns = (
        Column("parameter", "name"),
        Column("symbol", "symbol", optional=True),
        *(Column(axis.replace("space", "3D"), f"max_{axis}", ".3f") for axis in SPACES),
        Column("unit", "unit"),
        *(
            Column(f"{axis.replace('space', '3D')} µm", lambda p, axis=axis: p["tolerance_scaled_um"][axis], ".1f")
            for axis in SPACES
        ),
        Column("elimination", lambda p: fate[p["name"]]),
    )
    title = f"Maximum influence over {result['poses']} poses: per unit, and at the tolerance (1σ) in µm"
    spare = ("x", "y", "z", "x µm", "y µm", "z µm", "symbol")
    show(Table.of(title, columns, result["parameters"]), spare=spare)
    said = [row for row in table.rows if row.eliminated["poses"] != "kept" or row.published not in ("", "kept")]
    if said:
        show(tabulate_eliminated("Linearly dependent parameters at these poses", table, said))
    indices = "  ".join(f"{name}={value:.3g}" for name, value in found["observability"].items())
    eliminated = f"{len(found['zero'])} without effect, {len(found['dependent'])} dependent, {len(found['kept'])} kept"
    symbols = {p["name"]: p["symbol"] or p["name"] for p in result["parameters"]}
    weakest = tabulate_distinguishable(told_apart, symbols)
    show(weakest)
    facts = [
        ("rank", f"{found['rank']} of {len(result['parameters'])} ({eliminated}); gap={found['gap']:.2g}"),
        ("determined", count_distinguishable(told_apart)),
        ("noise", noise.describe()),
        ("condition number", f"{found['condition_number']:.3g} (kept columns, unit length)"),
        ("observability", f"{indices} (kept, in units of tolerance)"),
    ]
    if result["published"]:
        facts.append(("published", f"{len(result['published']['kept'])} kept: {result['published']['source']}"))
    show_facts(facts)
