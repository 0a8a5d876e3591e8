"""A choice of parameters as a page: how many the task needs, which, and why the others are not among them."""

from taskcal.adaptation.selection import Selection
from taskcal.adaptation.task_errors import TaskCurves, TaskMaps
from taskcal.analysis.sensitivity import Sensitivity
from taskcal.presentation.content import Chart, Numbers, Points, Section, Text
from taskcal.presentation.effect_figures import draw_effects
from taskcal.presentation.effect_tables import tabulate_effects
from taskcal.presentation.model_error_origin import state_model_error
from taskcal.presentation.report import Page
from taskcal.presentation.selection_figures import REFERENCES, draw_ladder
from taskcal.presentation.selection_tables import tabulate_dropped, tabulate_ladder
from taskcal.presentation.task_section import task_section
from taskcal.robot.error_model import ErrorModel
from taskcal.task.task import Task


def selection_page(
    model: ErrorModel,
    task: Task,
    selection: Selection,
    effects: Sensitivity,
    maps: TaskMaps | TaskCurves,
    *,
    accuracy: float | None,
    measured: str,
    version: str,
) -> Page:
    """The page of a choice of parameters.

    Args:
        model: the complete model.
        task: what the choice is for.
        selection: the choice.
        effects: sensitivity over the task's poses.
        maps: errors over the task, with the chosen parameters identified.
        accuracy: that was asked for, metres.
        measured: which poses are measured, in words.
        version: of the package, for the footer.
    """
    sections = [
        _how_many(model, selection, accuracy),
        _which(model, selection, effects),
        task_section(model, maps, f"the {len(selection.kept)} chosen parameters", measured),
    ]
    robot = model.robot.title or model.robot.name
    return Page(
        title=f"The parameters that {task.name} needs",
        sections=tuple(sections),
        lead=f"A smaller model of the {robot}, chosen by the error to be expected over the task.",
        footer=f"Taskcal {version}; robot {model.robot.name}; measured: {measured}.",
    )


def _how_many(model: ErrorModel, selection: Selection, accuracy: float | None) -> Section:
    """The error over the number of parameters, and the number that was chosen."""
    chosen = next(nested for nested in selection.ladder if nested.size == len(selection.kept))
    rotation = selection.model_error_rotation
    error = state_model_error(
        selection.model_error * 1e3, selection.model_error_origin, None if rotation is None else rotation * 1e3
    )
    return Section(
        title="How many parameters",
        blocks=(
            Numbers(
                (
                    (f"{len(selection.kept)} of {len(model)}", "", "parameters are enough"),
                    (f"{chosen.expected * 1e3:.3f}", "mm", "expected with them over the task, rms in space"),
                    (f"{selection.ladder[0].expected * 1e3:.3f}", "mm", "expected with all of them"),
                    (f"{selection.before * 1e3:.3f}", "mm", "expected of the nominal robot, frames found"),
                )
            ),
            Points(
                (
                    f"Chosen is {selection.why}.",
                    f"Model error: {error}.",
                    *(
                        f"The {REFERENCES[name][0]} has {size} parameters and is expected to leave {left * 1e3:.3f} mm."
                        for name, (size, left) in selection.references.items()
                    ),
                )
            ),
            Chart(
                title="Expected task error against the number of parameters",
                figure=draw_ladder(selection, accuracy),
                note=_LADDER + (_CROSSED if chosen.cross_validated is not None else ""),
            ),
            tabulate_ladder(selection),
        ),
    )


def _which(model: ErrorModel, selection: Selection, effects: Sensitivity) -> Section:
    """The parameters that were kept, and why the others were not."""
    labels = {p.name: p.label for p in model.parameters}
    kept = ", ".join(labels.get(name, name) for name in selection.kept_groups)
    return Section(
        title="Which, and why not the others",
        blocks=(
            Text((f"Kept: {kept or 'none, the frames alone'}.",)),
            tabulate_dropped(selection, model),
            Chart(
                title="Effect of every parameter on the tool point",
                least_width=700,
                figure=draw_effects(effects),
                note=_EFFECTS,
            ),
            tabulate_effects(effects),
        ),
    )


_LADDER = (
    "Where the line is flat, further parameters buy nothing for this task. From right to left the parameter "
    "goes that is missed least over the task. Logarithmic scale."
)

_CROSSED = (
    " The cross-validated error is on measured points that were left out, their noise included, and a mean; the expected one "
    "is that of the prediction over the task, and root mean square."
)

_EFFECTS = (
    "Over the task's poses, along the robot's base axes and in space. What acts much is not always needed: a parameter "
    "may repeat others, or move the task as the tracker's frame and the targets do."
)
