"""A study as a page: the spread of the task error, and its quantiles."""

from taskcal.adaptation.study import Study
from taskcal.presentation.content import Chart, Section, Text
from taskcal.presentation.model_error_origin import state_model_error
from taskcal.presentation.report import report_html
from taskcal.presentation.study_figures import draw_study
from taskcal.presentation.study_table import tabulate_study
from taskcal.robot.error_model import ErrorModel
from taskcal.task.task import Task


def study_html(model: ErrorModel, task: Task, study: Study, *, version: str) -> str:
    """The page of a study.

    Args:
        model: the model that the robots were drawn from.
        task: what they have to do.
        study: what it found.
        version: of the package, for the footer.
    """
    error = state_model_error(study.model_error * 1e3, study.model_error_origin)
    sections = [
        Section(
            title="Error over the task",
            blocks=(
                Text(
                    (
                        f"Each robot is virtual, {study.origin}, measured by every plan with the tracker's noise, identified, and "
                        "compared with the truth over the task in the tracker's frame.",
                        f"Model error: {error}. Every robot has it in its measurements; the column at a pose has it at the task's "
                        "poses too, and the accuracy is judged by that. It is white noise here, while on a real robot it is "
                        "alike at neighbouring poses.",
                    )
                ),
                Chart(
                    title="Task error over all robots",
                    figure=draw_study(study),
                    note="Boxes from the first to the third quartile with the median in them. Logarithmic scale.",
                ),
                tabulate_study(study, task.name),
            ),
        )
    ]
    robot = model.robot.title or model.robot.name
    return report_html(
        f"Study of {task.name}",
        sections,
        lead=f"{study.robots} virtual robots of the kind {robot}.",
        footer=f"Taskcal {version}; robot {model.robot.name}; seed {study.seed}.",
    )
