"""Campaigns of virtual robots, sound ones, with what no geometry explains."""

from collections.abc import Mapping
from functools import cache
from typing import Any

import numpy as np
from jaxtyping import Float

from taskcal.campaigns.campaign import Campaign
from taskcal.effects import Compliance, Harmonics
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.task.default_task import default_task
from taskcal.task.task import Task, reach_task
from taskcal.virtual.cell import simulate

ROWS = 40
TARGETS = {"a": np.array([0.05, 0.02, 0.1]), "b": np.array([-0.04, 0.06, 0.08]), "c": np.array([0.03, -0.07, 0.12])}

VIRTUAL: Mapping[str, Mapping[str, Any]] = {
    "ur5e": {"rows": 60},
    "abb-irb1200-5-0.9": {"targets": 3},
    "kuka-kr16-2": {"rows": 100},
    "franka-panda": {"rows": 60},
    "denso-hsr065a1": {"rows": 40},
    "fanuc-m20ia": {"rows": 30},
    "abb-irb6660-205-1.9": {"rows": 60, "targets": 2},
    "abb-irb2400-12-1.55": {"rows": 25},
    "staubli-rx160": {"rows": 50, "pose": True},
    "kinova-gen3": {"rows": 60},
    "motoman-gp12": {"rows": 60},
}
"""Robots of every kind, and how each is measured."""


HEALTHY = (
    "ur5e", "abb-irb120", "kuka-kr16-2", "fanuc-m20ia", "abb-irb6660-205-1.9", "staubli-rx160", "motoman-sia20d",
    "franka-panda", "kinova-gen3", "denso-hsr065a1",
)  # fmt: skip
"""Robots of six, seven and four joints, with coupled axes and a parallelogram."""


def healthy(name: str, seed: int) -> Campaign:
    """A campaign in which nothing is wrong: 20 to 60 rows of a robot drawn from its tolerances, some with an effect beside them.

    Even seeds measure over the task that `default_task` proposes, odd ones all over the joint ranges; a point, which may be the
    TCP, three points or poses.
    """
    robot, rng = load_robot(name), np.random.default_rng((HEALTHY.index(name), seed))
    model, rows = ErrorModel(robot), int(rng.choice([20, 30, 45, 60]))
    if seed % 2 == 0:
        q = task_poses(name, rows, seed)
    else:
        turning = ~np.array(robot.prismatic)
        half = np.where(turning, 0.7, 0.5) * np.minimum(0.5 * np.ptp(robot.limits, axis=1), np.pi)
        q = np.clip(robot.limits.mean(axis=1), -1.0, 1.0) + rng.uniform(-half, half, (60 * rows, len(half)))
        q = q[robot.inside_limits(q)]
        if robot.four_bar is not None:
            q = q[robot.four_bar.closes(q, np.zeros(3))]
    effect = (None, None, Compliance(), Harmonics())[int(rng.integers(4))]
    kind = seed // 2 % 5
    return simulate(
        model if effect is None else model + effect,
        q[:rows],
        rng=rng,
        targets=TARGETS if kind == 2 else {"a": np.zeros(3) if kind == 1 else rng.uniform(-0.1, 0.1, 3)},
        pose=kind == 3,
        model_error=float(rng.choice([0.0, 1e-4, 3e-4])),
    )[0]


def task_poses(name: str, rows: int, seed: int) -> Float[np.ndarray, "n joints"]:
    """Joints of poses over the task that is proposed for a robot."""
    return reach_task(ErrorModel(load_robot(name)), _task(name), count=rows, seed=seed).q


@cache
def _task(name: str) -> Task:
    return default_task(ErrorModel(load_robot(name)))


def virtual(
    name: str, seed: int = 0, *, pose: bool = False, targets: int = 1, error: float = 3e-4, rows: int = ROWS
) -> Campaign:
    """Measured poses of a robot drawn from its tolerances, with what no geometry explains."""
    robot, rng = load_robot(name), np.random.default_rng(seed)
    turning = ~np.array(robot.prismatic)
    middle = np.where(turning, np.clip(robot.limits.mean(axis=1), -1.0, 1.0), robot.limits.mean(axis=1))
    half = np.where(turning, np.minimum(0.45 * np.ptp(robot.limits, axis=1), 1.2), 0.4 * np.ptp(robot.limits, axis=1))
    q = middle + rng.uniform(-1.0, 1.0, (40 * rows, len(middle))) * half
    model = ErrorModel(robot)
    q = q[robot.inside_limits(q)]
    if robot.four_bar is not None:
        q = q[robot.four_bar.closes(q, np.zeros(3))]
    chosen = dict(list(TARGETS.items())[:targets])
    return simulate(model, q[:rows], rng=rng, targets=chosen, pose=pose, model_error=error)[0]
