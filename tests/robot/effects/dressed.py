"""Robots with masses and a spring."""

import numpy as np

from taskcal.robot.catalogue import load_robot
from taskcal.robot.effects import Compliance, Coupling, MotorHarmonics, Spring
from taskcal.robot.robot_file import robot_from
from taskcal.robot.statics import Load
from tests.laws import statics


def positions(model, count=12):
    limits = np.clip(model.robot.limits, -0.6, 0.6)
    return np.random.default_rng(0).uniform(limits[:, 0], limits[:, 1], (count, len(limits)))


BESIDE = [
    Compliance(),
    Compliance(load=Load(mass=30.0, centre=(0.0, 0.1, 0.2), force=(300.0, 0.0, -400.0), axes="tool")),
    Spring(),
    MotorHarmonics(),
    Coupling(),
]


SPRING = {
    "joint": "J2",
    "rate_n_mm": 60.0,
    "free_length_mm": 300.0,
    "crank_mm": 200.0,
    "anchor_mm": 500.0,
    "aligned_deg": 20.0,
}


def dressed(name):
    """A robot of the catalogue with masses, gear ratios and a spring."""
    description = statics.weighed(load_robot(name).description, np.random.default_rng(0))
    joints = [{**joint, "gear_ratio": 100.5} for joint in description["joint"]]
    return robot_from({**description, "joint": joints, "spring": SPRING})
