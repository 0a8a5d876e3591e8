"""A plan as a page: what it is worth, where its poses are, and what fell away."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import plotly.graph_objects as go

from taskcal.planning.plan import Plan
from taskcal.report.content import Chart, Numbers, Scene, Section, Table, Text, state_model_error
from taskcal.report.page import Page
from taskcal.report.scene import (
    MAX_POSES,
    coloured_points,
    draw_robot,
    link_radius,
    spread_rows,
    to_mm,
    workspace_layer,
)
from taskcal.report.theme import BLUE, GREEN, GREY, INK, ORANGE, VERMILION, styled, with_decades
from taskcal.robot.error_model import ErrorModel
from taskcal.task.task import Task
from taskcal.task.workspace import Workspace

# Figures of a plan: the error to be expected from so many poses, and where they are.


def draw_by_count(plan: Plan) -> go.Figure:
    """Expected error over the number of poses, with random and even plans of the same size beside it."""
    figure = go.Figure()
    count = len(plan.q)
    numbers = np.arange(1, len(plan.by_count) + 1)
    error = plan.by_count * 1e3
    # the first few poses do not even find the frames; what is worse than before is not worth the room
    shown = error <= 3.0 * plan.before * 1e3
    figure.add_scatter(
        x=numbers[shown],
        y=error[shown],
        mode="lines+markers",
        name="chosen one by one",
        line={"color": BLUE, "width": 2.5},
        marker={"size": 5},
        hovertemplate="%{x} poses: %{y:.3f} mm<extra>chosen one by one</extra>",
    )
    low, mean, high = plan.random.min() * 1e3, plan.random.mean() * 1e3, plan.random.max() * 1e3
    figure.add_scatter(
        x=[count],
        y=[mean],
        error_y={"symmetric": False, "array": [high - mean], "arrayminus": [mean - low], "width": 6, "thickness": 1.8},
        mode="markers",
        name=f"random poses: mean and range of {len(plan.random)} plans",
        marker={"color": ORANGE, "symbol": "square", "size": 10},
        hovertemplate="%{y:.3f} mm<extra>random poses</extra>",
    )
    for value, name, colour, symbol in (
        (plan.grid, "poses spread evenly", GREEN, "triangle-up"),
        (plan.expected, "this plan, after exchange and refinement", VERMILION, "diamond"),
    ):
        figure.add_scatter(
            x=[count],
            y=[value * 1e3],
            mode="markers",
            name=name,
            marker={"color": colour, "symbol": symbol, "size": 12},
            hovertemplate="%{y:.3f} mm<extra>" + name + "</extra>",
        )
    found = "frames" if plan.way is None else f"{plan.way.label}s"
    start = "calibration as it is" if plan.extends else f"nominal robot, {found} found"
    levels = [(plan.before, start, GREY, "dot")]
    if plan.geometry_allowance:
        less = ", less the model error" if plan.model_error else ""
        levels.append((plan.geometry_allowance, f"accuracy that the task needs{less}", INK, "dash"))
    for value, name, colour, dash in levels:
        figure.add_scatter(
            x=[0, count * 1.03],
            y=[value * 1e3] * 2,
            mode="lines",
            name=name,
            line={"color": colour, "dash": dash, "width": 1.5},
            hoverinfo="skip",
        )
    styled(figure, height=480, top=110)
    figure.update_xaxes(title_text="measured poses", range=[0, count * 1.03])
    with_decades(figure, "expected error (mm, rms)")
    return figure


# A plan's tables, for the terminal and for its page.

COUNTS = (5, 8, 10, 12, 15, 20, 25, 30, 40, 50, 60, 80, 100, 150, 200, 300, 500)
"""Numbers of poses whose expected error is shown."""


def tabulate_expected_errors(plan: Plan, task: str, *, measured_before: int = 0) -> Table:
    """What the plan is expected to leave over the task, beside other poses and none.

    Args:
        plan: the plan.
        task: the task's name.
        measured_before: rows that are there already.
    """
    low, high = plan.random.min() * 1e3, plan.random.max() * 1e3
    added = f" added to {measured_before}" if measured_before else ""
    found = "frames" if plan.way is None else f"{plan.way.label}s"
    before = "calibration as it is" if plan.extends else f"nominal robot, {found} found"
    rows = [
        ("this plan", f"{plan.expected * 1e3:.3f}", ""),
        ("random poses", f"{plan.random.mean() * 1e3:.3f}", f"{low:.3f} to {high:.3f}"),
        ("poses spread evenly", f"{plan.grid * 1e3:.3f}", ""),
        (before, f"{plan.before * 1e3:.3f}", ""),
    ]
    return Table.of_rows(
        f"Error to be expected over '{task}' from {len(plan.q)} poses{added}: rms in space, mm",
        ("", "expected", f"range of {len(plan.random)} plans"),
        rows,
    )


def tabulate_by_count(plan: Plan) -> Table:
    """Expected error after so many poses of the greedy choice, as far as it is below that of none."""
    count = len(plan.q)
    shown = sorted({n for n in COUNTS if n < count} | {count})
    errors = [(n, plan.by_count[n - 1]) for n in shown if plan.by_count[n - 1] < plan.before]
    return Table.of_rows(
        "After so many poses, chosen one by one",
        ("poses", "expected"),
        [(str(n), f"{error * 1e3:.3f}") for n, error in errors],
        text_columns=(),
    )


# A plan in space: the robot at the planned poses, the way between them, and the task's workspace.

STEM = 0.04
"""Length at which the tool's axis is drawn, over the robot's reach."""


def plan_scene(model: ErrorModel, plan: Plan, space: Workspace | None) -> Scene:
    """The scene.

    Args:
        model: the robot's.
        plan: the poses, in the order in which to measure them.
        space: the task's workspace; None for a list of poses or a path.
    """
    T, robot = model.poses(plan.q), model.robot
    points, axes = T[:, :3, 3], T[:, :3, 2]
    last = len(points) - 1
    stems = np.stack([points - STEM * robot.reach * axes, points], axis=1)
    layers: list[Mapping[str, Any]] = [
        {
            "kind": "strokes",
            "label": "way from pose to pose",
            "colour": GREY,
            "width": 1,
            "dash": True,
            "at": [to_mm(points)],
        },
        {
            "kind": "strokes",
            "label": "axis of the tool",
            "colour": BLUE,
            "width": 2,
            "at": [to_mm(stem) for stem in stems],
        },
        coloured_points(
            f"tool points, dark 0 to bright {last} in the order of measuring",
            points,
            np.arange(len(points), dtype=float),
            (0.0, float(max(last, 1))),
            [f"pose {k}" for k in range(len(points))],
        ),
    ]
    if plan.way is not None:
        stands = plan.way.standing
        numbers = np.arange(len(stands.names), dtype=float)
        poses = [f"{name}, {plan.names.count(name)} poses" for name in stands.names]
        label = f"{plan.way.label}s, dark first to bright last"
        layers.append(coloured_points(label, stands.position, numbers, (0.0, float(max(len(numbers) - 1, 1))), poses))
    if space is not None:
        layers.append(workspace_layer(space))
    rows = spread_rows(len(points), MAX_POSES)
    return Scene(
        title="The planned poses, and the robot at them",
        poses=draw_robot(robot, plan.q[rows], [f"id {row}" for row in rows]),
        radius=link_radius(robot) * 1e3,
        layers=tuple(layers),
        floor=True,
        note="Poses all around the workspace, with the tool turned to many sides, tell the most; a bare side is one that the "
        "robot does not reach, or that the tracker does not see. In the robot's base.",
    )


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
