"""``taskcal select``: the parameters to fit for a task."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import taskcal
from taskcal.cli.command import option
from taskcal.cli.options.campaign import MeasuredOptions
from taskcal.cli.options.common import (
    ModelErrorOption,
    ModelOptions,
    SeedOption,
    TaskOption,
    above_zero,
    check_one_model_error,
    metres,
)
from taskcal.cli.options.page import PageOptions
from taskcal.cli.output import files_of_task, info, show, show_facts, tell
from taskcal.cli.progress import bar_over

if TYPE_CHECKING:
    from taskcal.report.page import Page


MAPPING, PAGE = "maps over the task", "page"


def command(
    *,
    task: TaskOption,
    of: ModelOptions,
    measured: MeasuredOptions,
    accuracy_mm: float | None = option(
        None, "MM", "Allowed 3D rms error: select the smallest model that meets it.", callback=above_zero
    ),
    model_error_mm: ModelErrorOption = None,
    seed: SeedOption = 0,
    page: PageOptions,
) -> None:
    """Select the smallest set of parameters that meets a task's accuracy.

    With --campaign, every model size is cross-validated on its rows.

    With --calibration, its effects compete too, with its model error and prior scale.
    """
    stated = check_one_model_error(model_error_mm, measured.campaign, of.calibration)
    outputs = page.begin("select", [], [of.robot, of.calibration, *files_of_task(task), *measured.inputs])
    from taskcal.planning.expected_error import known_hyperparameters, parameter_groups
    from taskcal.planning.selection import selection_steps

    model, calibration = of.load()
    described = taskcal.load_task(task)
    known = None if calibration is None else known_hyperparameters(calibration)
    campaign = None if measured.campaign is None else measured.read(measured.campaign, model.robot).campaign
    if campaign is not None:
        info(f"cross-validating {len(parameter_groups(model)) + 1} model sizes on {len(campaign)} rows")
    accuracy = metres(accuracy_mm)
    options = taskcal.planning.SelectionOptions(seed=seed, hyperparameters=known, model_error=stated)
    with bar_over([*selection_steps(campaign), *([MAPPING, PAGE] if page.asked else [])]) as begin:
        selection = taskcal.select(model, described, campaign, accuracy, options=options, progress=begin)

        def make() -> "Page":
            begin(MAPPING)
            shown = _page(model, described, campaign, selection, accuracy, seed)
            begin(PAGE)
            return shown

        made = page.write(outputs, {}, make)
    result = selection.summary()
    page.give(result, lambda: _show(model, selection, result, page.in_words(made)))


def _page(
    model: "taskcal.ErrorModel",
    task: "taskcal.Task",
    campaign: "taskcal.Campaign | None",
    selection: "taskcal.Selection",
    accuracy: float | None,
    seed: int,
) -> "Page":
    from taskcal.planning.task_map import map_task
    from taskcal.report.selection import selection_page

    reached = taskcal.reach_task(model, task, seed=seed)
    assert selection.design is not None
    maps = map_task(model, task, selection.design, selection.kept, seed)
    assumed = "60 poses assumed in the task" if task.workspace is not None else "60 poses assumed around the task"
    poses = assumed if campaign is None else f"the {len(campaign)} rows of {campaign.source}"
    effects = taskcal.sensitivity(model, reached.q)
    return selection_page(model, task, selection, effects, maps, accuracy=accuracy, measured=poses)


def _show(model: "taskcal.ErrorModel", selection: "taskcal.Selection", result: Mapping[str, Any], pages: str) -> None:
    from taskcal.report.content import state_model_error
    from taskcal.report.selection import tabulate_dropped, tabulate_ladder

    error = state_model_error(result["model_error_mm"], result["model_error_origin"], result.get("model_error_mrad"))
    facts = [
        ("selected", f"{len(selection.kept)}: {', '.join(selection.kept_groups)}"),
        ("reason", result["why"]),
        ("model error", error),
        ("nominal (registered)", f"expected error {result['before_mm']:.3f} mm (3D rms)"),
    ]
    facts += [
        (name, f"{r['size']} parameters, expected error {r['expected_mm']:.3f} mm (3D rms)")
        for name, r in result["references"].items()
    ]
    if result["unreachable"]:
        facts.append(("out of reach", f"{result['unreachable']:.1%} of the task's poses"))
    show_facts(facts)
    tell()
    show(tabulate_ladder(selection))
    show(tabulate_dropped(selection, model))
    if pages:
        tell(f"wrote {pages}")
