"""A choice of parameters as a page: how many the task needs, which, and why the others are not among them."""

from taskcal.adaptation.selection import Selection
from taskcal.adaptation.task_errors import TaskCurves, TaskMaps
from taskcal.analysis.sensitivity import Sensitivity
from taskcal.presentation.content import Chart, Numbers, Points, Section, Table, Text
from taskcal.presentation.effect_figures import draw_effects
from taskcal.presentation.effect_tables import tabulate_effects
from taskcal.presentation.model_error_origin import state_model_error
from taskcal.presentation.report import report_html
from taskcal.presentation.selection_figures import REFERENCES, draw_ladder
from taskcal.presentation.task_section import task_section
from taskcal.robot.error_model import ErrorModel
from taskcal.task.task import Task


def selection_html(
    model: ErrorModel,
    task: Task,
    found: Selection,
    effects: Sensitivity,
    maps: TaskMaps | TaskCurves,
    *,
    accuracy: float | None,
    measured: str,
    version: str,
) -> str:
    """The page of a choice of parameters.

    Args:
        model: the complete model.
        task: what the choice is for.
        found: the choice.
        effects: sensitivity over the task's poses.
        maps: errors over the task, with the chosen parameters identified.
        accuracy: that was asked for, metres.
        measured: which poses are measured, in words.
        version: of the package, for the footer.
    """
    chosen = next(nested for nested in found.ladder if nested.size == len(found.kept))
    labels = {p.name: p.label for p in model.parameters}
    crossed = chosen.cross_validated is not None
    sections = [
        Section(
            title="How many parameters",
            blocks=(
                Numbers(
                    (
                        (f"{len(found.kept)} of {len(model)}", "", "parameters are enough"),
                        (f"{chosen.expected * 1e3:.4f}", "mm", "expected with them over the task, rms in space"),
                        (f"{found.ladder[0].expected * 1e3:.4f}", "mm", "expected with all of them"),
                        (f"{found.before * 1e3:.3f}", "mm", "expected of the nominal robot, frames found"),
                    )
                ),
                Points(
                    (
                        f"Chosen is {found.why}.",
                        f"Model error: {state_model_error(found.model_error * 1e3, found.model_error_origin)}.",
                        *(
                            f"The {REFERENCES[name][0]} has {size} parameters and is expected to leave {error * 1e3:.4f} mm."
                            for name, (size, error) in found.references.items()
                        ),
                    )
                ),
                Chart(
                    title="Expected task error against the number of parameters",
                    figure=draw_ladder(found, accuracy),
                    note="From right to left the parameter goes that is missed least over the task. Logarithmic scale."
                    + (
                        " The cross-validated error is on measured points that were left out, their noise included, and a mean; "
                        "the expected one is that of the prediction over the task, and root mean square."
                        if crossed
                        else ""
                    ),
                ),
            ),
        ),
        Section(
            title="Which, and why not the others",
            blocks=(
                Text((f"Kept: {', '.join(labels[name] for name in found.kept) or 'none, the frames alone'}.",)),
                Table.of_rows(
                    f"The {len(found.dropped)} dropped parameters, in the order in which they went",
                    ("parameter", "why"),
                    [(labels[name], reason) for name, reason in found.dropped.items()],
                    text_columns=(0, 1),
                    folded=True,
                ),
                Chart(title="Effect of every parameter on the tool point", figure=draw_effects(effects), note=_EFFECTS),
                tabulate_effects(effects),
            ),
        ),
        task_section(model, maps, f"the {len(found.kept)} chosen parameters", measured),
    ]
    robot = model.robot.title or model.robot.name
    return report_html(
        f"The parameters that {task.name} needs",
        sections,
        lead=f"A smaller model of the {robot}, chosen by the error to be expected over the task.",
        footer=f"Taskcal {version}; robot {model.robot.name}; measured: {measured}.",
    )


_EFFECTS = (
    "Over the task's poses, along the robot's base axes and in space. What acts much is not always needed: a parameter "
    "may repeat others, or move the task as the tracker's frame and the targets do."
)
