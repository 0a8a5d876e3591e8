"""A study as a page: the spread of the task error, and its quantiles."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import plotly.graph_objects as go

from taskcal.planning.study import Study
from taskcal.report.content import Chart, Section, Table, Text, state_model_error
from taskcal.report.page import Page
from taskcal.report.theme import GREY, SERIES, styled, with_decades
from taskcal.robot.error_model import ErrorModel
from taskcal.task.task import Task

# The figure of a study: how the task error spreads over virtual robots.


def draw_study(study: Study) -> go.Figure:
    """A box of rms errors of the geometry over all robots for every plan, number of poses and model.

    A line shows what the accuracy that the task needs leaves to the geometry, beside the model error of a single pose.
    """
    figure = go.Figure()
    models = list(dict.fromkeys(row["model"] for row in study.rows))
    for k, model in enumerate(models):
        of_model = [row for row in study.rows if row["model"] == model]
        figure.add_box(
            x=[[f"{row['count']} poses" for row in of_model], [_label(study, row) for row in of_model]],
            y=[row["rms_mm"] for row in of_model],
            name=model,
            marker={"color": SERIES[(k + 1) % len(SERIES)], "size": 4},
            line={"width": 1.5},
            boxpoints="all" if study.robots <= 40 else "outliers",
            jitter=0.4,
            hovertemplate="%{y:.3f} mm<extra>" + model + "</extra>",
        )
    styled(figure, height=500, legend=len(models) > 1, top=90)
    figure.update_layout(boxmode="group")
    figure.update_xaxes(showgrid=False)
    with_decades(figure, "true task error (mm, rms)")
    if study.geometry_allowance:
        allowed = study.geometry_allowance * 1e3
        figure.add_hline(y=allowed, line={"color": GREY, "dash": "dash", "width": 1.5})
        figure.add_annotation(
            text=f"accuracy that the task needs{', less the model error' if study.model_error else ''}",
            xref="paper",
            x=1.0,
            xanchor="right",
            y=float(np.log10(allowed)),  # annotations of a logarithmic axis are placed by the logarithm
            yanchor="bottom",
            showarrow=False,
            font={"size": 13, "color": GREY},
        )
    return figure


def _label(study: Study, row: Mapping[str, Any]) -> str:
    """Of a box: the plan, or what was measured by."""
    return f"{row['observe']}, {row['plan']}" if study.aligned else row["plan"]


# The errors of a study, for the terminal and for its page.

ERRORS = {
    "median_mm": "median",
    "p05_mm": "5 % below",
    "p95_mm": "95 % below",
    "rms_mm": "rms",
    "rms_with_model_error_mm": "at a pose",
}
"""Columns of `Study.summary`, and what they are called."""


def tabulate_study(study: Study, task: str) -> Table:
    """Quantiles over the robots for each way to measure, plan, number of poses and model.

    Args:
        study: what it found.
        task: the task's name.
    """
    within = () if study.accuracy is None else (f"within {study.accuracy * 1e3:g} mm",)
    several = study.aligned
    rows = [
        (
            *((line["observe"],) if several else ()),
            line["plan"],
            str(line["count"]),
            line["model"],
            *(f"{line[key]:.3f}" for key in ERRORS),
            *((f"{line['share_accurate']:.0%}",) if within else ()),
        )
        for line in study.summary()
    ]
    return Table.of_rows(
        f"True error of the identified geometry over '{task}', {study.robots} virtual robots: rms in space, mm",
        (*(("measured by",) if several else ()), "plan", "poses", "model", *ERRORS.values(), *within),
        rows,
        text_columns=(0, 1, 3) if several else (0, 2),
    )


def describe_unlearnt(study: Study) -> str:
    """What stands for robots of which nothing was learnt."""
    return (
        f"from {study.unlearnt} of {len(study.rows)} campaigns, whose rows no parameter explains beside the model error: the "
        "nominal robot with its frames found stands for them; more poses would tell"
    )


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
