"""Robots of a study that are like one that was calibrated."""

from dataclasses import replace

import numpy as np
import pytest

from taskcal.errors import CampaignError
from taskcal.identification.identify import identify
from taskcal.observations.base import TrackerNoise
from taskcal.planning import study as studying
from taskcal.planning.study import VirtualRobots, study
from taskcal.robot.catalogue import load_robot
from taskcal.robot.conditions import conditions_in_order
from taskcal.robot.effects import Backlash, EncoderGain
from taskcal.robot.error_model import ErrorModel
from taskcal.task.task import Task
from taskcal.virtual.cell import simulate

MODEL = ErrorModel(load_robot("abb-irb120"))
EFFECTS = MODEL + EncoderGain() + Backlash()


@pytest.fixture(scope="module")
def calibration():
    """With an error of its third joint at single poses, as `explain` may find one."""
    q = np.random.default_rng(0).uniform(-1.2, 1.2, (60, 6))
    way = conditions_in_order(MODEL.robot, q)
    campaign, _ = simulate(EFFECTS, q, rng=np.random.default_rng(1), conditions=way, model_error=3e-5)
    found = identify(EFFECTS, campaign)
    return replace(found, joint_error=(0.0, 0.0, 5e-4, 0.0, 0.0, 0.0))


def test_simulated_robots_have_estimated_defects_and_pose_errors(calibration):
    """Simulated defects and pose errors have the magnitudes that were estimated."""
    robots = VirtualRobots.like(calibration, None)
    x = np.array([robots.draw(np.random.default_rng(seed)) for seed in range(400)])
    np.testing.assert_allclose(x.std(axis=0), calibration.prior_scale * EFFECTS.tolerances, rtol=0.2)
    assert robots.model_error.position == calibration.model_error[0]
    q = np.random.default_rng(2).uniform(-1.2, 1.2, (300, 6))
    campaign, truth = robots.measure(x[0], q, TrackerNoise(), np.random.default_rng(3))
    np.testing.assert_array_equal(campaign.q, q)
    off = (campaign.points - truth.points(q, robots.conditions(q)))[:, 0]
    turned = q + np.array([0.0, 0.0, 5e-4, 0.0, 0.0, 0.0])
    way = robots.conditions(q)
    lever = (truth.points(turned, way) - truth.points(q, way))[:, 0]
    along = np.einsum("ni,ni->n", off, lever) / np.linalg.norm(lever, axis=1) ** 2
    across = np.cross(off, lever) / np.linalg.norm(lever, axis=1)[:, None]
    assert np.std(along) == pytest.approx(1.0, rel=0.15)  # in units of the third joint's error
    assert np.std(across) < 0.3 * np.linalg.norm(lever, axis=1).mean()
    unexplained = robots.unexplained(truth, q, np.random.default_rng(4))
    assert np.linalg.norm(unexplained, axis=1).mean() > 0.6 * np.linalg.norm(lever, axis=1).mean()


@pytest.mark.parametrize("fitted", ["all", pytest.param("auto", marks=pytest.mark.long)])
def test_study_states_gain_of_effects_for_calibrated_robot(calibration, monkeypatch, fitted):
    """A study states the gain of effects on simulated robots like the calibrated one."""
    monkeypatch.setattr(studying, "POOL_POSES", 100)
    q = np.random.default_rng(5).uniform(-1.0, 1.0, (30, 6))
    task = Task(name="listed", poses=MODEL.poses(q), joints=q)
    asked = {"robots": 2, "counts": (40,), "plans": ("random",), "engine": "sequential"}
    found = study(EFFECTS, task, calibration=replace(calibration, joint_error=()), models=(fitted, "geometry"), **asked)
    rms = {row["model"]: row["median_mm"] for row in found.summary()}
    assert rms[fitted] < 0.8 * rms["geometry"]
    assert found.origin == "with defects of the sizes that the calibration found"
    assert found.model_error_origin == "as calibrated"


def test_study_rejects_other_model_and_missing_prior(calibration):
    """Another model and a calibration without a prior are rejected."""
    with pytest.raises(CampaignError, match="study the calibration's own model"):
        study(MODEL, Task(name="none", poses=np.eye(4)[None]), calibration=calibration)
    with pytest.raises(CampaignError, match="identify with a prior"):
        VirtualRobots.like(replace(calibration, prior_scale=None), None)
