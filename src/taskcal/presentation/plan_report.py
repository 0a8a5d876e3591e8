"""A plan as a page: what it is worth, where its poses are, and what fell away."""

import numpy as np

from taskcal.adaptation.planned import Plan
from taskcal.presentation.content import Chart, Numbers, Section, Table, Text
from taskcal.presentation.model_error_origin import state_model_error
from taskcal.presentation.plan_figures import draw_by_count
from taskcal.presentation.plan_scene import plan_scene
from taskcal.presentation.plan_tables import tabulate_by_count, tabulate_expected_errors
from taskcal.presentation.report import Page
from taskcal.robot.error_model import ErrorModel
from taskcal.task.task import Task


def plan_page(model: ErrorModel, task: Task, plan: Plan, *, seed: int, version: str) -> Page:
    """The page of a plan.

    Args:
        model: the model that is to be identified.
        task: what the plan is for.
        plan: the plan.
        seed: of the plan, for the footer.
        version: of the package, for the footer.
    """
    sections = [
        Section(
            title="What it is worth",
            blocks=(
                Numbers(_numbers(plan)),
                tabulate_expected_errors(plan, task.name),
                Text(
                    (
                        f"Model error: {state_model_error(plan.model_error * 1e3, plan.model_error_origin)}. It counts as noise of "
                        f"the measurements; with it a single pose is expected to be {plan.expected_at_a_pose * 1e3:.3f} mm off. ",
                        _meaning(plan),
                    )
                ),
                Chart(
                    title="Expected error over the number of measured poses",
                    figure=draw_by_count(plan),
                    note="Where the line goes flat, more poses buy little. It is the greedy choice; exchange and "
                    "refinement improve the plan at its end. Logarithmic scale.",
                ),
                tabulate_by_count(plan),
            ),
        ),
        Section(
            title="The poses",
            blocks=(
                plan_scene(model, plan, task.workspace),
                _joints(model, plan),
                _lost(plan),
            ),
        ),
    ]
    robot = model.robot.title or model.robot.name
    return Page(
        title=f"Measuring poses for {task.name}",
        sections=tuple(sections),
        lead=f"{len(plan.q)} poses of the {robot}, chosen among {plan.candidates} that can be measured.",
        footer=f"Taskcal {version}; robot {model.robot.name}; criterion {plan.criterion}; seed {seed}.",
    )


def _meaning(plan: Plan) -> str:
    """What expected errors are of, and what the poses that nobody chose are."""
    if plan.way is not None:
        return (
            "Expected errors are root mean squares in space over the task, of what the tool carries, wherever the robot's base "
            f"stands, from {_sources(plan)} alone: no true robot is simulated. Where every {plan.way.label} stands, and where "
            "the tool carries what is measured, counts as unknown. Random poses and poses spread evenly are of those that can "
            "be measured."
        )
    return (
        "Expected errors are root mean squares in space over the task, of the measured targets in the tracker's "
        f"frame, from {_sources(plan)} alone: no true robot is simulated. Random poses and poses spread "
        "evenly lie in the task's own workspace; the plan may leave it a little and turn the tool farther, which "
        "is where much of its advantage comes from."
    )


def _sources(plan: Plan) -> str:
    return (
        "the calibration's covariance, its model error and noise"
        if plan.extends
        else "tolerances, model error and noise"
    )


def _numbers(plan: Plan) -> tuple[tuple[str, str, str], ...]:
    items = [
        (f"{plan.expected * 1e3:.3f}", "mm", "expected after measuring this plan"),
        (f"{plan.random.mean() * 1e3:.3f}", "mm", "expected after as many random poses, on average"),
        (f"{plan.before * 1e3:.3f}", "mm", "expected of the calibration as it is")
        if plan.extends
        else (
            f"{plan.before * 1e3:.3f}",
            "mm",
            f"expected of the nominal robot, {_found(plan)} found from the same poses",
        ),
    ]
    if plan.accuracy is not None and plan.geometry_allowance is not None:
        enough = plan.enough
        if enough is None and plan.expected <= plan.geometry_allowance:
            enough = len(plan.q)
        reached = f"poses are enough for the task's {plan.accuracy * 1e3:g} mm, with the model error"
        missed = f"of these sizes reaches {plan.accuracy * 1e3:g} mm with the model error"
        items.append((str(enough), "", reached) if enough else ("none", "", missed))
    return tuple(items)


def _found(plan: Plan) -> str:
    return "frames" if plan.way is None else f"{plan.way.label}s"


def _joints(model: ErrorModel, plan: Plan) -> Table:
    slides = np.asarray(model.robot.prismatic)
    q = plan.q * np.where(slides, 1e3, 180.0 / np.pi)
    units = ["mm" if s else "°" for s in slides]
    rows = [(str(k), *(f"{value:.2f}" for value in row), *_seen(plan, k)) for k, row in enumerate(q)]
    header = ("id", *(f"{name} ({unit})" for name, unit in zip(model.robot.joint_names, units, strict=True)))
    if plan.way is not None:
        header = (*header, plan.way.label)
    elif plan.visible.shape[1] > 1:
        header = (*header, "reflectors seen")
    return Table.of_rows(f"All {len(rows)} poses", header, rows, text_columns=(), folded=True)


def _seen(plan: Plan, pose: int) -> tuple[str, ...]:
    """What is measured at a pose, or of how much, where that may differ."""
    if plan.way is not None:
        return (plan.names[pose],)
    return (str(int(plan.visible[pose].sum())),) if plan.visible.shape[1] > 1 else ()


def _lost(plan: Plan) -> Table:
    rows = [("can be measured", str(plan.candidates)), *((reason, str(number)) for reason, number in plan.lost.items())]
    return Table.of_rows(
        "Candidates", ("", "poses"), rows, note="Those that fell away are counted by the first reason found."
    )
