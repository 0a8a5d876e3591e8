"""Whatever places a robot or a target among measurements moves with them, and does not ask in which order they stand."""

from dataclasses import replace

import numpy as np
import pytest

from taskcal.errors import CampaignError
from taskcal.geometry import se3
from taskcal.geometry.point_registration import orientations, refine, rms_length
from taskcal.registration.circles import find_circles, register_from_circles
from taskcal.registration.registration import (
    Cloud,
    nominal_poses,
    place_targets,
    register,
    register_trimmed,
    registration_residuals,
)
from taskcal.registration.stations import frame_of_points
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot_file import robot_from
from tests.laws.campaigns import measure, random_pose
from tests.laws.observations import KINDS_WITHOUT_TRACKER, observed
from tests.laws.robots import industrial, industrial_positions

KINDS = {
    "one target": {},
    "three targets": {"targets": 3, "lost": 0.1},
    "poses": {"pose": True, "rotation_sigma": 1e-3},
}
WAYS = {
    "all rows": register,
    "trimmed": lambda model, campaign: register_trimmed(nominal_poses(model, campaign), campaign, model)[0],
}


def carried(campaign, G):
    """The campaign in another frame of the tracker."""
    turned = None if campaign.rotations is None else G[:3, :3] @ campaign.rotations
    return replace(campaign, points=campaign.points @ G[:3, :3].T + G[:3, 3], rotations=turned)


def measured_arm(seed, kind, rows=30):
    rng = np.random.default_rng(seed)
    model = ErrorModel(robot_from(industrial(rng)))
    x = rng.normal(size=len(model)) * model.tolerances
    return rng, model, measure(rng, model, industrial_positions(rng, rows), x, sigma=1e-4, **KINDS[kind])[0]


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("way", ["all rows", "trimmed"])
def test_a_registration_moves_with_the_points(kind, way):
    """The base moves with the tracker's frame; targets on the tool, what is left and what is not determined stay."""
    rng, model, campaign = measured_arm(3, kind)
    found = WAYS[way](model, campaign)
    G = random_pose(rng, 3.0)
    moved = carried(campaign, G)
    order = rng.permutation(len(campaign))
    for other, base in ((moved, G @ found.T_tracker_base), (campaign.take(order), found.T_tracker_base)):
        again = WAYS[way](model, other)
        np.testing.assert_allclose(again.T_tracker_base, base, atol=1e-6)
        np.testing.assert_allclose(again.T_tool_target, found.T_tool_target, atol=1e-6)
        np.testing.assert_allclose(again.unobservable, found.unobservable, atol=1e-6)
        assert again.rms == pytest.approx(found.rms, rel=1e-5)
    left, there = registration_residuals(found, model, campaign), WAYS[way](model, moved)
    if way == "all rows":
        assert left.rms == pytest.approx(found.rms, rel=1e-9)
    np.testing.assert_allclose(registration_residuals(there, model, moved).distances, left.distances, atol=1e-6)


@pytest.mark.parametrize("kind", KINDS)
def test_no_frame_or_target_beside_the_registered_leaves_less(kind):
    """What is registered is the least squares of the points: of poses, with the rotations that were found first."""
    rng, model, campaign = measured_arm(5, kind)
    found = register(model, campaign)
    T = model.poses(campaign.q)

    def cost(base, targets):
        ends = (base @ T)[:, None] @ targets
        return np.nansum((campaign.points - ends[..., :3, 3]) ** 2)

    least = cost(found.T_tracker_base, found.T_tool_target)
    for _ in range(20):
        step = 1e-5 * rng.normal(size=3)
        shifted = found.T_tracker_base.copy()
        shifted[:3, 3] += step
        assert cost(shifted, found.T_tool_target) > least
        targets = found.T_tool_target.copy()
        targets[rng.integers(len(targets)), :3, 3] += step
        assert cost(found.T_tracker_base, targets) > least
        if kind != "poses":
            turned = found.T_tracker_base.copy()
            turned[:3, :3] = se3.exp(step) @ turned[:3, :3]
            assert cost(turned, found.T_tool_target) > least


def test_circles_and_what_they_register_move_with_the_points():
    rng = np.random.default_rng(2)
    model = ErrorModel(load_robot("ur5"))
    home = np.array([0.3, -1.0, 1.2, 0.4, -0.7, 0.5])
    q = np.array([home + step * np.eye(6)[j] for j in range(4) for step in np.linspace(-0.4, 0.3, 6)])
    x = rng.normal(size=len(model)) * model.tolerances
    campaign, _ = measure(rng, model, q, x, sigma=1e-5, targets=2)
    G = random_pose(rng, 3.0)
    moved = carried(campaign, G)
    for one, other in zip(find_circles(model, campaign), find_circles(model, moved), strict=True):
        np.testing.assert_allclose(other.normal, G[:3, :3] @ one.normal, atol=1e-9)
        np.testing.assert_allclose(other.centre, G[:3, :3] @ one.centre + G[:3, 3], atol=1e-9)
        assert (other.radius, other.residual) == pytest.approx((one.radius, one.residual))
        out = campaign.points[one.rows, one.target] - one.centre
        np.testing.assert_allclose(np.linalg.norm(out, axis=1), one.radius, atol=1e-3)
        np.testing.assert_allclose(out @ one.normal, 0.0, atol=1e-3)
        angle = q[one.rows, one.axis]
        turned = np.cross(out[angle.argmin()], out[angle.argmax()])
        assert turned @ one.normal > 0.0
        assert one.arc == pytest.approx(np.ptp(angle))
    found, again = register_from_circles(model, campaign), register_from_circles(model, moved)
    np.testing.assert_allclose(again.T_tracker_base, G @ found.T_tracker_base, atol=1e-8)
    np.testing.assert_allclose(again.T_tool_target, found.T_tool_target, atol=1e-8)
    placed = place_targets(model, campaign, found.T_tracker_base)
    assert placed.rms == pytest.approx(registration_residuals(placed, model, campaign).rms, rel=1e-9)


def test_a_station_is_placed_in_spite_of_wrong_points():
    """The frame that carries the base's points to the measured ones, those left out that are far off."""
    rng = np.random.default_rng(4)
    base, T = rng.uniform(-1.0, 1.0, (30, 3)), random_pose(rng, 4.0)
    measured = base @ T[:3, :3].T + T[:3, 3] + 1e-5 * rng.normal(size=base.shape)
    measured[[2, 11, 23]] += 0.05
    found = frame_of_points(base, measured, 1.0, "station 'b'")
    np.testing.assert_allclose(found, T, atol=3e-5)


@pytest.mark.parametrize("seed", [1, 2])
def test_points_that_fit_nowhere_are_placed_where_they_fit_best(seed):
    """Of rows that were mixed up many frames are about as near; none of those from which a search may start is nearer."""
    rng, model, campaign = measured_arm(seed, "three targets", rows=20)
    mixed = replace(campaign, q=rng.permutation(campaign.q))
    cloud = Cloud.of(nominal_poses(model, mixed), mixed)

    def left(Z):
        return rms_length(cloud.residual(Z, *cloud.moments.offsets(Z)))

    each = np.array([left(refine(Z, cloud.moments)[0]) for Z in orientations()])
    assert np.ptp(each) > 1e-3 * each.min()
    assert left(register(model, mixed).T_tracker_base[:3, :3]) <= each.min() * (1.0 + 1e-6)


@pytest.mark.parametrize(("points", "said"), [(2, "too few"), (9, "on one line")])
def test_a_station_is_not_placed_by_a_line_or_a_pair(points, said):
    line = np.linspace(0.0, 0.8, points)[:, None] * np.array([0.6, -0.5, 0.2])
    with pytest.raises(
        CampaignError, match=rf"^station 'b' measured {points} points .*, {said} to determine where it is"
    ):
        frame_of_points(line, line, 1.0, "station 'b'")


@pytest.mark.parametrize("kind", KINDS_WITHOUT_TRACKER)
def test_a_target_is_placed_alike_wherever_the_robot_stands(kind):
    """Fixed objects move with the base; the target on the tool stays, wrong rows are as far off, in whatever order."""
    model, campaign, truth = observed(kind, 6, 48)
    (one,), rng = campaign.observations, np.random.default_rng(7)
    tool, measured = model.poses(campaign.q, truth.x), campaign.read(0)
    wrong = np.array([5, 20, 33])
    tool[wrong, :3, 3] += 0.03
    placed = one.place(tool, measured)
    right = np.delete(np.arange(48), wrong)
    assert placed.distance[right].max() < 1e-3 < placed.distance[wrong].max()
    np.testing.assert_allclose(placed.T_tool_target[:3, 3], truth.T_tool_target[0, :3, 3], atol=5e-4)
    moved = one.place(random_pose(rng, 1.0) @ tool, measured)
    order = rng.permutation(48)
    shuffled = campaign.take(order)
    again = shuffled.observations[0].place(tool[order], shuffled.read(0))
    for other, rows in ((moved, slice(None)), (again, order)):
        np.testing.assert_allclose(other.T_tool_target, placed.T_tool_target, atol=1e-5)
        np.testing.assert_allclose(other.distance, placed.distance[rows], atol=1e-5)
        np.testing.assert_allclose(other.unobservable, placed.unobservable, atol=1e-6)
