"""``taskcal select``: the parameters to fit for a task."""

from typing import TYPE_CHECKING

import taskcal
from taskcal.cli.options.campaign import MeasuredOptions
from taskcal.cli.options.common import ModelOptions, TaskOption, accuracy_option, metres
from taskcal.cli.options.page import PageOptions
from taskcal.cli.output import info
from taskcal.cli.run import Result, Run
from taskcal.planning.options import SelectionOptions, check_one_model_error
from taskcal_groundwork.options import Written

if TYPE_CHECKING:
    import taskcal.report.selection
    from taskcal.report.page import Report


MAPPING = "maps over the task"


def command(
    *,
    run: Run,
    task: TaskOption,
    of: ModelOptions,
    measured: MeasuredOptions,
    accuracy_mm: float | None = accuracy_option("Allowed 3D rms error: select the smallest model that meets it."),
    choice: Written[SelectionOptions],
    page: PageOptions,
) -> Result:
    """Select the smallest set of parameters that meets a task's accuracy.

    With --campaign, every model size is cross-validated on its rows.

    With --calibration, its effects compete too, with its model error and prior scale.
    """
    check_one_model_error(choice.model_error, measured.campaign, of.calibration)
    from taskcal.planning.expected_error import known_hyperparameters, parameter_groups
    from taskcal.planning.selection import selection_steps

    model, calibration = of.load()
    described = taskcal.load_task(task)
    known = None if calibration is None else known_hyperparameters(calibration)
    campaign = None if measured.campaign is None else measured.read(measured.campaign, model.robot).campaign
    if campaign is not None:
        info(f"cross-validating {len(parameter_groups(model)) + 1} model sizes on {len(campaign)} rows")
    accuracy = metres(accuracy_mm)
    begin = run.bar([*selection_steps(campaign), *([MAPPING] if page.asked else [])])
    options = choice.made(hyperparameters=known, progress=begin)
    selection = taskcal.select(model, described, campaign, accuracy, options)

    def make() -> "Report":
        begin(MAPPING)
        return _page(model, described, campaign, selection, accuracy, choice.seed)

    return Result(
        summary=selection.summary(),
        sections=lambda: taskcal.report.selection.selection_sections(model, selection, accuracy),
        page=make,
    )


def _page(
    model: "taskcal.ErrorModel",
    task: "taskcal.Task",
    campaign: "taskcal.Campaign | None",
    selection: "taskcal.Selection",
    accuracy: float | None,
    seed: int,
) -> "Report":
    from taskcal.planning.task_map import map_task

    reached = taskcal.reach_task(model, task, seed=seed)
    assert selection.design is not None
    maps = map_task(model, task, selection.design, selection.kept, seed)
    assumed = "60 poses assumed in the task" if task.workspace is not None else "60 poses assumed around the task"
    poses = assumed if campaign is None else f"the {len(campaign)} rows of {campaign.source}"
    effects = taskcal.sensitivity(model, reached.q)
    return taskcal.report.selection.selection_page(
        model, task, selection, effects, maps, accuracy=accuracy, measured=poses
    )
