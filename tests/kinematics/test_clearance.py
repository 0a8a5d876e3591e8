"""Distances against minimisation and dense sampling, and what a rigid motion of everything must not change."""

from dataclasses import replace

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import lsq_linear

from taskcal.geometry import se3
from taskcal.kinematics.clearance import (
    SAMPLE_COUNT,
    Box,
    Links,
    beam_is_free,
    clear_of_boxes,
    clear_of_itself,
    gap_between_links,
    gap_to_boxes,
    place_links,
    segment_distance,
    without_carriers,
)
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from tests.laws.campaigns import random_pose
from tests.laws.robots import generators, irb6660_positions

degenerate = st.sampled_from(["general", "parallel", "a point", "two points", "collinear", "crossing"])


def segments(rng: np.random.Generator, kind: str, n: int = 4) -> tuple[np.ndarray, ...]:
    p0, p1, q0, q1 = rng.uniform(-1, 1, (4, n, 3))
    if kind in ("parallel", "collinear"):
        q0 = p0 + rng.uniform(-1, 1, (n, 3)) if kind == "parallel" else p0 + rng.uniform(-2, 2, (n, 1)) * (p1 - p0)
        q1 = q0 + rng.uniform(-2, 2, (n, 1)) * (p1 - p0)
    elif kind == "a point":
        p1 = p0
    elif kind == "two points":
        p1, q1 = p0, q0
    elif kind == "crossing":
        q1 = 2 * (p0 + rng.uniform(0, 1, (n, 1)) * (p1 - p0)) - q0
    return p0, p1, q0, q1


def minimised(p0: np.ndarray, p1: np.ndarray, q0: np.ndarray, q1: np.ndarray) -> float:
    """Distance as a bounded least-squares problem in the two shares."""
    A = np.stack([p1 - p0, q0 - q1], axis=1)
    found = lsq_linear(A, q0 - p0, bounds=(0, 1), method="bvls", tol=1e-14)
    return float(np.linalg.norm(A @ found.x - (q0 - p0)))


@given(generators, degenerate)
@settings(max_examples=150)
def test_the_distance_of_segments_is_the_least_of_any_two_points(rng, kind):
    p0, p1, q0, q1 = segments(rng, kind)
    expected = [minimised(*one) for one in zip(p0, p1, q0, q1, strict=True)]
    found = segment_distance(p0, p1, q0, q1)
    np.testing.assert_allclose(found, expected, atol=1e-7)
    for other in ((q0, q1, p0, p1), (p1, p0, q0, q1), (p0, p1, q1, q0)):
        np.testing.assert_allclose(segment_distance(*other), found, atol=1e-9)


def random_links(rng: np.random.Generator, n: int = 20, count: int = 4) -> Links:
    points = np.cumsum(rng.uniform(-0.6, 0.6, (n, count + 1, 3)), axis=1)
    return Links(start=points[:, :-1], end=points[:, 1:], radius=rng.uniform(0.05, 0.2, count))


def random_box(rng: np.random.Generator) -> Box:
    return Box(pose=random_pose(rng, 0.8), size=rng.uniform(0.1, 0.8, 3))


def box_distance(points: np.ndarray, box: Box) -> np.ndarray:
    local = np.abs((points - box.pose[:3, 3]) @ box.pose[:3, :3]) - 0.5 * box.size
    return np.linalg.norm(np.maximum(local, 0.0), axis=-1)


@given(generators)
def test_capsule_is_clear_of_a_box_beyond_its_radius(rng):
    """A capsule is clear of a box if no point of its axis is within its radius."""
    links, box = random_links(rng), random_box(rng)
    share = np.linspace(0, 1, 400)[:, None]
    along = links.start[:, :, None] + share * (links.end - links.start)[:, :, None]
    nearest = box_distance(along, box).min(axis=2) - links.radius
    margin = nearest[:, 1:].min(axis=1)  # the first link stands where the robot stands
    # between two of the few points that are compared, the axis comes nearer by half their distance at most
    spacing = np.linalg.norm(links.end - links.start, axis=2)[:, 1:].max(axis=1) / (SAMPLE_COUNT - 1)
    found = clear_of_boxes(links, (box,))
    assert not np.any(found & (margin < -0.5 * spacing))
    assert np.all(found[margin > 1e-9])
    gap = gap_to_boxes(links, (box,))
    assert np.all((gap >= margin - 0.02 * spacing) & (gap <= margin + 0.5 * spacing))  # the margin is of points, too
    np.testing.assert_array_equal(gap_to_boxes(links, (box, box)), gap)


@given(generators)
def test_robot_is_clear_of_itself_but_neighbours(rng):
    """A robot is clear of itself if no links meet but neighbours."""
    links = random_links(rng, count=5)
    lengths = np.linalg.norm(links.end - links.start, axis=2).max(axis=0)
    share = np.linspace(0, 1, 60)[:, None]
    along = links.start[:, :, None] + share * (links.end - links.start)[:, :, None]
    gap = np.full(len(links.start), np.inf)
    for i in range(5):
        for j in range(i + 2, 5):
            room = links.radius[i] + links.radius[j]
            if lengths[i + 1 : j].sum() <= room:
                continue
            apart = np.linalg.norm(along[:, i, :, None] - along[:, j, None], axis=3).min(axis=(1, 2))
            gap = np.minimum(gap, apart - room)
    found = clear_of_itself(links)
    assert np.all(~found[gap < 0])
    assert np.all(found[gap > 0.04])  # twice half the spacing of the points
    exact = gap_between_links(links)
    assert np.all(np.isinf(gap) | (exact <= gap + 1e-12) & (exact >= gap - 0.04))


@given(generators)
def test_a_beam_is_free_if_no_point_of_it_is_in_a_link_or_a_box(rng):
    links, box = random_links(rng), random_box(rng)
    source, target = rng.uniform(-3, 3, 3), links.end[:, -1]
    share = np.linspace(0, 1, 3000)[:, None]
    beam = source + share * (target[:, None] - source)
    inside_box = box_distance(beam, box)
    gap = inside_box.min(axis=1)
    touching = np.zeros(len(target), dtype=bool)
    for k in range(3):  # the last link carries the target
        a, way = links.start[:, k, None], (links.end - links.start)[:, k, None]
        t = np.clip(((beam - a) * way).sum(axis=2) / (way * way).sum(axis=2), 0, 1)[..., None]
        distance = np.linalg.norm(beam - a - t * way, axis=2).min(axis=1) - links.radius[k]
        touching |= distance < 0
        gap = np.minimum(gap, distance)
    found = beam_is_free(source, target, links, (box,))
    assert not np.any(found & (touching | (inside_box == 0).any(axis=1)))
    assert np.all(found[gap > 2e-3])


def test_a_beam_along_a_box_face_or_axis_is_judged_too():
    nothing = Links(start=np.zeros((1, 0, 3)), end=np.zeros((1, 0, 3)), radius=np.zeros(0))
    box = Box(pose=np.eye(4), size=np.ones(3))

    def free(source, target):
        return bool(beam_is_free(np.array(source), np.array([target]), nothing, (box,))[0])

    assert not free([-2.0, 0.0, 0.0], [2.0, 0.0, 0.0])
    assert not free([-2.0, 0.0, 0.0], [0.0, 0.0, 0.0])  # it ends inside
    assert not free([0.0, 0.0, 0.0], [2.0, 0.0, 0.0])  # it starts inside
    assert free([-2.0, 0.6, 0.0], [2.0, 0.6, 0.0])
    assert free([-2.0, 0.0, 0.0], [-0.6, 0.0, 0.0])  # it ends before
    assert free([0.6, 0.0, 0.0], [2.0, 0.0, 0.0])


@given(generators)
def test_moving_everything_together_changes_nothing(rng):
    links, boxes, source = random_links(rng), (random_box(rng), random_box(rng)), rng.uniform(-3, 3, 3)
    T = random_pose(rng, 2.0)

    def moved(points):
        return points @ T[:3, :3].T + T[:3, 3]

    there = Links(start=moved(links.start), end=moved(links.end), radius=links.radius)
    boxes_there = tuple(replace(box, pose=T @ box.pose) for box in boxes)
    np.testing.assert_array_equal(clear_of_itself(there), clear_of_itself(links))
    np.testing.assert_array_equal(clear_of_boxes(there, boxes_there), clear_of_boxes(links, boxes))
    free = beam_is_free(source, links.end[:, -1], links, boxes)
    np.testing.assert_array_equal(beam_is_free(moved(source), there.end[:, -1], there, boxes_there), free)


@given(generators)
@settings(max_examples=10)
def test_links_run_from_base_to_tool_point(rng):
    """Links run from the base over the joints to the TCP."""
    model = ErrorModel(load_robot("abb-irb6660-205-1.9"))
    q = irb6660_positions(rng, 5)
    links = place_links(model, q)
    assert links.start.shape == (5, 7, 3)
    np.testing.assert_array_equal(links.start[:, 0], 0.0)
    np.testing.assert_allclose(links.start[:, 1:], links.end[:, :-1], atol=1e-12)
    np.testing.assert_allclose(links.end[:, -1], model.poses(q)[:, :3, 3], atol=1e-12)
    # fixed distances along the chain: RL1, d2, d3, the forearm's d4 and RL4, RL6
    lengths = np.linalg.norm(links.end - links.start, axis=2)
    expected = [0.8145, 0.3, 0.7, np.hypot(0.28, 0.893), 0.0, 0.2]
    np.testing.assert_allclose(lengths[:, :6], np.broadcast_to(expected, (5, 6)), atol=1e-12)


def test_folded_robot_meets_itself():
    """A folded robot is in its own way and a stretched one is not."""
    fold = Links(
        start=np.array([[[0, 0, 0], [0, 0, 1], [1, 0, 1], [1, 0, 0.9]]], dtype=float),
        end=np.array([[[0, 0, 1], [1, 0, 1], [1, 0, 0.9], [0, 0, 0.5]]], dtype=float),
        radius=np.full(4, 0.1),
    )
    assert not clear_of_itself(fold)[0]
    straight = replace(fold, end=np.array([[[0, 0, 1], [1, 0, 1], [1, 0, 0.9], [2, 0, 0.5]]], dtype=float))
    assert clear_of_itself(straight)[0]


def test_robots_without_radii_are_never_in_their_own_way():
    model = ErrorModel(load_robot("ur5"))
    if model.robot.link_radii is not None:
        model = ErrorModel(replace(model.robot, link_radii=None))
    links = place_links(model, np.zeros((3, 6)))
    assert links.start.shape == (3, 0, 3)
    box = Box(pose=se3.translation(0.0, 0.0, 0.0), size=np.full(3, 10.0))
    assert clear_of_itself(links).all()
    assert clear_of_boxes(links, (box,)).all()


def test_links_that_surround_a_point_on_the_tool_carry_it():
    model = ErrorModel(load_robot("abb-irb120"))
    q = np.random.default_rng(0).uniform(-1.0, 1.0, (5, 6))
    links, T = place_links(model, q), model.poses(q)
    # the tool link of no length, then from wrist to flange (72 mm of 45 mm radius), then the forearm
    at_flange, ahead = (T @ se3.translation(0.0, 0.0, z) for z in (0.0, 0.1))
    assert without_carriers(links, at_flange[:, :3, 3]).start.shape[1] == 5
    assert without_carriers(links, ahead[:, :3, 3]).start.shape[1] == 6
    kept = without_carriers(links, ahead[:, :3, 3])
    np.testing.assert_array_equal(kept.end, links.end[:, :6])
    assert len(kept.radius) == 6
