"""Industrial arms with defects, and what is measured of them."""

import numpy as np

from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot_file import robot_from
from tests.laws.robots import industrial

KINDS = {
    "one target": {},
    "three targets and lost beams": {"targets": 3, "lost": 0.2},
    "poses": {"pose": True, "rotation_sigma": 5e-5},
}


def arm(seed, tolerance_mm=0.5):
    rng = np.random.default_rng(seed)
    tolerance = {"translation_mm": tolerance_mm, "rotation_mrad": tolerance_mm}
    return rng, ErrorModel(robot_from({**industrial(rng), "tolerance": tolerance}))


def defects(rng, model, factor=1.0):
    return factor * rng.normal(size=len(model)) * model.tolerances


def true_points(model, truth, q):
    return (truth.T_tracker_base @ model.poses(q, truth.x)[:, None] @ truth.T_tool_target)[..., :3, 3]
