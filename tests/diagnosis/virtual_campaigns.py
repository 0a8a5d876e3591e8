"""Campaigns of virtual robots, sound ones, with what no geometry explains."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from taskcal.campaigns.campaign import Campaign
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
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
