"""Frames that CSYS and TRNTYP state, and when it is certain in which one points are counted."""

import numpy as np
from hypothesis import given

from robot_programs.apt.read import StatedFrames, stated_frame
from robot_programs.apt.syntax import parse
from taskcal.geometry import se3
from tests.laws.robots import generators


def csys(R: np.ndarray, p: np.ndarray):
    numbers = np.concatenate([R, p[:, None]], axis=1).ravel()
    (statement,) = parse("CSYS/" + ",".join(f"{value:.6f}" for value in numbers))
    return statement


@given(generators)
def test_twelve_numbers_are_a_pose_row_by_row_and_a_mirror_is_none(rng):
    R, p = se3.exp(rng.normal(size=3)), rng.normal(size=3) * 100.0
    np.testing.assert_allclose(stated_frame(csys(R, p)), np.c_[R, p], atol=1e-6)
    assert stated_frame(csys(R * [1.0, 1.0, -1.0], p)) is None
    assert stated_frame(csys(R * 1.01, p)) is None


@given(generators)
def test_the_first_frame_is_the_part_s_and_another_one_is_uncertain_until_the_first_returns(rng):
    frames = StatedFrames()
    first, other = (csys(se3.exp(rng.normal(size=3)), rng.normal(size=3)) for _ in range(2))
    assert frames.read_csys(first, 3) is None
    assert "another frame is stated than the first" in (frames.read_csys(other, 7) or "")
    assert frames.moved_since == 7
    assert frames.read_csys(first, 9) is None
    assert frames.moved_since is None


@given(generators)
def test_in_the_world_s_coordinates_a_turned_frame_is_certain_where_the_tool_axis_is_its_own(rng):
    tilted = se3.exp(np.array([rng.uniform(0.5, 2.5), 0.0, 0.0]))
    frames = StatedFrames()
    (world,) = parse("TRNTYP/WORLD,0,0,0")
    assert frames.read_trntyp(world, 1) is None
    assert frames.read_csys(csys(np.eye(3), np.zeros(3)), 2) is None
    assert frames.read_csys(csys(tilted, np.zeros(3)), 3) is None
    assert frames.why_uncertain(tilted[:, 2]) is None
    assert "frame of line 3" in (frames.why_uncertain(np.array([0.0, 0.0, 1.0])) or "")


def test_coordinates_that_are_moved_are_uncertain():
    (moved,) = parse("TRNTYP/WORLD,10,0,0")
    assert "since line 4" in (StatedFrames().read_trntyp(moved, 4) or "")
