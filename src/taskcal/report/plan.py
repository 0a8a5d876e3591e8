"""A plan as a page: its expected error, how to measure it, and its poses."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from jaxtyping import Float

from taskcal.errors import listed
from taskcal.planning.plan import Plan, extrapolate_poses
from taskcal.report.chart import BLUE, GREEN, GREY, INK, ORANGE, VERMILION, Axis, Figure, Level, Panel, Series
from taskcal.report.content import (
    NOMINAL,
    Bullets,
    Chart,
    Column,
    Facts,
    Section,
    TextTable,
    Viewer,
    state_model_error,
)
from taskcal.report.page import Report
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
from taskcal_groundwork.said import Said, joined, numeral, term

# What is said of a plan, by what ``taskcal plan --json`` prints of it: its expected error over the number of poses, and beside
# random and space-filling plans.

COUNTS = (5, 8, 10, 12, 15, 20, 25, 30, 40, 50, 60, 80, 100, 150, 200, 300, 500)
"""Numbers of poses whose expected error is tabulated."""

MAX_OVER_BEFORE = 3.0
"""Errors that are drawn, over that before: the first few poses do not even determine the frames, and would take all the room."""


def _start(told: Mapping[str, Any]) -> str:
    """The model before the plan is measured, in words."""
    if "calibration" in told:
        return Said("calibration as it is")
    return Said("nominal, fixtures found") if "fixture" in told else NOMINAL


def draw_by_count(told: Mapping[str, Any]) -> Figure:
    """Draw the expected error over the number of poses, with random and space-filling plans of the same size beside it."""
    count, error = told["count"], np.array(told["by_count_mm"])
    shown = error <= MAX_OVER_BEFORE * told["before_mm"]
    low, high = told["random_expected_error_range_mm"]
    random = Said("random poses: mean and range of {count} plans", count=told["random_plans"])
    series = (
        Series(kind="line", name=Said("greedy selection"), x=np.arange(1, len(error) + 1)[shown], y=error[shown]),
        Series(
            name=random, x=[count], y=[told["random_expected_error_mm"]], low=[low], high=[high], colour=ORANGE,
            shape="square",
        ),
        Series(
            name=Said("space-filling poses"), x=[count], y=[told["grid_expected_error_mm"]], colour=GREEN, shape="triangle"
        ),
        Series(
            name=Said("this plan, after exchange and refinement"), x=[count], y=[told["expected_error_mm"]],
            colour=VERMILION, shape="diamond",
        ),
    )  # fmt: skip
    levels = [Level(at=told["before_mm"], name=_start(told))]
    if told["geometry_allowance_mm"]:
        needed = Said("accuracy that the task needs")
        less = Said("{needed}, less the model error", needed=needed) if told["model_error_mm"] else needed
        levels.append(Level(at=told["geometry_allowance_mm"], name=less, colour=INK))
    x = Axis(title=Said("measured poses"), span=(0.0, count * 1.03))
    y = Axis(title=Said("expected error, rms"), unit="mm", log=True)
    return Figure(panels=(Panel(x=x, y=y, series=series, levels=tuple(levels), height=320.0),))


def tabulate_expected_errors(told: Mapping[str, Any]) -> TextTable:
    """Tabulate the expected error after a plan, beside other poses and none."""
    low, high = (numeral(value, ".3f") for value in told["random_expected_error_range_mm"])
    rows = [
        (Said("this plan"), told["expected_error_mm"], ""),
        (Said("random poses"), told["random_expected_error_mm"], Said("{low} to {high}", low=low, high=high)),
        (Said("space-filling poses"), told["grid_expected_error_mm"], ""),
        (_start(told), told["before_mm"], ""),
    ]
    columns = (
        Column("", lambda row: row[0]),
        Column(Said("expected"), lambda row: row[1], ".3f"),
        Column(Said("range of {count} plans", count=told["random_plans"]), lambda row: row[2], "s"),
    )
    poses = Said("{count} poses", count=told["count"])
    if told["measured_before"]:
        poses = Said("{poses} added to {before}", poses=poses, before=told["measured_before"])
    title = Said("Expected 3D rms error over task '{task}', {poses}, mm", task=told["task"], poses=poses)
    return TextTable.of(title, columns, rows)


def tabulate_by_count(told: Mapping[str, Any]) -> TextTable:
    """Tabulate the expected error after so many poses of the greedy choice, as far as it is below that of none."""
    count, errors = told["count"], told["by_count_mm"]
    shown = sorted({n for n in COUNTS if n < count} | {count})
    return TextTable.of(
        Said("Expected error against number of poses (greedy selection)"),
        (Column(Said("poses"), lambda n: n, "d"), Column(Said("expected mm"), lambda n: errors[n - 1], ".3f")),
        [n for n in shown if errors[n - 1] < told["before_mm"]],
    )


def describe_accuracy(told: Mapping[str, Any]) -> Said:
    """Whether the plan meets the accuracy that the task states, and with how many poses, in words."""
    if told["accuracy_mm"] is None:
        return Said("the task states none")
    stated, allowed = Said("the task's {accuracy:g} mm", accuracy=told["accuracy_mm"]), told["geometry_allowance_mm"]
    expected, enough = told["expected_error_mm"], told["poses_needed"]
    if not allowed:
        alone = np.sqrt(max(told["expected_with_model_error_mm"] ** 2 - expected**2, 0.0))
        return Said(
            "no number of poses meets {stated}: the model error alone leaves {alone:.3g} mm (3D rms); identify its causes, "
            "effects above all, instead of measuring more poses",
            stated=stated,
            alone=float(alone),
        )
    if enough is not None:
        if enough == 1:
            return Said("the first pose chosen meets {stated}, model error included", stated=stated)
        return Said("the first {count} poses chosen meet {stated}, model error included", count=enough, stated=stated)
    if expected <= allowed:
        return Said("the whole plan meets {stated}, model error included", stated=stated)
    return Said(
        "the plan does not meet {stated}; about {count:.0f} poses would, model error included",
        stated=stated,
        count=extrapolate_poses(told["count"], expected, allowed),
    )


def plan_sections(told: Mapping[str, Any], robot: Robot) -> tuple[Section, ...]:
    """Make the sections of what a plan is expected to give, and without a tracker of how to measure it.

    Args:
        told: as ``taskcal plan --json`` prints it.
        robot: that is to be measured.
    """
    lost = [
        Said("{number} {reason}", number=number, reason=term(reason))
        for reason, number in told["lost"].items()
        if number
    ]
    seen = [len(names) for names in told.get("visible", ())]
    expected = Section(
        Said("Expected error of the plan"),
        tabulate_expected_errors(told),
        Facts(
            (Said("accuracy"), describe_accuracy(told)),
            (Said("model error"), state_model_error(told["model_error_mm"], term(told["model_error_origin"]))),
            (
                Said("single pose"),
                Said(
                    "expected error {error:.3f} mm (3D rms), model error included",
                    error=told["expected_with_model_error_mm"],
                ),
            ),
            (
                Said("candidates"),
                Said(
                    "{count} feasible; rejected: {lost}",
                    count=told["candidates"],
                    lost=joined(", ", lost) if lost else Said("none"),
                ),
            ),
            (Said("reflectors"), Said("{count} visible at each pose", count=_span(seen))) if seen else None,
            (Said("images"), _views_in_words(told["views"])) if "views" in told else None,
            (Said("clearance"), _clearance_in_words(told["clearance_mm"], robot)) if "clearance_mm" in told else None,
            (
                Said("criterion"),
                Said(
                    "{criterion}; {count} exchanges after the greedy start",
                    criterion=term(told["criterion"]),
                    count=told["exchanges"],
                ),
            ),
        ),
        _meaning(told),
        Chart(
            Said("Expected error against the number of measured poses"),
            draw_by_count(told),
            Said(
                "Beyond the plateau, more poses add little. The line is the greedy choice; exchange and refinement improve the "
                "plan at its end. Logarithmic scale."
            ),
        ),
        tabulate_by_count(told),
    )
    return (expected, _how_to_measure(told, robot)) if "observe" in told else (expected,)


def _span(values: Sequence[float], form: str = ".0f") -> Said:
    low, high = (numeral(end, form) for end in (min(values), max(values)))
    return Said("{low} to {high}", low=low, high=high) if low != high else high


def _views_in_words(views: Mapping[str, Sequence[float]]) -> Said:
    """The least and the largest of each figure of the poses."""
    return joined(
        ", ", [Said("{what} {span}", what=VIEWS.get(name, name), span=_span(values)) for name, values in views.items()]
    )


def _clearance_in_words(clearance: Mapping[str, Sequence[float] | None], robot: Robot) -> Said:
    """The least gaps of all poses, and of what."""
    radii = robot.link_radii
    if radii is None:
        return Said("not checked: the robot file states no link_radii_mm")
    gaps = [Said("{gap:.0f} mm {between}", gap=min(gap), between=GAPS[name]) for name, gap in clearance.items() if gap]
    return Said(
        "at least {gaps}; links as capsules of {low:g} to {high:g} mm radius",
        gaps=joined(", ", gaps) if gaps else "–",
        low=min(radii) * 1e3,
        high=max(radii) * 1e3,
    )


GAPS = {"between_links": Said("between links"), "to_keep_out": Said("to keep-out boxes")}
VIEWS: Mapping[str, str] = {
    "corners": Said("corners in the image"),
    "distance_mm": Said("distance mm"),
    "tilt_deg": Said("tilt °"),
}
"""Figures of a pose in words, by their keys."""

# How a plan without a tracker is measured: fixtures, what to check, what to write down.

MAX_NAMED = 12
"""Poses that a statement names."""


def _how_to_measure(told: Mapping[str, Any], robot: Robot) -> Section:
    """The fixtures with their numbers of poses, and what to check and to write down."""
    x, y, z = told["mounted_mm"]
    round_about, none = (
        [one["pose"] for one in told["not_clear_from_the_pose_before"] if one["way_round"] == found]
        for found in (True, False)
    )
    assumed = "fixture" in told and not told["fixtures_stated"]
    unchecked = Said("collisions not checked: the robot file states no link_radii_mm; drive the plan slowly")
    checked = Said(
        "collisions of the links with each other, blocks and keep-out boxes were checked, between poses, too; cables, tool and "
        "cell were not: drive slowly"
    )
    said = [
        term(told["instructions"]),
        Said("default positions of the fixtures assumed: place them as listed, or state theirs and plan again")
        if assumed
        else "",
        Said("mounting on the tool assumed at {x:g}, {y:g}, {z:g} mm in the tool frame (--mounted-mm)", x=x, y=y, z=z),
        unchecked if robot.link_radii is None else checked,
        Said(
            "not clear from the previous pose by a joint motion: {poses}; a program takes a way around",
            poses=listed(round_about, MAX_NAMED),
        )
        if round_about
        else "",
        Said(
            "not clear from the previous pose, and no way around found: {poses}; drive there by hand, not by a program",
            poses=listed(none, MAX_NAMED),
        )
        if none
        else "",
    ]
    table = _tabulate_fixtures(told) if "fixture" in told else None
    return Section(Said("How to measure"), table, Bullets(*filter(None, said)))


def _tabulate_fixtures(told: Mapping[str, Any]) -> TextTable:
    columns = (
        Column(term(told["fixture"]), "name"),
        *(Column(f"{axis} mm", lambda one, k=k: one["position_mm"][k], ".0f") for k, axis in enumerate("xyz")),
        *(Column(axis, lambda one, k=k: one["direction"][k], ".2f") for k, axis in enumerate("ijk")),
        Column(Said("poses"), lambda one: told["poses_each"][one["name"]], "d"),
    )
    whose = Said("as stated") if told["fixtures_stated"] else Said("assumed")
    title = Said("Positions of the fixtures in the base frame, {whose}, and their directions", whose=whose)
    return TextTable.of(title, columns, told["standing"])


def _meaning(told: Mapping[str, Any]) -> Said:
    """Definition of expected errors, and of the plans that they are compared with."""
    sources = (
        Said("calibration covariance, model error and noise")
        if "calibration" in told
        else Said("tolerances, model error and noise")
    )
    if "observe" in told:
        return Said(
            "Expected errors are 3D rms over the task, of the target on the tool, independent of the position of the robot's base, "
            "from {sources}; no robot is simulated. The position of every fixture, and of the target on the tool, counts as "
            "unknown. Random and space-filling poses are chosen among the feasible ones.",
            sources=sources,
        )
    return Said(
        "Expected errors are 3D rms over the task, of the measured targets in the tracker frame, from {sources}; no robot is "
        "simulated. Random and space-filling poses are within the task's workspace; the plan may leave it a little and turn the "
        "tool farther, which is where much of its advantage comes from.",
        sources=sources,
    )


def tabulate_poses(told: Mapping[str, Any], robot: Robot, q: Float[np.ndarray, "n joints"]) -> TextTable:
    """Tabulate the poses of a plan, and what is known of each.

    Args:
        told: as ``taskcal plan --json`` prints it.
        robot: that is to be measured.
        q: its joint positions, radians or metres.
    """
    slides = robot.prismatic
    shown = q * np.where(slides, 1e3, 180.0 / np.pi)
    joints = [f"{name} ({'mm' if s else '°'})" for name, s in zip(robot.joint_names, slides, strict=True)]
    figures: dict[str, Sequence[float]] = {
        VIEWS.get(name, name): values for name, values in told.get("views", {}).items()
    }
    for name, gaps in told.get("clearance_mm", {}).items():
        figures |= {} if gaps is None else {Said("{what} mm", what=GAPS[name]): gaps}
    columns = [
        Column("id", lambda k: k, "d"),
        *(Column(name, shown[:, j].__getitem__, ".2f") for j, name in enumerate(joints)),
        *([Column(term(told["fixture"]), told[told["fixture"]].__getitem__)] if "fixture" in told else []),
        *([Column(Said("visible"), lambda k: ", ".join(told["visible"][k]))] if "visible" in told else []),
        *(Column(name, values.__getitem__, ".0f") for name, values in figures.items()),
    ]
    return TextTable.of(Said("All {count} poses", count=len(q)), columns, range(len(q)), folded=True)


# A plan in space.

STEM = 0.04
"""Length at which the tool's axis is drawn, over the robot's reach."""


def plan_scene(model: ErrorModel, plan: Plan, space: Workspace | None) -> Viewer:
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
    return Viewer(
        title="The robot at the planned poses",
        poses=draw_robot(robot, plan.q[rows], [f"id {row}" for row in rows]),
        look=robot_look(robot),
        layers=tuple(layers),
        floor=True,
        note="Poses all around the workspace, with many tool orientations, determine the most. A bare side is out of the robot's "
        "reach, or not visible from the tracker. In the base frame.",
    )


def plan_page(model: ErrorModel, task: Task, plan: Plan, told: Mapping[str, Any], *, seed: int) -> Report:
    """Make the page of a plan.

    Args:
        model: the model that is to be identified.
        task: what the plan is for.
        plan: the plan.
        told: as ``taskcal plan --json`` prints it.
        seed: of the plan, for the footer.
    """
    poses = (plan_scene(model, plan, task.workspace), tabulate_poses(told, model.robot, plan.q))
    robot = model.robot.title or model.robot.name
    return Report(
        title=f"Measurement poses for {task.name}",
        sections=(*plan_sections(told, model.robot), Section("Measurement poses", *poses)),
        lead=f"{len(plan.q)} poses of the {robot}, chosen among {plan.candidates} feasible ones.",
        source=f"robot {model.robot.name}; criterion {plan.criterion}; seed {seed}",
    )
