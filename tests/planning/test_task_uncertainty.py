"""What is said of a calibration over a task is what the calibration says pose by pose."""

import numpy as np
import pytest

import taskcal as tc
from taskcal.planning.task_map import uncertainty_over

MODEL = tc.ErrorModel(tc.load_robot("abb-irb6660-205-1.9"))
TASK = tc.demo.reference_task()


@pytest.fixture(scope="module")
def calibration() -> tc.Calibration:
    campaign, _ = tc.simulate(MODEL, tc.reach_task(MODEL, TASK, 30).q, rng=np.random.default_rng(0))
    return tc.identify(MODEL, campaign, prior_scale=1.0, model_error=0.0)


def test_the_target_is_as_well_known_as_the_predictions_say(calibration: tc.Calibration) -> None:
    found = uncertainty_over(calibration, TASK, seed=3)
    poses = tc.reach_task(MODEL, TASK, seed=3)
    covariance = calibration.predict_covariance(poses.q, model_error=False)[:, 0]
    # a turn of the axes leaves the trace alone
    expected = np.sqrt(poses.weights @ np.trace(covariance, axis1=1, axis2=2))
    assert found.target == pytest.approx(expected, rel=1e-9)


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
