"""The noise of a measurement: the tracker's and the model error in squares, a campaign's own uncertainties before the default."""

from dataclasses import replace

import numpy as np
import pytest

from taskcal.analysis.sensitivity import measuring_noise
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot import TYPICAL
from taskcal.virtual.cell import simulate

MODEL = ErrorModel(load_robot("ur5"))
Q = np.random.default_rng(0).uniform(-1.0, 1.0, size=(8, 6))


def test_tracker_and_model_error_add_in_squares():
    noise = measuring_noise(MODEL, Q, model_error=2e-4)
    assert noise.total == pytest.approx(np.sqrt(noise.tracker**2 + 4e-8))
    assert measuring_noise(MODEL, Q, model_error=0.0).total == noise.tracker
    said = noise.summary()
    assert said["noise_mm"] ** 2 == pytest.approx(said["tracker_mm"] ** 2 + said["model_error_mm"] ** 2)


def test_stated_uncertainties_replace_the_trackers():
    """A campaign's stated uncertainties count instead of the tracker's."""
    campaign, _ = simulate(MODEL, Q, rng=np.random.default_rng(1))
    stated = replace(campaign, uncertainty=np.full((8, 1), 7e-5))
    assert measuring_noise(MODEL, Q, stated).tracker == pytest.approx(7e-5)
    assert measuring_noise(MODEL, Q, campaign).tracker < 3e-5


def test_unstated_model_error_is_typical():
    """A robot that states no model error has that of a typical one."""
    robot = replace(MODEL.robot, model_error=None)
    assert measuring_noise(ErrorModel(robot), Q).model_error is TYPICAL
