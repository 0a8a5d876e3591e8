"""Paths of the tool: where tools and parts are, lines and arcs, and rounded corners."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import cumulative_simpson

from robot_programs.core.program import Frame, Zone
from taskcal.correction.controller import simulate_controller
from taskcal.correction.path import PlacedMotions, Placement, RoundedCorners, RoundedPath, Segments, find_corners
from taskcal.geometry import se3
from taskcal.robot.error_model import ErrorModel
from tests.laws.robots import generators

# From the robot's tool to the program's and back, whatever the robot holds.


def poses(rng: np.random.Generator, n: int) -> np.ndarray:
    return se3.pose(se3.exp(rng.normal(size=(n, 3))), rng.normal(size=(n, 3)))


def placement(rng: np.random.Generator, part_in_hand: bool) -> Placement:
    grasped, fixed = poses(rng, 2)
    return Placement(T_tool_grasped=grasped, T_base_fixed=fixed, part_in_hand=part_in_hand)


@given(generators, st.booleans())
def test_the_robot_s_tool_is_the_inverse_of_the_program_s(rng, part_in_hand):
    one, T = placement(rng, part_in_hand), poses(rng, 5)
    np.testing.assert_allclose(one.tool_in_part(one.robot_tool(T)), T, atol=1e-12)
    # on the path of both frames round the loop: base to fixed to grasped is base to tool to grasped
    X = se3.inverse(T) if part_in_hand else T
    np.testing.assert_allclose(one.T_base_fixed @ X, one.robot_tool(T) @ one.T_tool_grasped, atol=1e-12)


@given(generators)
def test_each_motion_has_the_placement_of_its_number(rng):
    both = placement(rng, False), placement(rng, True)
    B = poses(rng, 6)
    placed = PlacedMotions(
        tool_in_base=lambda q, move, share: B[move], placements=both, number=np.array([0, 1, 1, 0, 0, 1])
    )
    move = rng.permutation(6)
    T = placed.tool_in_part(move, np.ones(6), np.zeros((6, 6)))
    for k, i in enumerate(move):
        np.testing.assert_allclose(T[k], both[placed.number[i]].tool_in_part(B[i][None])[0], atol=1e-12)
    np.testing.assert_allclose(placed.robot_tool(move, T), B[move], atol=1e-12)


# Lines and arcs.


angles = st.floats(0.05, 6.2)
seeds = st.integers(0, 10_000)


def circle(seed):
    rng = np.random.default_rng(seed)
    R, center, radius = se3.exp(rng.normal(size=3)), rng.normal(size=3), rng.uniform(0.01, 0.5)
    return lambda angle: center + radius * R @ np.array([np.cos(angle), np.sin(angle), 0.0]), radius


@given(end=angles, sense=st.sampled_from([-1.0, 1.0]), share=st.floats(0.1, 0.9), seed=seeds)
def test_an_arc_runs_on_the_circle_through_its_via_point(end, sense, share, seed):
    point, radius = circle(seed)
    R = se3.exp(np.random.default_rng(seed).normal(size=3) * 0.4)
    segments = Segments(
        start=se3.pose(np.eye(3), point(0.0))[None],
        end=se3.pose(R, point(sense * end))[None],
        via=point(sense * end * share)[None],
    )
    u = np.linspace(0.0, 1.0, 7)
    T = segments.at(np.zeros(7, dtype=int), u)
    np.testing.assert_allclose(T[:, :3, 3], [point(sense * end * s) for s in u], atol=1e-7)
    np.testing.assert_allclose(segments.length, radius * end, rtol=1e-5)
    np.testing.assert_allclose(T[-1, :3, :3], R, atol=1e-12)
    # orientation keeps pace with the distance gone, about one axis
    np.testing.assert_allclose(se3.log(T[:, :3, :3]), u[:, None] * se3.log(R), atol=1e-9)


@given(seed=seeds, u=st.floats(0.0, 1.0))
def test_the_direction_is_the_derivative_of_the_place(seed, u):
    point, _ = circle(seed)
    start, end = se3.pose(np.eye(3), point(0.0)), se3.pose(np.eye(3), point(2.5))
    segments = Segments(
        start=np.stack([start, start]), end=np.stack([end, end]), via=np.stack([point(1.0), np.full(3, np.nan)])
    )
    rows, h = np.arange(2), 1e-6
    ahead, behind = (segments.at(rows, np.full(2, u + s))[:, :3, 3] for s in (h, -h))
    slope = (ahead - behind) / np.linalg.norm(ahead - behind, axis=1, keepdims=True)
    np.testing.assert_allclose(segments.direction(rows, np.full(2, u)), slope, atol=1e-6)
    assert segments.is_arc.tolist() == [True, False]


def test_a_point_on_the_chord_makes_a_line():
    start, end = se3.translation(x=0.1), se3.translation(x=0.3)
    segments = Segments(start=start[None], end=end[None], via=np.array([[0.2, 0.0, 0.0]]))
    assert not segments.is_arc[0]
    assert segments.length[0] == pytest.approx(0.2)
    np.testing.assert_allclose(segments.at(np.array([0]), np.array([0.25]))[0, :3, 3], [0.15, 0.0, 0.0])


def test_an_unknown_start_leaves_the_length_open():
    segments = Segments(start=np.full((1, 4, 4), np.nan), end=np.eye(4)[None], via=np.full((1, 3), np.nan))
    assert np.isnan(segments.length[0])
    assert not segments.is_arc[0]


# Where corners are rounded, and how much of both motions they take.


@pytest.fixture
def corners(robot, make_moves, shifted):
    """Of lines through points, millimetres, with a zone at each."""

    def build(points, zones, change=lambda motions: motions):
        motions = make_moves([shifted(*point) for point in points])
        motions = [replace(move, zone=zone, stops=zone is None) for move, zone in zip(motions, zones, strict=True)]
        motions = change(motions)
        return simulate_controller(robot, motions).corners

    return build


SQUARE = [(0, 0, 0), (100, 0, 0), (100, 60, 0), (0, 60, 0)]


def test_a_corner_takes_what_its_zone_says_of_both_motions(corners):
    found = corners(SQUARE, [None, Zone(distance=0.01, turn_distance=0.015), None, None])
    np.testing.assert_allclose(found.exit[1], [0.1, 0.15])
    np.testing.assert_allclose(found.entry[2], [0.01 / 0.06, 0.015 / 0.06])
    assert found.after.tolist() == [-1, 2, -1, -1]
    assert found.before.tolist() == [-1, -1, 1, -1]


def test_corners_take_half_of_the_shorter_motion(corners):
    """No corner takes more than half of the shorter motion and none overlap."""
    wide = Zone(distance=0.2, turn_distance=0.3)
    found = corners(SQUARE, [None, wide, wide, None])
    np.testing.assert_allclose(found.exit[1], 0.3)
    np.testing.assert_allclose(found.entry[2], 0.5)
    np.testing.assert_allclose(found.exit[2], 0.5)
    np.testing.assert_allclose(found.entry[3], 0.3)
    assert (found.entry.max(axis=1) + found.exit.max(axis=1) <= 1.0 + 1e-12).all()


@pytest.mark.parametrize("zone", [None, Zone(), Zone(distance=np.inf, share=0.0)])
def test_where_it_stops_or_has_no_zone_the_tool_meets_its_target(corners, zone):
    found = corners(SQUARE, [None, zone, None, None])
    assert (found.after == -1).all()
    assert not found.exit.any()


def test_a_zone_whose_size_is_not_known_is_not_guessed(corners):
    unknown = lambda motions: [replace(move, stops=False, zone=None) for move in motions]  # noqa: E731
    assert (corners(SQUARE, [None] * 4, unknown).after == -1).all()


def test_a_share_counts_of_the_motion_that_is_left(corners):
    found = corners(SQUARE, [None, Zone(distance=np.inf, share=0.25), None, None])
    np.testing.assert_allclose(found.exit[1], 0.25)
    np.testing.assert_allclose(found.entry[2], 0.025 / 0.06)


def test_motions_with_another_tool_do_not_share_a_corner(robot, corners):
    other = Frame(name="other", T=robot.T_flange_tool @ se3.translation(z=0.01))
    changed = lambda motions: [*motions[:2], replace(motions[2], tool=other), motions[3]]  # noqa: E731
    zone = Zone(distance=0.01)
    assert corners(SQUARE, [None, zone, zone, None], changed).after.tolist() == [-1, -1, -1, -1]


def test_unknown_next_motion_has_no_corner(corners):
    """Where it is not known which motion comes next there is no corner."""
    both = lambda motions: [*motions[:3], replace(motions[3], follows=1)]  # noqa: E731
    zone = Zone(distance=0.01)
    assert (corners(SQUARE, [None, zone, None, None], both).after == -1).all()


def test_turns_on_the_spot_have_zones_of_their_own(robot, make_moves, middle):
    turned = [
        se3.pose(middle[:3, :3] @ se3.exp(np.array([0.0, 0.0, angle])), middle[:3, 3]) for angle in (0.0, 0.2, 0.1)
    ]
    motions = [replace(move, zone=Zone(distance=0.01, angle=0.02)) for move in make_moves(turned)]
    found = simulate_controller(robot, motions).corners
    np.testing.assert_allclose(found.exit[1], 0.1)
    np.testing.assert_allclose(found.entry[2], 0.2)


def test_joint_motion_is_left_and_joined_on_its_path(robot, make_moves, shifted):
    """Where it is left, the joints are at the same share of their way."""
    motions = make_moves([shifted(*point) for point in SQUARE])
    motions = [replace(move, kind="joint", zone=Zone(distance=0.02)) for move in motions]
    trajectory = simulate_controller(robot, motions)
    found = trajectory.corners
    model = ErrorModel(robot)
    for i, share, T in ((1, 1.0 - found.exit[1, 0], found.left[1]), (2, found.entry[2, 0], found.joined[2])):
        q = trajectory.start[i] + share * (trajectory.end[i] - trajectory.start[i])
        np.testing.assert_allclose(model.poses(q[None])[0], T, atol=1e-9)
    np.testing.assert_allclose(found.exit[1, 0], 0.2)
    assert np.isnan(found.left[3]).all()


def test_nothing_is_rounded_in_a_program_without_motions():
    empty = Segments(start=np.zeros((0, 4, 4)), end=np.zeros((0, 4, 4)), via=np.zeros((0, 3)))
    found = find_corners([], empty, np.zeros(0, dtype=bool), lambda rows, share: np.zeros((0, 4, 4)))
    assert len(found.after) == 0


# Rounded corners: a parabola between lines, tangent where it begins and ends, and nothing else changed.


NO_VIA = np.full(3, np.nan)


def random_pose(rng, turn=0.5):
    return se3.pose(se3.exp(turn * rng.normal(size=3)), rng.normal(size=3))


def path_of(poses, exit_, entry, vias=(NO_VIA, NO_VIA)):
    """Two segments through three poses, with the shares of each that a corner between them takes."""
    segments = Segments(start=np.array(poses[:2]), end=np.array(poses[1:]), via=np.array(vias))
    none = RoundedCorners.none(2)
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
