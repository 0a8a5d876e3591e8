"""Folders of virtual robots, each measured and calibrated once or twice."""

from functools import cache
from pathlib import Path

import numpy as np

import taskcal as tc

ROWS = 30
MOVED_RAD = 3e-3
"""By which joint 3 of the robot ``b`` has moved from spring to autumn."""


@cache
def small_model() -> tc.ErrorModel:
    return tc.ErrorModel(tc.load_robot("abb-irb120"))


@cache
def _campaigns() -> dict[str, tc.Campaign]:
    """By the name of the file."""
    model = small_model()
    moved = MOVED_RAD * np.array([name == "J3.rz" for name in model.names])
    out = {}
    for seed, robot in enumerate("abc"):
        rng = np.random.default_rng(seed)
        q = rng.uniform(*0.5 * model.robot.limits.T, size=(2, ROWS, 6))
        out[f"{robot}/2026-03-01.csv"], truth = tc.simulate(model, q[0], rng=rng)
        if robot != "c":
            x = truth.x + moved * (robot == "b")
            out[f"{robot}/2026-09-01.csv"], _ = tc.simulate(model, q[1], rng=rng, x=x)
    return out


@cache
def _calibrations() -> dict[str, str]:
    model = small_model()
    return {
        name.replace(".csv", ".json"): tc.identify(model, campaign).to_text() for name, campaign in _campaigns().items()
    }


def lay_campaigns(folder: Path) -> Path:
    """A fleet of three robots, two of them measured twice."""
    for name, campaign in _campaigns().items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        tc.write_campaign(folder / name, campaign, small_model().robot)
    return folder


def lay_calibrations(folder: Path) -> Path:
    """The same, calibrated."""
    for name, text in _calibrations().items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)
    return folder
