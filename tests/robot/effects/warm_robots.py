"""Robots that grow, parameters by name and poses."""

import numpy as np

from taskcal.robot.conditions import Conditions
from taskcal.robot.effects import Thermal
from taskcal.robot.error_model import ErrorModel

WARMTH = 25.0
"""How much warmer than the reference, K."""


def thermal(model: ErrorModel, joints: tuple[str, ...] | None = None) -> ErrorModel:
    return model + Thermal(joints=joints, reference=21.0)


def warm(q: np.ndarray) -> Conditions:
    return Conditions(temperature=np.full(len(q), 21.0 + WARMTH))


def with_value(model: ErrorModel, **values: float) -> np.ndarray:
    x = np.zeros(len(model))
    for name, value in values.items():
        x[model.names.index(name.replace("__", "."))] = value
    return x


REVOLUTE = ["ur5", "fanuc-r2000ic-165f", "barrett-wam", "abb-irb6660-205-1.9"]


def positions(model: ErrorModel, count: int = 6) -> np.ndarray:
    limits = np.clip(model.robot.limits, -0.4, 0.4)
    return np.random.default_rng(0).uniform(limits[:, 0], limits[:, 1], (count, len(limits)))
