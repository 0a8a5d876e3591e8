"""Reference points that move are followed, and the points with them; reference points that stand still change nothing."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from taskcal.campaigns.campaign import Campaign
from taskcal.campaigns.drift import compensate_drift
from taskcal.geometry import se3
from taskcal.identification.identify import identify
from taskcal.identification.validation import validate
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot_file import robot_from
from taskcal.virtual.cell import simulate
from tests.laws.robots import industrial, industrial_positions

NESTS = np.array([[3.0, -1.5, -0.3], [3.5, -1.7, -0.3], [3.2, -2.3, -0.35]])
NOISE = 5e-6


def wandering(rng, n, shift=2e-5, turn=1e-5):
    """A random walk of a body about its reference points, as transforms."""
    steps = np.cumsum(rng.normal(size=(n, 6)) * np.repeat([shift, turn], 3), axis=0)
    steps -= steps.mean(axis=0)
    R, centre = se3.exp(steps[:, 3:]), NESTS.mean(axis=0)
    return se3.pose(R, centre + steps[:, :3] - R @ centre)


def measured(seed, n=120, *, moves=True, reference_points=3, pose=False):
    """A campaign of a virtual robot on a base that wanders, and the same without."""
    rng = np.random.default_rng(seed)
    model = ErrorModel(robot_from(industrial(rng)))
    still, _ = simulate(model, industrial_positions(rng, n), rng=rng, pose=pose)
    T = wandering(rng, n) if moves else np.broadcast_to(np.eye(4), (n, 4, 4))
    seen = se3.apply(T[:, None], NESTS[None]) + rng.normal(scale=NOISE, size=(n, 3, 3))
    moved = replace(
        still,
        points=se3.apply(T[:, None], still.points),
        rotations=None if still.rotations is None else T[:, :3, :3] @ still.rotations,
        reference_points={f"base{i + 1}": seen[:, i] for i in range(reference_points)},
    )
    return model, moved, still


def apart(campaign, still):
    """What two campaigns differ by beside one motion that all rows have in common, which the tracker's frame takes up."""
    ours, theirs = campaign.points[:, 0], still.points[:, 0]
    R, _ = Rotation.align_vectors(ours - ours.mean(axis=0), theirs - theirs.mean(axis=0))
    return ours - ours.mean(axis=0) - R.apply(theirs - theirs.mean(axis=0))


@pytest.mark.slow
def test_wandering_base_is_followed():
    model, moved, still = measured(0)
    found = compensate_drift(moved)
    assert found.followed
    assert found.probability < 1e-6
    assert found.noise == pytest.approx(NOISE, rel=0.15)
    assert apart(found.campaign, still).std() < 0.1 * apart(moved, still).std()
    chosen, rest = np.arange(0, 120, 2), np.arange(1, 120, 2)
    error = [validate(identify(model, c.take(chosen)), c.take(rest)).mean for c in (moved, found.campaign, still)]
    assert error[1] < 0.35 * error[0]
    assert error[1] < 1.25 * error[2]


def test_the_stated_uncertainty_covers_what_following_adds():
    scaled = []
    for seed in range(4):
        _, moved, still = measured(seed)
        followed = compensate_drift(moved).campaign
        own = np.trace(still.covariances()[:, 0], axis1=1, axis2=2) / 3.0
        added = followed.uncertainty[:, 0] ** 2 - own
        assert (added > 0.0).all()
        scaled.append((apart(followed, still) ** 2).mean(axis=1) / added)
    assert 0.6 < np.mean(scaled) < 1.5


def test_measured_orientations_are_carried_back_too():
    _, moved, still = measured(1, pose=True)
    followed = compensate_drift(moved).campaign
    turned = [se3.log(c.rotations @ np.swapaxes(still.rotations, 1, 2)).std(axis=0).mean() for c in (moved, followed)]
    assert turned[1] < 0.2 * turned[0]


def test_reference_points_that_stand_still_change_nothing():
    followed = []
    for seed in range(25):
        _, campaign, _ = measured(seed, 60, moves=False)
        found = compensate_drift(campaign)
        followed.append(found.followed)
        if not found.followed:
            assert found.campaign is campaign
            assert "not followed" in found.remarks[-1]
    assert sum(followed) <= 1


def test_a_reference_point_that_the_robot_carries_is_not_called_still():
    """Its motion is no noise, and no drift that could be followed."""
    _, _, still = measured(0)
    carried = compensate_drift(replace(still, reference_points={"base1": still.points[:, 0]}))
    assert not carried.followed
    (remark,) = carried.remarks
    assert "(base1) scatter by" in remark
    assert "--reference-points" in remark
    np.testing.assert_array_equal(carried.campaign.points, still.points)


def test_following_twice_is_following_once():
    found = compensate_drift(measured(2)[1])
    again = compensate_drift(found.campaign)
    assert not again.followed
    assert again.campaign is found.campaign


def test_a_base_that_yields_under_the_arm_is_followed_row_by_row():
    """White motion beyond the reference points' noise belongs to the base; smoothing over the rows would leave it in the points."""
    rng = np.random.default_rng(3)
    _, campaign, still = measured(3, moves=False)
    shifts = rng.normal(scale=5e-5, size=(120, 1, 3))
    moved = replace(
        campaign,
        points=still.points + shifts,
        reference_points={k: p + shifts[:, 0] for k, p in campaign.reference_points.items()},
    )
    left = apart(compensate_drift(moved).campaign, still)
    assert left.std() < 0.15 * shifts.std()


@pytest.mark.parametrize("reference_points", [1, 2])
def test_fewer_reference_points_follow_translations_and_say_so(reference_points):
    _, moved, _ = measured(4, reference_points=reference_points)
    found = compensate_drift(moved)
    assert found.followed
    assert any("fewer than three reference points" in remark for remark in found.remarks)


def test_lost_references_are_bridged_misplaced_ones_named():
    _, moved, still = measured(5)
    reference_points = {name: points.copy() for name, points in moved.reference_points.items()}
    reference_points["base2"][30:33] = np.nan
    reference_points["base3"][50] += [0.3, 0.1, 0.0]
    found = compensate_drift(replace(moved, reference_points=reference_points))
    assert found.remarks[0].startswith("reference point base3 does not fit the others in 1 rows (id 50)")
    left = apart(found.campaign, still)
    assert np.abs(left)[[30, 31, 32, 50]].max() < 1.5e-4
    uncertainty = found.campaign.uncertainty[:, 0]
    assert uncertainty[31] > uncertainty[29]


def test_campaign_stays_without_references_or_enough_rows():
    campaign = Campaign(ids=("a", "b"), q=np.zeros((2, 1)), targets=("tool",), points=np.ones((2, 1, 3)))
    assert compensate_drift(campaign).campaign is campaign
    seen = replace(campaign, reference_points={"base": np.zeros((2, 3))})
    found = compensate_drift(seen)
    assert found.campaign is seen
    assert "too few to follow" in found.remarks[0]
