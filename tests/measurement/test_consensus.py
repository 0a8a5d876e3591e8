"""Rows that agree are found whatever a tenth of them says."""

from dataclasses import replace

import numpy as np
import pytest

from taskcal.measurement.consensus import find_consensus
from taskcal.measurement.registration import nominal_poses, register
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.file import robot_from
from tests.laws.campaigns import measure
from tests.laws.robots import industrial, industrial_positions

KINDS = {
    "one target": {},
    "three targets": {"targets": 3, "lost": 0.1},
    "poses": {"pose": True, "rotation_sigma": 1e-5},
}


def arm(rng):
    return ErrorModel(robot_from(industrial(rng)))


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("wrong", [0, 1, 4])
def test_wrong_joints_are_the_rows_that_do_not_agree(kind, wrong):
    rng = np.random.default_rng(wrong)
    model = arm(rng)
    q = industrial_positions(rng, 40)
    campaign, truth = measure(rng, model, q, sigma=1e-5, **KINDS[kind])
    rows = rng.choice(40, wrong, replace=False)
    spoilt = q.copy()
    spoilt[rows, 1] += np.radians(20.0)
    campaign = replace(campaign, q=spoilt)
    found = find_consensus(model, campaign, nominal_poses(model, campaign))
    np.testing.assert_array_equal(np.flatnonzero(campaign.seen & ~found.rows), np.sort(rows))
    np.testing.assert_allclose(found.registration.T_tracker_base, truth.T_tracker_base, atol=2e-4)


def test_it_does_not_depend_on_the_order_of_the_rows():
    rng = np.random.default_rng(5)
    model = arm(rng)
    campaign, _ = measure(rng, model, industrial_positions(rng, 40), sigma=1e-5)
    points = campaign.points.copy()
    points[[3, 17, 30]] += [[[0.2, 0.0, 0.0]], [[0.0, -0.4, 0.1]], [[0.0, 0.0, 0.9]]]
    campaign = replace(campaign, points=points)
    order = rng.permutation(40)
    found = find_consensus(model, campaign, nominal_poses(model, campaign))
    turned = find_consensus(model, campaign.take(order), nominal_poses(model, campaign)[order])
    np.testing.assert_array_equal(turned.rows, found.rows[order])


def test_where_rows_agree_the_registration_is_that_of_the_nearer_three_quarters():
    rng = np.random.default_rng(7)
    model = arm(rng)
    x = rng.normal(size=len(model)) * model.tolerances
    campaign, _ = measure(rng, model, industrial_positions(rng, 40), x, sigma=1e-5)
    poses = nominal_poses(model, campaign)
    found = find_consensus(model, campaign, poses)
    nearer = np.sort(np.argsort(found.distance)[:30])
    again = register(model, campaign.take(nearer), poses[nearer])
    np.testing.assert_allclose(found.registration.T_tracker_base, again.T_tracker_base, atol=1e-7)
    assert found.rows.all()


def test_a_target_that_only_few_rows_place_stays_at_the_tool_point():
    """One row in another orientation fits a target anywhere; a wrong joint value would say the same."""
    rng = np.random.default_rng(9)
    model = arm(rng)
    q = industrial_positions(rng, 1) + np.zeros((30, 1))
    q[:, 0] += rng.uniform(-0.5, 0.5, 30)
    q[:, 5] -= q[:, 0] - q[0, 0]
    campaign, _ = measure(rng, model, q, sigma=1e-5)
    alone = register(model, campaign)
    turned = q.copy()
    turned[4, 4] += np.radians(30.0)
    moved = register(model, replace(campaign, q=turned))
    assert moved.unlocated.any() == alone.unlocated.any()
    assert np.linalg.norm(moved.T_tool_target[0, :3, 3]) <= np.linalg.norm(alone.T_tool_target[0, :3, 3]) + 0.05
