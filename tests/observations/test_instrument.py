"""Instruments in a cell: paths that are not clear, places that suit a task, and postures that are not wound up."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from taskcal.geometry import se3
from taskcal.kinematics.clearance import Box, clear_of_boxes, clear_of_itself, place_links
from taskcal.observations import CameraInstrument, Fixtures
from taskcal.observations.instrument import directions_across, far_apart, find_blocked_paths, on_the_floor
from tests.laws.robots import generators
from tests.reading.virtual_task import MODEL

POST = Box(pose=se3.translation(0.45, 0.0, 0.3), size=np.array([0.05, 0.05, 0.6]))
FIXTURES = Fixtures(names=("a", "b"), position=np.full((2, 3), 0.4), direction=np.tile([0.0, 0.0, 1.0], (2, 1)))


class InTurns(CameraInstrument):
    """A camera before which one landmark stands after the other."""

    @property
    def stages(self):
        return np.arange(self.count)


def is_clear(q, boxes):
    links = place_links(MODEL, q)
    return clear_of_itself(links) & clear_of_boxes(links, boxes)


def driven(start, end, steps=300):
    return start + np.linspace(0.0, 1.0, steps)[:, None] * (end - start)


def postures(count):
    """Clear of the post, on either side of it."""
    rng = np.random.default_rng(2)
    q = rng.uniform([-1.2, 0.2, -0.2, -0.5, -0.5, -0.5], [1.2, 0.9, 0.6, 0.5, 0.8, 0.5], (8 * count, 6))
    return q[is_clear(q, (POST,))][:count]


def test_blocked_paths_are_those_on_which_something_is_in_the_way():
    """Beside paths that are all sampled finely; ways round begin and end at the poses, and are clear."""
    q = postures(14)
    camera = CameraInstrument(fixtures=FIXTURES, keep_out=(POST,))
    found = {one.pose: one.via for one in find_blocked_paths(MODEL, camera, q, np.zeros(14, dtype=int))}
    share = {k: np.mean(is_clear(driven(q[k - 1], q[k]), (POST,))) for k in range(1, 14)}
    assert (
        {k for k, clear in share.items() if clear < 0.85}
        <= set(found)
        <= {k for k, clear in share.items() if clear < 1.0}
    )
    assert 2 < len(found) < 13
    assert any(via is not None for via in found.values())
    for pose, via in found.items():
        if via is not None:
            road = np.concatenate([q[pose - 1 : pose], via, q[pose : pose + 1]])
            assert len(via)
            assert (q.min(axis=0) - 1e-9 <= via).all()
            assert (via <= q.max(axis=0) + 1e-9).all()
            assert np.mean([is_clear(driven(a, b), (POST,)).mean() for a, b in pairwise(road)]) > 0.97


def test_paths_between_setups_are_nobody_s():
    """What stands after another was taken away is driven to by hand."""
    q, of = postures(14), np.arange(14) % 2
    assert find_blocked_paths(MODEL, InTurns(fixtures=FIXTURES, keep_out=(POST,)), q, of) == ()
    halves = np.arange(14) // 7
    blocked = {one.pose for one in find_blocked_paths(MODEL, InTurns(fixtures=FIXTURES, keep_out=(POST,)), q, halves)}
    camera = CameraInstrument(fixtures=FIXTURES, keep_out=(POST,))
    assert blocked == {one.pose for one in find_blocked_paths(MODEL, camera, q, halves)} - {7}


@given(generators, st.integers(1, 6))
def test_points_far_apart_are_each_the_farthest_from_those_before(rng, count):
    p = rng.normal(size=(12, 3))
    chosen = far_apart(p, count)
    assert np.linalg.norm(chosen[0] - p.mean(axis=0)) == pytest.approx(np.linalg.norm(p - p.mean(axis=0), axis=1).max())
    for k in range(1, count):
        away = [min(np.linalg.norm(one - other) for other in chosen[:k]) for one in p]
        assert min(np.linalg.norm(chosen[k] - other) for other in chosen[:k]) == pytest.approx(max(away))


@given(generators, st.sampled_from(["any", "x", "z"]))
def test_directions_across_an_axis_lead_away_from_the_base(rng, which):
    """Unit vectors, square to the axis and to each other; the first not towards the robot, the second to the left of it."""
    axis = {"any": rng.normal(size=3), "x": np.eye(3)[0], "z": np.eye(3)[2]}[which]
    axis = axis / np.linalg.norm(axis)
    middle = rng.uniform(-1.0, 1.0, 3)
    away, left = directions_across(middle, axis)
    np.testing.assert_allclose(np.stack([away, left, axis]) @ np.stack([away, left, axis]).T, np.eye(3), atol=1e-9)
    assert np.linalg.det(np.stack([away, left, axis])) == pytest.approx(1.0)
    if which == "z":
        assert away @ middle == pytest.approx(np.linalg.norm(middle[:2]))


def test_nothing_stands_below_the_base():
    p = np.array([[0.3, -0.4, -0.2], [-0.5, 0.1, 0.7]])
    np.testing.assert_array_equal(on_the_floor(p), [[0.3, -0.4, 0.0], [-0.5, 0.1, 0.7]])
