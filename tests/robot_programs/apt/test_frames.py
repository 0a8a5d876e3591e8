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
def test_frame_of_twelve_numbers_is_a_pose_by_rows(rng):
    """Twelve numbers are a pose row by row and a mirror is none."""
    R, p = se3.exp(rng.normal(size=3)), rng.normal(size=3) * 100.0
    np.testing.assert_allclose(stated_frame(csys(R, p)), np.c_[R, p], atol=1e-6)
    assert stated_frame(csys(R * [1.0, 1.0, -1.0], p)) is None
    assert stated_frame(csys(R * 1.01, p)) is None


@given(generators)
def test_frames_other_than_the_first_are_uncertain(rng):
    """The first frame is the part's and another one is uncertain until the first returns."""
    frames = StatedFrames()
    first, other = (csys(se3.exp(rng.normal(size=3)), rng.normal(size=3)) for _ in range(2))
    assert frames.read_csys(first, 3) is None
    assert "another frame is stated than the first" in (frames.read_csys(other, 7) or "")
    assert frames.moved_since == 7
    assert frames.read_csys(first, 9) is None
    assert frames.moved_since is None


@given(generators)
def test_turned_frame_is_certain_if_the_tool_axis_agrees(rng):
    """In the world's coordinates a turned frame is certain where the tool axis is its own."""
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
