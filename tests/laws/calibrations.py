"""Calibrations of virtual robots."""

import numpy as np

from taskcal.identification.calibration import Calibration
from taskcal.identification.identify import identify
from taskcal.kinematics.inverse import closes
from taskcal.robot.catalogue import load_robot
from taskcal.robot.effects import Effect
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot import Robot
from tests.laws.campaigns import measure


def calibrated(robot: str | Robot, *effects: Effect, poses: int = 50, seed: int = 0) -> Calibration:
    """A robot, such as one of the catalogue, whose defects of a millimetre and a milliradian were identified."""
    rng = np.random.default_rng(seed)
    model = ErrorModel(load_robot(robot) if isinstance(robot, str) else robot, effects=effects)
    limits = 0.4 * np.clip(model.robot.limits, -3.0, 3.0)
    q = rng.uniform(*limits.T, size=(8 * poses, len(limits)))
    q = q[closes(model, q) & model.robot.inside_limits(q)][:poses]
    x = rng.normal(size=len(model)) * model.tolerances
    campaign, _ = measure(rng, model, q, x, sigma=1e-5, uncertainty=1e-5)
    return identify(model, campaign)
