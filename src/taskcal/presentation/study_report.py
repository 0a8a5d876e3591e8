"""A study as a page: the spread of the task error, and its quantiles."""

import numpy as np

from taskcal.adaptation.study import Study
from taskcal.presentation.content import Chart, Section, Text
from taskcal.presentation.model_error_origin import state_model_error
from taskcal.presentation.report import Page
from taskcal.presentation.study_figures import draw_study
from taskcal.presentation.study_table import describe_unlearnt, tabulate_study
from taskcal.robot.error_model import ErrorModel
from taskcal.task.task import Task


def study_page(model: ErrorModel, task: Task, study: Study, *, version: str) -> Page:
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
                        f"Each robot is virtual, {study.origin}, measured by every plan with the noise of what it is measured by, "
                        f"identified, and compared with the truth over the task {_frame(study)}.",
                        f"Model error: {error}. Every robot has it in its measurements; the column at a pose has it at the task's "
                        "poses too, and the accuracy is judged by that. It is white noise here, while on a real robot it is "
                        "alike at neighbouring poses.",
                    )
                ),
                Chart(
                    title="Task error over all robots",
                    figure=draw_study(study),
                    note="The lower a box, the better; a long one leaves much to chance. Boxes from the first to the "
                    "third quartile with the median in them. Logarithmic scale.",
                ),
                tabulate_study(study, task.name),
            ),
        )
    ]
    robot = model.robot.title or model.robot.name
    unlearnt = f" Nothing was learnt {describe_unlearnt(study)}." if study.unlearnt else ""
    return Page(
        title=f"Study of {task.name}",
        sections=tuple(sections),
        lead=f"{study.robots} virtual robots of the kind {robot}.{unlearnt}",
        footer=f"Taskcal {version}; robot {model.robot.name}; seed {study.seed}.",
    )


def _frame(study: Study) -> str:
    """In which errors are, in words."""
    if not study.aligned:
        return "in the tracker's frame"
    before = 1e3 * float(np.median(study.before))
    return (
        "once the work's frame and the tool point were taught with the calibrated robot, so that all ways to measure are judged "
        f"alike; a robot that is not calibrated is off by {before:.2f} mm then (median)"
    )
