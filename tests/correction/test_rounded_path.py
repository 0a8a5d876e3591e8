"""Rounded corners: a parabola between lines, tangent where it begins and ends, and nothing else changed."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import cumulative_simpson

from taskcal.correction.path import Corners, RoundedPath, Segments
from taskcal.geometry import se3

NO_VIA = np.full(3, np.nan)


def random_pose(rng, turn=0.5):
    return se3.pose(se3.exp(turn * rng.normal(size=3)), rng.normal(size=3))


def path_of(poses, exit_, entry, vias=(NO_VIA, NO_VIA)):
    """Two segments through three poses, with the shares of each that a corner between them takes."""
    segments = Segments(start=np.array(poses[:2]), end=np.array(poses[1:]), via=np.array(vias))
    none = Corners.none(2)
    corners = replace(
        none,
        after=np.array([1, -1]),
        before=np.array([-1, 0]),
        exit=np.array([exit_, (0.0, 0.0)]),
        entry=np.array([(0.0, 0.0), entry]),
    )
    return RoundedPath(segments=segments, corners=corners)


def random_corner(seed):
    """Two lines of random lengths, left and joined equally far from the target."""
    rng = np.random.default_rng(seed)
    poses = [random_pose(rng) for _ in range(3)]
    lengths = np.array([np.linalg.norm(b[:3, 3] - a[:3, 3]) for a, b in pairwise(poses)])
    near, far = np.sort(rng.uniform(0.05, 0.5, 2)) * lengths.min()
    path = path_of(poses, (near / lengths[0], far / lengths[0]), (near / lengths[1], far / lengths[1]))
    return path, lengths, near, far


def through(path, reach):
    """Places through the corner, evenly in the share of both motions, and how far from the target by the segments."""
    u = np.linspace(-1.0, 1.0, 401)
    move = (u > 0.0).astype(np.int64)
    exit_, entry = path.corners.exit[0].max() * reach, path.corners.entry[1].max() * reach
    return move, np.where(move == 0, 1.0 + u * exit_, u * entry), u


@pytest.mark.parametrize("seed", range(6))
def test_the_tool_point_goes_as_under_constant_acceleration(seed):
    """The parabola: the velocity turns evenly from the one along the first line to the one along the second."""
    path, lengths, near, _ = random_corner(seed)
    moved = path.segments.end[:, :3, 3] - path.segments.start[:, :3, 3]
    first, second = moved / lengths[:, None]
    distance = np.linspace(-near, near, 401)
    weight = (distance / near + 1.0)[:, None] / 2.0
    velocity = (1.0 - weight) * first + weight * second
    begin = path.segments.end[0, :3, 3] - near * first
    expected = begin + cumulative_simpson(velocity, x=distance, axis=0, initial=0.0)
    move = (distance > 0.0).astype(np.int64)
    share = np.where(move == 0, 1.0 + distance / lengths[0], distance / lengths[1])
    np.testing.assert_allclose(path.at(move, share)[:, :3, 3], expected, atol=1e-12)
    sign = (path.direction(move, share) * velocity).sum(axis=1) / np.linalg.norm(velocity, axis=1)
    np.testing.assert_allclose(sign, 1.0, atol=1e-9)


@pytest.mark.parametrize("seed", range(6))
def test_corner_lies_in_its_triangle(seed):
    """The corner lies in the triangle of where it begins its target and where it ends."""
    path, lengths, near, _ = random_corner(seed)
    P = path.segments.end[0, :3, 3]
    A = P + near / lengths[0] * (path.segments.start[0, :3, 3] - P)
    B = P + near / lengths[1] * (path.segments.end[1, :3, 3] - P)
    move, share, u = through(path, near / (path.corners.exit[0].max() * lengths[0]))
    own = path.at(move, share)[:, :3, 3]
    weights, residual, *_ = np.linalg.lstsq(np.stack([A - P, B - P], axis=1), (own - P).T, rcond=None)
    assert residual.max(initial=0.0) < 1e-20
    assert (weights > -1e-12).all()
    assert (weights.sum(axis=0) < 1.0 + 1e-12).all()
    np.testing.assert_allclose(own[np.argmin(np.abs(u))], (A + 2.0 * P + B) / 4.0, atol=1e-12)


@pytest.mark.parametrize("seed", range(6))
def test_outside_its_corner_the_path_is_the_segments(seed):
    path, *_ = random_corner(seed)
    share = np.linspace(0.0, 1.0, 101)
    for move, size in ((0, path.corners.exit[0]), (1, path.corners.entry[1])):
        number = np.full(len(share), move)
        T, sharp = path.at(number, share), path.segments.at(number, share)
        from_target = 1.0 - share if move == 0 else share
        np.testing.assert_allclose(T[from_target >= size[0], :3, 3], sharp[from_target >= size[0], :3, 3], atol=1e-14)
        np.testing.assert_allclose(T[from_target >= size[1], :3, :3], sharp[from_target >= size[1], :3, :3], atol=1e-14)
        assert (path.inside(number, share) == (from_target < size[1])).all()


@pytest.mark.parametrize("seed", range(6))
def test_place_and_orientation_run_on_without_a_step_or_a_kink(seed):
    path, lengths, _, far = random_corner(seed)
    for distance in (-far, -far / 3.0, 0.0, far / 2.0, far):
        at = distance + np.array([-1e-6, 0.0, 1e-6])
        move = (at > 0.0).astype(np.int64)
        T = path.at(move, np.where(move == 0, 1.0 + at / lengths[0], at / lengths[1]))
        steps = np.diff(T[:, :3, 3], axis=0)
        turns = se3.log(np.swapaxes(T[:-1, :3, :3], 1, 2) @ T[1:, :3, :3])
        np.testing.assert_allclose(steps[0], steps[1], atol=1e-10)
        np.testing.assert_allclose(turns[0], turns[1], atol=1e-10)


def test_orientation_changes_from_its_own_zone_on():
    """About one axis it turns at a rate that changes evenly, from the edge of the wider zone on."""
    z = np.array([0.0, 0.0, 1.0])
    poses = [
        se3.pose(se3.exp(angle * z), np.array(p, dtype=float))
        for angle, p in ((0.0, (0, 0, 0)), (0.0, (1, 0, 0)), (0.8, (1, 1, 0)))
    ]
    path = path_of(poses, (0.1, 0.3), (0.1, 0.3))
    distance = np.linspace(-0.3, 0.3, 13)
    move = (distance > 0.0).astype(np.int64)
    T = path.at(move, np.where(move == 0, 1.0 + distance, distance))
    np.testing.assert_allclose(se3.log(T[:, :3, :3])[:, 2], 0.8 * (distance + 0.3) ** 2 / (4.0 * 0.3), atol=1e-12)
    early = (distance < -0.1) & (distance > -0.3)
    np.testing.assert_array_equal(T[early, 1, 3], 0.0)


def test_a_turn_on_the_spot_is_rounded_too():
    z = np.array([0.0, 0.0, 1.0])
    poses = [se3.pose(se3.exp(angle * z), np.array([1.0, 2.0, 3.0])) for angle in (0.0, 0.4, 0.1)]
    path = path_of(poses, (0.25, 0.25), (1.0 / 3.0, 1.0 / 3.0))
    T = path.at(np.array([0, 0, 1]), np.array([0.75, 1.0, 1.0 / 3.0]))
    np.testing.assert_allclose(T[:, :3, 3], [[1.0, 2.0, 3.0]] * 3)
    np.testing.assert_allclose(se3.log(T[:, :3, :3])[:, 2], [0.3, 0.4 - 0.1 / 2.0, 0.3], atol=1e-12)


@pytest.mark.parametrize("half", [0.1, 0.3])
def test_corner_between_arc_pieces_keeps_to_the_circle(half):
    """Between two pieces of one arc the path keeps to the circle."""

    def on(angle):
        return np.array([np.cos(angle), np.sin(angle), 0.0])

    poses = [se3.pose(np.eye(3), on(angle)) for angle in (-0.7, 0.0, 0.7)]
    path = path_of(poses, (half / 0.7, half / 0.7), (half / 0.7, half / 0.7), vias=(on(-0.3), on(0.4)))
    move, share, _ = through(path, 1.0)
    np.testing.assert_allclose(np.linalg.norm(path.at(move, share)[:, :3, 3], axis=1), 1.0, atol=0.01 * half**4)
    assert (path.bent().corners.after == -1).all()


def test_corners_as_good_as_straight_are_none():
    poses = [se3.translation(*p) for p in ((0.0, 0.0, 0.0), (0.1, 0.0, 0.0), (0.2, 1e-6, 0.0))]
    path = path_of(poses, (0.1, 0.1), (0.1, 0.1))
    straight = path.bent()
    assert (straight.corners.after == -1).all()
    assert not straight.corners.exit.any()
    assert not straight.corners.entry.any()
    poses[2] = se3.translation(0.2, 0.01, 0.0)
    bent = path_of(poses, (0.1, 0.1), (0.1, 0.1)).bent()
    assert bent.corners.after[0] == 1
