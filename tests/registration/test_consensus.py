"""Rows that agree are found whatever a tenth of them says."""

from dataclasses import replace

import numpy as np
import pytest

from taskcal.demo.procedure import reference_task
from taskcal.errors import CampaignError
from taskcal.registration import consensus
from taskcal.registration.consensus import find_consensus
from taskcal.registration.registration import nominal_poses, register
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot_file import robot_from
from taskcal.task.task import reach_task
from taskcal.virtual.cell import simulate
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


def test_of_very_many_rows_a_sample_finds_what_agrees(monkeypatch):
    """Every tenth row is wrong, so that all rows together settle elsewhere; the end is that of a search among all."""
    rng = np.random.default_rng(6)
    model = arm(rng)
    q = industrial_positions(rng, 400)
    campaign, truth = measure(rng, model, q, targets=2, lost=0.2, sigma=1e-5)
    rows = rng.choice(400, 40, replace=False)
    spoilt = q.copy()
    spoilt[rows] = industrial_positions(rng, 40)
    campaign = replace(campaign, q=spoilt)
    poses = nominal_poses(model, campaign)
    among_all = find_consensus(model, campaign, poses)
    monkeypatch.setattr(consensus, "SAMPLED_FROM", 300)
    monkeypatch.setattr(consensus, "SAMPLE", 100)
    settled: list[int] = []
    settle = consensus._settle

    def count(model, campaign, *others):
        settled.append(len(campaign))
        return settle(model, campaign, *others)

    monkeypatch.setattr(consensus, "_settle", count)
    found = find_consensus(model, campaign, poses)
    assert settled.count(400) == 1
    np.testing.assert_array_equal(found.rows, among_all.rows)
    np.testing.assert_array_equal(np.flatnonzero(campaign.seen & ~found.rows), np.sort(rows[campaign.seen[rows]]))
    np.testing.assert_allclose(found.registration.T_tracker_base, truth.T_tracker_base, atol=2e-4)


@pytest.mark.parametrize("kind", KINDS)
def test_registration_of_consistent_rows_trims_only_poses(
    kind,
):
    """Consistent points are all used for the registration; of consistent poses, the best three quarters."""
    rng = np.random.default_rng(7)
    model = arm(rng)
    x = rng.normal(size=len(model)) * model.tolerances
    campaign, _ = measure(rng, model, industrial_positions(rng, 40), x, sigma=1e-5, **KINDS[kind])
    poses = nominal_poses(model, campaign)
    found = find_consensus(model, campaign, poses)
    assert found.rows[campaign.seen].all()
    assert found.of_all == (kind != "poses")
    if found.of_all:
        again, atol = register(model, campaign, poses), 0.0
    else:
        nearer = np.sort(np.argsort(found.distance)[:30])
        again, atol = register(model, campaign.take(nearer), poses[nearer]), 1e-6
    for one in ("T_tracker_base", "T_tool_target", "unobservable"):
        np.testing.assert_allclose(getattr(found.registration, one), getattr(again, one), rtol=0, atol=atol)


def test_points_along_a_line_are_refused_though_they_agree():
    model = ErrorModel(load_robot("abb-irb6660-205-1.9"))
    q = np.zeros((12, 6))
    q[:, 0] = np.linspace(0.0, 1e-4, 12)
    campaign, _ = simulate(model, q, rng=np.random.default_rng(0), x=np.zeros(len(model)))
    with pytest.raises(CampaignError, match="of one line, which does not fix the tracker frame"):
        find_consensus(model, campaign, nominal_poses(model, campaign))


@pytest.mark.parametrize("joint", [3, 4, 5])
def test_target_placed_by_one_row_stays_at_tcp(joint):
    """One row in another orientation fits a target anywhere; a wrong joint value would say the same."""
    model = ErrorModel(load_robot("abb-irb6660-205-1.9"))
    q = reach_task(model, reference_task(), 40).q
    campaign, truth = simulate(model, q, rng=np.random.default_rng(joint), x=np.zeros(len(model)))
    turned = q.copy()
    turned[4, joint] += np.radians(30.0)
    spoilt = replace(campaign, q=turned)
    found = find_consensus(model, spoilt, nominal_poses(model, spoilt))
    assert np.flatnonzero(~found.rows).tolist() == [4]
    assert not any(register(model, spoilt).located)
    np.testing.assert_allclose(found.registration.T_tool_target[0, :3, 3], 0.0, atol=1e-6)
    np.testing.assert_allclose(found.registration.T_tracker_base, truth.T_tracker_base, atol=2e-4)
