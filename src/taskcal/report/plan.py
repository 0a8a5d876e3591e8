"""A plan as a page: its expected error, its poses, and rejected candidates."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from taskcal.planning.plan import Plan
from taskcal.report.chart import BLUE, GREEN, GREY, INK, ORANGE, VERMILION, Axis, Figure, Level, Panel, Series
from taskcal.report.content import (
    NOMINAL,
    Chart,
    Column,
    Numbers,
    Scene,
    Section,
    Table,
    millimetres,
    state_model_error,
)
from taskcal.report.page import Page
from taskcal.report.scene import (
    MAX_POSES,
    coloured_points,
    draw_robot,
    robot_look,
    spread_rows,
    strokes,
    workspace_layer,
)
from taskcal.robot.error_model import ErrorModel
from taskcal.task.task import Task
from taskcal.task.workspace import Workspace

# Expected error of a plan: over the number of poses, and beside random and space-filling plans.

COUNTS = (5, 8, 10, 12, 15, 20, 25, 30, 40, 50, 60, 80, 100, 150, 200, 300, 500)
"""Numbers of poses whose expected error is tabulated."""

MAX_OVER_BEFORE = 3.0
"""Errors that are drawn, over that before: the first few poses do not even determine the frames, and would take all the room."""


def _start(plan: Plan) -> str:
    """The model before the plan is measured, in words."""
    if plan.extends:
        return "calibration as it is"
    return f"nominal, {plan.instrument.label}s found" if plan.of is not None and plan.instrument.label else NOMINAL


def draw_by_count(plan: Plan) -> Figure:
    """Draw the expected error over the number of poses, with random and space-filling plans of the same size beside it."""
    count, error = len(plan.q), plan.by_count * 1e3
    shown = error <= MAX_OVER_BEFORE * plan.before * 1e3
    numbers = np.arange(1, len(error) + 1)
    low, mean, high = (1e3 * value for value in (plan.random.min(), plan.random.mean(), plan.random.max()))
    random = f"random poses: mean and range of {len(plan.random)} plans"
    filling, this = "space-filling poses", "this plan, after exchange and refinement"
    series = (
        Series(kind="line", name="greedy selection", x=numbers[shown], y=error[shown]),
        Series(name=random, x=[count], y=[mean], low=[low], high=[high], colour=ORANGE, shape="square"),
        Series(name=filling, x=[count], y=[1e3 * plan.grid], colour=GREEN, shape="triangle"),
        Series(name=this, x=[count], y=[1e3 * plan.expected], colour=VERMILION, shape="diamond"),
    )
    levels = [Level(at=plan.before * 1e3, name=_start(plan))]
    if plan.geometry_allowance:
        less = ", less the model error" if plan.model_error else ""
        level = Level(at=plan.geometry_allowance * 1e3, name=f"accuracy that the task needs{less}", colour=INK)
        levels.append(level)
    x = Axis(title="measured poses", span=(0.0, count * 1.03))
    y = Axis(title="expected error, rms", unit="mm", log=True)
    return Figure(panels=(Panel(x=x, y=y, series=series, levels=tuple(levels), height=320.0),))


def tabulate_expected_errors(plan: Plan, task: str, *, measured_before: int = 0) -> Table:
    """Tabulate the expected error after this plan, beside other poses and none.

    Args:
        plan: the plan.
        task: the task's name.
        measured_before: rows that are there already.
    """
    low, high = plan.random.min() * 1e3, plan.random.max() * 1e3
    added = f" added to {measured_before}" if measured_before else ""
    rows = [
        ("this plan", f"{plan.expected * 1e3:.3f}", ""),
        ("random poses", f"{plan.random.mean() * 1e3:.3f}", f"{low:.3f} to {high:.3f}"),
        ("space-filling poses", f"{plan.grid * 1e3:.3f}", ""),
        (_start(plan), f"{plan.before * 1e3:.3f}", ""),
    ]
    return Table.of_rows(
        f"Expected 3D rms error over task '{task}', {len(plan.q)} poses{added}, mm",
        ("", "expected", f"range of {len(plan.random)} plans"),
        rows,
    )


def tabulate_by_count(plan: Plan) -> Table:
    """Tabulate the expected error after so many poses of the greedy choice, as far as it is below that of none."""
    count = len(plan.q)
    shown = sorted({n for n in COUNTS if n < count} | {count})
    return Table.of(
        "Expected error against number of poses (greedy selection)",
        (Column("poses", lambda n: n, "d"), millimetres("expected mm", lambda n: plan.by_count[n - 1])),
        [n for n in shown if plan.by_count[n - 1] < plan.before],
    )


# A plan in space.

STEM = 0.04
"""Length at which the tool's axis is drawn, over the robot's reach."""


def plan_scene(model: ErrorModel, plan: Plan, space: Workspace | None) -> Scene:
    """Draw the robot at the planned poses, the path between them, and the task's workspace.

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
        strokes("path from pose to pose", [points], GREY, width=1, dash=True),
        strokes("axis of the tool", stems, BLUE),
        coloured_points(
            f"TCPs, dark 0 to bright {last} in the order of measuring",
            points,
            np.arange(len(points), dtype=float),
            (0.0, float(max(last, 1))),
            [f"pose {k}" for k in range(len(points))],
        ),
    ]
    if plan.of is not None and plan.instrument.label:
        fixtures = plan.instrument.fixtures
        numbers = np.arange(len(fixtures.names), dtype=float)
        poses = [f"{name}, {plan.names.count(name)} poses" for name in fixtures.names]
        label = f"{plan.instrument.label}s, dark first to bright last"
        layers.append(coloured_points(label, fixtures.position, numbers, (0.0, float(max(len(numbers) - 1, 1))), poses))
    if space is not None:
        layers.append(workspace_layer(space))
    rows = spread_rows(len(points), MAX_POSES)
    return Scene(
        title="The robot at the planned poses",
        poses=draw_robot(robot, plan.q[rows], [f"id {row}" for row in rows]),
        look=robot_look(robot),
        layers=tuple(layers),
        floor=True,
        note="Poses all around the workspace, with many tool orientations, determine the most. A bare side is out of the robot's "
        "reach, or not visible from the tracker. In the base frame.",
    )


def plan_page(model: ErrorModel, task: Task, plan: Plan, *, seed: int) -> Page:
    """Make the page of a plan.

    Args:
        model: the model that is to be identified.
        task: what the plan is for.
        plan: the plan.
        seed: of the plan, for the footer.
    """
    error = (
        f"Model error: {state_model_error(plan.model_error * 1e3, plan.model_error_origin)}. It counts as noise of the "
        f"measurements; with it the expected error of a single pose is {plan.expected_at_a_pose * 1e3:.3f} mm."
    )
    by_count = Chart(
        "Expected error against the number of measured poses",
        draw_by_count(plan),
        "Beyond the plateau, more poses add little. The line is the greedy choice; exchange and refinement improve the plan "
        "at its end. Logarithmic scale.",
    )
    table = tabulate_expected_errors(plan, task.name)
    blocks = (Numbers(*_numbers(plan)), table, error, _meaning(plan), by_count, tabulate_by_count(plan))
    poses = (plan_scene(model, plan, task.workspace), _tabulate_poses(model, plan), _tabulate_candidates(plan))
    robot = model.robot.title or model.robot.name
    return Page(
        title=f"Measurement poses for {task.name}",
        sections=(Section("Expected error of the plan", *blocks), Section("Measurement poses", *poses)),
        lead=f"{len(plan.q)} poses of the {robot}, chosen among {plan.candidates} feasible ones.",
        source=f"robot {model.robot.name}; criterion {plan.criterion}; seed {seed}",
    )


def _meaning(plan: Plan) -> str:
    """Definition of expected errors, and of the plans that they are compared with."""
    sources = "calibration covariance, model error and noise" if plan.extends else "tolerances, model error and noise"
    if plan.of is not None:
        fixture = plan.instrument.label or "fixture"
        return (
            "Expected errors are 3D rms over the task, of the tool's load and independent of where the robot's base is, from "
            f"{sources}; no robot is simulated. The position of every {fixture}, and of the target on the tool, "
            "counts as unknown. Random and space-filling poses are chosen among the feasible ones."
        )
    return (
        f"Expected errors are 3D rms over the task, of the measured targets in the tracker frame, from {sources}; no robot is "
        "simulated. Random and space-filling poses are within the task's workspace; the plan may leave it a little and turn the "
        "tool farther, which is where much of its advantage comes from."
    )


def _numbers(plan: Plan) -> tuple[tuple[str, str, str], ...]:
    items = [
        (f"{plan.expected * 1e3:.3f}", "mm", "expected error after measuring this plan"),
        (f"{plan.random.mean() * 1e3:.3f}", "mm", "expected after as many random poses, mean"),
        (f"{plan.before * 1e3:.3f}", "mm", f"expected before: {_start(plan)}"),
    ]
    if plan.accuracy is not None and plan.geometry_allowance is not None:
        enough = plan.enough
        if enough is None and plan.expected <= plan.geometry_allowance:
            enough = len(plan.q)
        reached = f"poses are enough for the task's {plan.accuracy * 1e3:g} mm, model error included"
        missed = f"of these sizes reaches {plan.accuracy * 1e3:g} mm, model error included"
        items.append((str(enough), "", reached) if enough else ("none", "", missed))
    return tuple(items)


def _tabulate_poses(model: ErrorModel, plan: Plan) -> Table:
    slides = model.robot.prismatic
    q = plan.q * np.where(slides, 1e3, 180.0 / np.pi)
    joints = [f"{name} ({'mm' if s else '°'})" for name, s in zip(model.robot.joint_names, slides, strict=True)]
    columns = [
        Column("id", lambda k: k, "d"),
        *(Column(name, q[:, j].__getitem__, ".2f") for j, name in enumerate(joints)),
    ]
    if plan.of is not None and plan.instrument.label:
        columns.append(Column(plan.instrument.label, plan.names.__getitem__, "s"))
    elif plan.visible.shape[1] > 1:
        columns.append(Column("reflectors seen", lambda k: int(plan.visible[k].sum()), "d"))
    columns += [Column(name.replace("_", " "), values.__getitem__, ".0f") for name, values in plan.views.items()]
    return Table.of(f"All {len(q)} poses", columns, range(len(q)), folded=True)


def _tabulate_candidates(plan: Plan) -> Table:
    rows = [("feasible", str(plan.candidates)), *((f"rejected: {reason}", str(n)) for reason, n in plan.lost.items())]
    return Table.of_rows("Candidates", ("", "poses"), rows, note="Rejected candidates are counted by the first reason.")
