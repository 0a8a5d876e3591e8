"""What is said of a calibration over a task is what the calibration says pose by pose."""

from dataclasses import replace

import numpy as np
import pytest

import taskcal as tc
from taskcal.geometry import se3
from taskcal.planning.task_map import uncertainty_over
from tests.laws.campaigns import random_pose

MODEL = tc.ErrorModel(tc.load_robot("abb-irb6660-205-1.9"))
TASK = tc.demo.reference_task()


@pytest.fixture(scope="module")
def campaign() -> tc.Campaign:
    return tc.simulate(MODEL, tc.reach_task(MODEL, TASK, 30).q, rng=np.random.default_rng(0))[0]


@pytest.fixture(scope="module")
def calibration(campaign: tc.Campaign) -> tc.Calibration:
    return tc.identify(MODEL, campaign, prior_scale=1.0, model_error=0.0, target_within=1e-5)


def test_the_target_is_as_well_known_as_the_predictions_say(calibration: tc.Calibration) -> None:
    found = uncertainty_over(calibration, TASK, seed=3)
    poses = tc.reach_task(MODEL, TASK, seed=3)
    covariance = calibration.predict_covariance(poses.q)[:, 0]
    # a turn of the axes leaves the trace alone
    expected = np.sqrt(poses.weights @ np.trace(covariance, axis1=1, axis2=2))
    assert found.target == pytest.approx(expected, rel=1e-9)


def test_deviations_are_of_the_base_s_axes_wherever_the_tracker(
    calibration: tc.Calibration, campaign: tc.Campaign
) -> None:
    G = random_pose(np.random.default_rng(8), 3.0)
    u = np.full(campaign.valid.shape, 2e-5)  # alike in all directions, or the tracker's place would count
    at = [replace(campaign, uncertainty=u, points=se3.apply(T, campaign.points)) for T in (np.eye(4), G)]
    here, there = (uncertainty_over(tc.identify(MODEL, one, prior_scale=1.0, model_error=0.0), TASK) for one in at)
    for name, deviation in here.deviations.items():
        np.testing.assert_allclose(there.deviations[name], deviation, rtol=1e-3, atol=1e-8)
    spread = here.deviations[f"target {campaign.targets[0]}"]
    assert (spread.max(axis=1) > 1.1 * spread.min(axis=1)).any()  # or any axes would do


def test_before_is_what_the_tolerances_make_of_the_pose(calibration: tc.Calibration) -> None:
    found = uncertainty_over(calibration, TASK, seed=3)
    poses = tc.reach_task(MODEL, TASK, seed=3)
    rng = np.random.default_rng(5)
    J = MODEL.jacobian(poses.q, angular=False)
    drawn = J @ (MODEL.tolerances[:, None] * rng.normal(size=(len(MODEL), 4000)))
    assert found.before == pytest.approx(np.sqrt(np.mean((drawn**2).sum(axis=1))), rel=0.05)
    assert found.after < 0.3 * found.before


def test_maps_are_there_for_a_workspace_alone(calibration: tc.Calibration) -> None:
    found = uncertainty_over(calibration, TASK)
    assert {len(maps) for maps in found.maps.values()} == {3}
    assert all(
        np.isfinite(m[s.reached]).all() for maps in found.maps.values() for m, s in zip(maps, found.slices, strict=True)
    )
    poses = tc.reach_task(MODEL, TASK, 4)
    listed = uncertainty_over(calibration, tc.Task(name="four poses", poses=poses.T))
    assert listed.slices == ()
    assert listed.deviations["tool, calibrated"].shape == (4, 3)
