"""Where corners are rounded, and how much of both motions they take."""

from dataclasses import replace

import numpy as np
import pytest

from robot_programs.core.program import Frame, Zone
from taskcal.correction.controller import simulate_controller
from taskcal.correction.path import find_corners
from taskcal.geometry import se3
from taskcal.robot.error_model import ErrorModel


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
    from taskcal.correction.path import Segments

    empty = Segments(start=np.zeros((0, 4, 4)), end=np.zeros((0, 4, 4)), via=np.zeros((0, 3)))
    found = find_corners([], empty, np.zeros(0, dtype=bool), lambda rows, share: np.zeros((0, 4, 4)))
    assert len(found.after) == 0
