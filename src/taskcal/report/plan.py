"""A plan as a page: its expected error, its poses, and rejected candidates."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from taskcal.errors import listed
from taskcal.planning.plan import Plan, describe_accuracy, describe_lost
from taskcal.report.chart import BLUE, GREEN, GREY, INK, ORANGE, VERMILION, Axis, Figure, Level, Panel, Series
from taskcal.report.content import (
    NOMINAL,
    Chart,
    Column,
    Facts,
    Points,
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
from taskcal.robot.robot import Robot
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


Clearance = Mapping[str, "list[float] | None"]
"""Gaps at each pose, millimetres: ``between_links`` and ``to_keep_out``; None where there is nothing to keep clear of."""


def plan_sections(
    model: ErrorModel,
    task: Task,
    plan: Plan,
    *,
    measured_before: int = 0,
    clearance: Clearance | None = None,
    reflectors: Sequence[int] | None = None,
    stated: bool = False,
) -> tuple[Section, ...]:
    """Make the sections of what a plan is expected to give, and without a tracker of how to measure it.

    Args:
        model: the model that is to be identified.
        task: what the plan is for.
        plan: the plan.
        measured_before: rows that are there already.
        clearance: at each pose; None without a tracker.
        reflectors: how many of them are seen at each pose, where a station says so.
        stated: whether a file states the fixtures of a plan without a tracker.
    """
    expected = Section(
        "Expected error of the plan",
        tabulate_expected_errors(plan, task.name, measured_before=measured_before),
        Facts(
            ("accuracy", describe_accuracy(plan)),
            ("model error", state_model_error(plan.model_error * 1e3, plan.model_error_origin)),
            (
                "single pose",
                f"expected error {plan.expected_at_a_pose * 1e3:.3f} mm (3D rms), model error included",
            ),
            ("candidates", f"{plan.candidates} feasible; rejected: {describe_lost(plan) or 'none'}"),
            ("reflectors", f"{_span(reflectors)} visible at each pose") if reflectors is not None else None,
            ("images", _views_in_words(plan)) if plan.views else None,
            ("clearance", _clearance_in_words(clearance, model.robot)) if clearance is not None else None,
            ("criterion", f"{plan.criterion}; {plan.exchanges} exchanges after the greedy start"),
        ),
        _meaning(plan),
        Chart(
            "Expected error against the number of measured poses",
            draw_by_count(plan),
            "Beyond the plateau, more poses add little. The line is the greedy choice; exchange and refinement improve the plan "
            "at its end. Logarithmic scale.",
        ),
        tabulate_by_count(plan),
    )
    return (expected,) if plan.of is None else (expected, _how_to_measure(plan, model.robot, stated=stated))


def _span(counts: Sequence[int]) -> str:
    return f"{min(counts)} to {max(counts)}" if min(counts) < max(counts) else str(max(counts))


def _views_in_words(plan: Plan) -> str:
    """The least and the largest of each figure of the poses."""
    units = {"mm": " mm", "deg": "°"}
    out: list[str] = []
    for name, values in plan.views.items():
        what, _, unit = name.rpartition("_")
        shown = f"{values.min():.0f} to {values.max():.0f}{units.get(unit, '')}"
        out.append(f"{what or name} {shown}")
    return ", ".join(out)


def _clearance_in_words(clearance: Clearance, robot: Robot) -> str:
    """The least gaps of all poses, and of what."""
    radii = robot.link_radii
    if radii is None:
        return "not checked: the robot file states no link_radii_mm"
    said = {"between_links": "between links", "to_keep_out": "to keep-out boxes"}
    gaps = [f"{min(gap):.0f} mm {said[name]}" for name, gap in clearance.items() if gap]
    return f"at least {', '.join(gaps) or '–'}; links as capsules of {min(radii) * 1e3:g} to {max(radii) * 1e3:g} mm radius"


# How a plan without a tracker is measured: fixtures, what to check, what to write down.

MAX_NAMED = 12
"""Poses that a statement names."""


def _how_to_measure(plan: Plan, robot: Robot, *, stated: bool) -> Section:
    """The fixtures with their numbers of poses, and what to check and to write down."""
    instrument = plan.instrument
    x, y, z = instrument.T_tool_tip[:3, 3] * 1e3
    round_about, none = (
        [one.pose for one in plan.blocked if (one.via is not None) == found] for found in (True, False)
    )
    said = [
        instrument.instructions,
        f"default {instrument.label} positions assumed: place them as listed, or state theirs and plan again"
        if instrument.label and not stated
        else "",
        f"mounting on the tool assumed at {x:g}, {y:g}, {z:g} mm in the tool frame (--mounted-mm)",
        "collisions not checked: the robot file states no link_radii_mm; drive the plan slowly"
        if robot.link_radii is None
        else "collisions of the links with each other, blocks and keep-out boxes were checked, between poses, too; cables, tool "
        "and cell were not: drive slowly",
        f"not clear from the previous pose by a joint motion: {listed(round_about, MAX_NAMED)}; a program takes a way around"
        if round_about
        else "",
        f"not clear from the previous pose, and no way around found: {listed(none, MAX_NAMED)}; drive there by hand, not by a "
        "program"
        if none
        else "",
    ]
    table = _tabulate_fixtures(plan, "as stated" if stated else "assumed") if instrument.label else None
    return Section("How to measure", table, Points(*filter(None, said)))


def _tabulate_fixtures(plan: Plan, whose: str) -> Table:
    instrument, fixtures = plan.instrument, plan.instrument.fixtures
    turned = instrument.directed
    columns = (
        Column(instrument.label, fixtures.names.__getitem__),
        *(Column(f"{axis}_mm", lambda k, i=i: fixtures.position[k, i], ".0f", 1e3) for i, axis in enumerate("xyz")),
        *(Column(axis, lambda k, i=i: fixtures.direction[k, i], ".2f") for i, axis in enumerate("ijk") if turned),
        Column("poses", lambda k: plan.names.count(fixtures.names[k]), "d"),
    )
    title = f"Positions of the {instrument.label}s in the base frame, {whose}, mm{', and their directions' if turned else ''}"
    return Table.of(title, columns, range(len(fixtures.names)))


def plan_page(model: ErrorModel, task: Task, plan: Plan, sections: Sequence[Section], *, seed: int) -> Page:
    """Make the page of a plan.

    Args:
        model: the model that is to be identified.
        task: what the plan is for.
        plan: the plan.
        sections: as `plan_sections` makes them.
        seed: of the plan, for the footer.
    """
    poses = (plan_scene(model, plan, task.workspace), _tabulate_poses(model, plan), _tabulate_candidates(plan))
    robot = model.robot.title or model.robot.name
    return Page(
        title=f"Measurement poses for {task.name}",
        sections=(*sections, Section("Measurement poses", *poses)),
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
