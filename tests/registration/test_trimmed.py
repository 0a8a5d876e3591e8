"""Tracker frame and targets are registered whatever a tenth of the rows says."""

from dataclasses import replace

import numpy as np
import pytest

from taskcal.errors import CampaignError
from taskcal.registration.registration import nominal_poses, register, register_trimmed
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot_file import robot_from
from taskcal.task.task import reach_task
from taskcal.virtual.cell import simulate
from taskcal_demo.procedure import reference_task
from tests.laws.campaigns import measure
from tests.laws.observations import observed_with_points
from tests.laws.robots import industrial, industrial_positions

KINDS = {
    "one target": {},
    "three targets": {"targets": 3, "lost": 0.1},
    "poses": {"pose": True, "rotation_sigma": 1e-5},
}


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("mistake", ["joints", "points"])
def test_wrong_rows_are_far_off_and_the_frame_is_that_of_the_others(kind, mistake):
    rng = np.random.default_rng(4)
    model = ErrorModel(robot_from(industrial(rng)))
    campaign, truth = measure(rng, model, industrial_positions(rng, 40), sigma=1e-5, **KINDS[kind])
    rows = rng.choice(np.flatnonzero(campaign.valid.all(axis=1)), 4, replace=False)
    q, points = campaign.q.copy(), campaign.points.copy()
    if mistake == "joints":
        q[rows, 1] += np.radians(20.0)
    else:
        points[rows, 0] += rng.normal(size=(4, 3))
    spoilt = replace(campaign, q=q, points=points)
    found, distance = register_trimmed(nominal_poses(model, spoilt), spoilt, model)
    np.testing.assert_array_equal(np.flatnonzero(distance > 5e-3), np.sort(rows))
    np.testing.assert_allclose(found.T_tracker_base, truth.T_tracker_base, atol=2e-4)


def test_wrong_rows_of_a_tracker_are_found_beside_sockets():
    """Rows far from where the tracker's other points have the base do not place the sockets either."""
    model, mixed, truth = observed_with_points("socket", 3, rows=40)
    q, wrong = mixed.q.copy(), np.array([5, 21])  # among the rows that the tracker saw
    q[wrong, 1] += np.radians(15.0)
    spoilt = replace(mixed, q=q)
    found, distance = register_trimmed(model.poses(q, truth.x), spoilt, model)
    assert distance[np.setdiff1d(np.arange(40), wrong)].max() < 1e-3
    whole = register_trimmed(model.poses(mixed.q, truth.x), mixed, model)[0]
    np.testing.assert_allclose(found.T_tracker_base, whole.T_tracker_base, atol=1e-3)
    np.testing.assert_allclose(found.unknowns[1], whole.unknowns[1], atol=1e-3)


def test_points_along_a_line_are_refused_though_they_agree():
    model = ErrorModel(load_robot("abb-irb6660-205-1.9"))
    q = np.zeros((12, 6))
    q[:, 0] = np.linspace(0.0, 1e-4, 12)
    campaign, _ = simulate(model, q, rng=np.random.default_rng(0), x=np.zeros(len(model)))
    with pytest.raises(CampaignError, match="of one line, which does not fix the tracker frame"):
        register_trimmed(nominal_poses(model, campaign), campaign, model)


@pytest.mark.parametrize("joint", [3, 4, 5])
def test_target_placed_by_one_row_stays_at_tcp(joint):
    """One row in another orientation fits a target anywhere; a wrong joint value would say the same."""
    model = ErrorModel(load_robot("abb-irb6660-205-1.9"))
    q = reach_task(model, reference_task(), 40).q
    campaign, truth = simulate(model, q, rng=np.random.default_rng(joint), x=np.zeros(len(model)))
    turned = q.copy()
    turned[4, joint] += np.radians(30.0)
    spoilt = replace(campaign, q=turned)
    found, distance = register_trimmed(nominal_poses(model, spoilt), spoilt, model)
    assert distance.argmax() == 4
    assert not any(register(model, spoilt).located)
    np.testing.assert_allclose(found.T_tool_target[0, :3, 3], 0.0, atol=1e-6)
    np.testing.assert_allclose(found.T_tracker_base, truth.T_tracker_base, atol=2e-4)
