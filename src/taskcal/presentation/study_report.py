"""A study as a page: the spread of the task error, and its quantiles."""

from taskcal.adaptation.study import Study
from taskcal.presentation.content import Chart, Section, Table, Text
from taskcal.presentation.model_error_origin import state_model_error
from taskcal.presentation.report import report_html
from taskcal.presentation.study_figures import draw_study
from taskcal.robot.error_model import ErrorModel
from taskcal.task.task import Task


def study_html(model: ErrorModel, task: Task, made: Study, *, version: str) -> str:
    """The page of a study.

    Args:
        model: the model that the robots were drawn from.
        task: what they have to do.
        made: the study.
        version: of the package, for the footer.
    """
    rows = [
        (
            line["plan"],
            str(line["count"]),
            line["model"],
            *(f"{line[key]:.4f}" for key in ("median_mm", "p05_mm", "p95_mm", "rms_mm", "rms_with_model_error_mm")),
        )
        for line in made.summary()
    ]
    sections = [
        Section(
            title="Error over the task",
            blocks=(
                Text(
                    (
                        "Each robot is drawn from the tolerances, measured by every plan with the tracker's noise, identified, and "
                        "compared with the truth over the task in the tracker's frame.",
                        f"Model error: {state_model_error(made.model_error * 1e3, made.model_error_origin)}. Every robot has it in "
                        "its measurements; the last column has it at the task's poses too. It is white noise here, while on a real "
                        "robot it is alike at neighbouring poses.",
                    )
                ),
                Chart(
                    title="Task error over all robots",
                    figure=draw_study(made, task.accuracy),
                    note="Boxes from the first to the third quartile with the median in them. Logarithmic scale.",
                ),
                Table.of_rows(
                    "Root mean square error over the task (mm), over the robots",
                    ("plan", "poses", "model", "median", "5 % below", "95 % below", "rms", "with the model error"),
                    rows,
                    text_columns=(0, 2),
                ),
            ),
        )
    ]
    robot = model.robot.title or model.robot.name
    return report_html(
        f"Study of {task.name}",
        sections,
        lead=f"{made.robots} virtual robots of the kind {robot}.",
        footer=f"Taskcal {version}; robot {model.robot.name}; seed {made.seed}.",
    )
