from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from taskcal.campaigns.campaign import Campaign, Stations
from taskcal.errors import CampaignError, TaskcalError, UnknownName
from taskcal.observations import Boards, Point, Pose
from taskcal.observations.base import TrackerNoise
from taskcal.robot.conditions import Conditions
from tests.laws.campaigns import random_pose


def campaign(n=12, targets=3, poses=False, seed=0):
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(n, targets, 3))
    points[2, 0] = np.nan
    return Campaign(
        ids=tuple(f"row {i}" for i in range(n)),
        q=rng.normal(size=(n, 6)),
        targets=tuple(f"smr{t}" for t in range(targets)),
        points=points,
        rotations=rng.normal(size=(n, 3, 3)) if poses else None,
        uncertainty=rng.uniform(1e-5, 1e-4, (n, targets)),
        reference_points={"base": rng.normal(size=(n, 3))},
        conditions=Conditions(
            temperature=rng.normal(size=n),
            time=rng.uniform(0.0, 1e4, n),
            approach=rng.choice([-1.0, 0.0, 1.0], (n, 6)),
            move=rng.normal(size=(n, 6)),
        ),
    )


@pytest.mark.parametrize("rows", [np.array([3, 1, 5]), [0], slice(2, 7), np.arange(12) % 3 == 0, [-1]], ids=str)
def test_taking_rows_takes_them_from_every_array(rows):
    whole = campaign()
    some = whole.take(rows)
    index = np.arange(12)[rows]
    assert some.ids == tuple(f"row {i}" for i in index)
    for name in ("q", "points", "uncertainty", "temperature", "time", "approach", "move"):
        np.testing.assert_array_equal(getattr(some, name), getattr(whole, name)[index])
    np.testing.assert_array_equal(some.reference_points["base"], whole.reference_points["base"][index])
    assert some.targets == whole.targets


def test_taken_rows_keep_their_number_and_line():
    whole = replace(campaign(), lines=np.arange(12) * 2 + 3)
    some = whole.take([1, 4, 7, 10]).take(np.array([False, True, True, True])).take(slice(1, None))
    assert [(some.row_of(i), some.line_of(i), some.row(i)) for i in range(2)] == [
        (7, 17, "row 7 (id row 7, line 17)"),
        (10, 23, "row 10 (id row 10, line 23)"),
    ]
    assert (campaign().row_of(3), campaign().line_of(3), campaign().row(3)) == (3, None, "row 3 (id row 3)")


@pytest.mark.parametrize("rows", [[12], [0, 99], np.ones(5, dtype=bool)], ids=str)
def test_rows_the_campaign_does_not_have_are_refused(rows):
    with pytest.raises(CampaignError, match="rows run from 0 to 11"):
        campaign().take(rows)


@given(st.floats(0.05, 0.95), st.integers(0, 99))
def test_split_is_a_partition_that_repeats_with_its_seed(fraction, seed):
    whole = campaign()
    fitted, held = whole.split(fraction, np.random.default_rng(seed))
    assert sorted(fitted.ids + held.ids) == sorted(whole.ids)
    assert len(held) == round(fraction * 12)
    again = whole.split(fraction, np.random.default_rng(seed))
    assert (fitted.ids, held.ids) == (again[0].ids, again[1].ids)


@pytest.mark.parametrize("fraction", [0.0, 1.0, 0.01, -0.5, 2.0])
def test_a_split_that_leaves_one_side_empty_is_refused(fraction):
    with pytest.raises(CampaignError, match="leaves"):
        campaign().split(fraction, np.random.default_rng(0))


def test_targets_are_taken_in_the_order_asked_for():
    whole = campaign()
    some = whole.of_targets(["smr2", "smr0"])
    np.testing.assert_array_equal(some.points, whole.points[:, [2, 0]])
    np.testing.assert_array_equal(some.uncertainty, whole.uncertainty[:, [2, 0]])
    np.testing.assert_array_equal(some.valid, whole.valid[:, [2, 0]])
    with pytest.raises(UnknownName, match="no target 'smr3'; did you mean 'smr"):
        whole.of_targets(["smr3"])


def test_uncertainty_is_stated_per_axis_or_the_trackers():
    stated = campaign()
    covariance = stated.covariances()
    np.testing.assert_allclose(covariance[0, 1], stated.uncertainty[0, 1] ** 2 * np.eye(3))
    noise = TrackerNoise(range_m=1e-3)
    unstated = Campaign(ids=stated.ids, q=stated.q, targets=stated.targets, points=stated.points)
    np.testing.assert_allclose(unstated.covariances(noise)[0, 1], noise.covariance(stated.points[0, 1]))
    assert np.isfinite(unstated.covariances()).all()


def test_a_poses_covariance_adds_that_of_its_rotation():
    poses = campaign(targets=1, poses=True)
    covariance = poses.covariances(TrackerNoise(rotation=3e-4))
    assert covariance.shape == (12, 1, 6, 6)
    np.testing.assert_allclose(covariance[0, 0, :3, :3], poses.uncertainty[0, 0] ** 2 * np.eye(3))
    np.testing.assert_allclose(covariance[0, 0, 3:, 3:], 9e-8 * np.eye(3))
    assert not covariance[:, :, :3, 3:].any()


def test_the_digest_is_of_the_measurements_alone():
    assert campaign().digest == campaign().digest
    assert campaign(seed=1).digest != campaign().digest
    assert campaign().take(slice(0, 11)).digest != campaign().digest


@pytest.mark.parametrize(
    ("field", "place", "value", "message"),
    [
        ("points", (3, 1, 2), np.inf, "points: row 3 is not finite"),
        ("points", (3, 1, 2), np.nan, r"row 3 \(id row 3\).*'smr1'.*part"),
        ("points", (5,), np.ma.masked, "points: row 5 is masked"),
        ("q", (4, 0), np.ma.masked, "q: row 4 is masked"),
        ("q", (4, 0), np.nan, r"row 4 \(id row 4\)"),
    ],
)
def test_numbers_that_were_not_measured_are_refused_with_their_row(field, place, value, message):
    whole = campaign()
    array = np.ma.masked_array(getattr(whole, field).copy())
    array[place] = value
    with pytest.raises(TaskcalError, match=message):
        replace(whole, **{field: array})
    assert type(replace(whole, q=np.ma.masked_array(whole.q)).q) is np.ndarray


def test_rows_of_one_id_are_refused_wherever_they_come_from():
    whole = campaign()
    with pytest.raises(CampaignError, match="rows 1 and 4 are both named 'row 1'"):
        replace(whole, ids=(*whole.ids[:4], "row 1", *whole.ids[5:]))
    with pytest.raises(CampaignError, match="rows 0 and 2 are both named 'row 5'"):
        whole.take([5, 6, 5])


def test_measurements_are_carried_with_their_stations():
    """Each row as its own station saw it, from where that is now: points, rotations, nests, and noise that turns with them."""
    rng = np.random.default_rng(6)
    rotations = Rotation.random(12, rng=rng).as_matrix()
    was, now = (np.stack([random_pose(rng, 3.0) for _ in range(2)]) for _ in range(2))
    of = np.arange(12) // 5 % 2
    stations = Stations(names=("a", "b"), of=of, T_first_station=was)
    here = replace(campaign(targets=1, poses=True), rotations=rotations, uncertainty=None, stations=stations)
    there = here.carried(now)
    T = np.stack([now[k] @ np.linalg.inv(was[k]) for k in of])
    np.testing.assert_allclose(
        there.points[:, 0], np.einsum("nij,nj->ni", T[:, :3, :3], here.points[:, 0]) + T[:, :3, 3]
    )
    turned = Rotation.from_matrix(T[:, :3, :3])
    np.testing.assert_allclose(there.rotations, (turned * Rotation.from_matrix(rotations)).as_matrix(), atol=1e-12)
    nest = here.reference_points["base"]
    np.testing.assert_allclose(there.reference_points["base"], turned.apply(nest) + T[:, :3, 3], atol=1e-12)
    noise = TrackerNoise(range_per_m=5e-5)
    before, after = (one.covariances(noise)[here.seen, 0, :3, :3] for one in (here, there))
    R = T[here.seen, :3, :3]
    np.testing.assert_allclose(after, R @ before @ np.swapaxes(R, 1, 2), rtol=1e-9, atol=1e-22)
    back = there.carried(was)
    np.testing.assert_allclose(back.points, here.points, atol=1e-12)
    np.testing.assert_array_equal(back.stations.T_first_station, was)


@pytest.mark.parametrize(("poses", "kind"), [(False, Point()), (True, Pose())])
def test_a_tracker_that_is_stated_sees_as_one_that_is_not(poses, kind):
    """Whether observations are stated or left out: the same kinds, counts and noise, from every station."""
    rng = np.random.default_rng(0)
    T = np.stack([np.eye(4), random_pose(rng, 3.0)])
    left_out = replace(
        campaign(targets=1, poses=poses),
        uncertainty=None,
        stations=Stations(names=("1", "2"), of=np.arange(12) % 2, T_first_station=T),
    )
    stated = replace(left_out, observations=(kind,))
    assert left_out.kinds == stated.kinds == (type(kind),)
    assert left_out.digest == stated.digest
    np.testing.assert_array_equal(left_out.covariances(), stated.covariances())
    there = (left_out.points[1, 0] - T[1, :3, 3]) @ T[1, :3, :3]
    seen = T[1, :3, :3] @ TrackerNoise().covariance(there[None])[0] @ T[1, :3, :3].T
    np.testing.assert_allclose(left_out.covariances()[1, 0, :3, :3], seen, rtol=1e-12)


def test_what_a_tracker_measured_follows_the_rotations():
    """One kind for each target: poses where there are rotations that nothing else measures, else points."""
    poses = campaign(targets=1, poses=True)
    points = replace(poses, rotations=None)
    assert (poses.kinds, points.kinds) == ((Pose,), (Point,))
    assert replace(points, rotations=poses.rotations).kinds == (Pose,)
    assert points.digest == replace(points, observations=()).digest != poses.digest
    both = (Point(), Boards(landmarks=("a",), of=np.zeros(len(poses), dtype=int)))
    two = {"targets": ("smr", "board"), "points": np.tile(poses.points, (1, 2, 1)), "uncertainty": None}
    assert replace(poses, observations=both, **two).kinds == (Point, Boards)
