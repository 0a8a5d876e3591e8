"""A plan in space: the robot at the planned poses, the way between them, and the task's workspace."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from taskcal.adaptation.planned import Plan
from taskcal.presentation.content import Scene
from taskcal.presentation.robot_scene import MAX_POSES, draw_robot, link_radius
from taskcal.presentation.space import coloured_points, spread_rows, to_mm, workspace_layer
from taskcal.presentation.theme import BLUE, GREY
from taskcal.robot.error_model import ErrorModel
from taskcal.task.workspace import Workspace

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
