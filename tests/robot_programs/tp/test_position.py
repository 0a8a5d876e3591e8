"""Positions of a listing, and their configurations."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from robot_programs.core.program import Unresolved
from robot_programs.tp.listing import Configuration, edits_for, joint_values, listed, pose_values, read_positions
from tests.robot_programs.tp.samples import R2000, degrees, joints, pose

lengths, angles = st.floats(-3000.0, 3000.0), st.floats(-180.0, 180.0)


def only(inside: str, label: str = "7"):
    (position,) = read_positions(f"P[{label}]{{\n{inside}}};", 0, 10**6)
    return position


@given(lengths, lengths, lengths, angles, angles, angles)
def test_w_p_and_r_turn_about_fixed_x_y_and_z(x, y, z, w, p, r):
    T = only(pose(x, y, z, w, p, r)).groups[1].pose()
    stated = [round(value, 3) for value in (w, p, r)]
    np.testing.assert_allclose(T[:3, :3], Rotation.from_euler("xyz", stated, degrees=True).as_matrix(), atol=1e-12)
    np.testing.assert_allclose(T[:3, 3] * 1e3, [x, y, z], atol=5.1e-4)


def test_frames_configuration_and_joints():
    group = only(pose(1, 2, 3, frames="UF : 4, UT : F", configuration="F D B, 1, 0, -1"), '7:"a b"').groups[1]
    assert (group.frame, group.tool, group.configuration) == (4, None, "F D B, 1, 0, -1")
    np.testing.assert_allclose(only(joints(1, 2, 3, 4, 5, 6)).groups[1].joints(6), np.radians([1, 2, 3, 4, 5, 6]))


def test_what_is_missing_is_said():
    group = only(pose(1, 2, 3).replace("Z =     3.000  mm,", "")).groups[1]
    with pytest.raises(Unresolved, match="does not state Z"):
        group.pose()
    with pytest.raises(Unresolved, match="5 joints, and the robot 6"):
        only(joints(1, 2, 3, 4, 5)).groups[1].joints(6)
    stars = only(pose(1, 2, 3).replace("    3.000  mm", "********  mm")).groups[1]
    with pytest.raises(Unresolved, match="does not state Z"):
        stars.pose()


@pytest.mark.parametrize("number", ["3.W", "3.000e2", "3.0.0", "3.000mmx", "***W"])
def test_a_number_that_runs_into_something_else_is_not_read(number):
    group = only(pose(1, 2, 3).replace("    3.000  mm", number)).groups[1]
    with pytest.raises(Unresolved, match="does not state"):
        group.pose()


def test_external_axes_of_groups_follow_extended_ones():
    """Axes of further groups follow the extended ones of the robot."""
    inside = (
        pose(1, 2, 3).rstrip()
        + ",\n\tE1=   900.000  mm\n   GP2:\n\tUF : 0, UT : 1,\n\tJ1=    45.000 deg,\tJ2=   -10.000 deg\n"
    )
    position = only(inside)
    assert position.external == ((1, "E1"), (2, "J1"), (2, "J2"))
    assert position.external_positions() == (900.0, 45.0, -10.0)


@given(lengths, lengths, lengths, angles, st.floats(-80.0, 80.0), angles)
def test_new_numbers_stand_in_the_columns_of_the_old(x, y, z, w, p, r):
    text = f"P[7]{{\n{pose(100, 200, 300)}}};"
    (position,) = read_positions(text, 0, len(text))
    wanted = only(pose(x, y, z, w, p, r)).groups[1].pose()
    edited = text
    for edit in sorted(edits_for(position.groups[1], pose_values(wanted, position.groups[1])), key=lambda e: -e.start):
        edited = edited[: edit.start] + edit.text + edited[edit.end :]
    (again,) = read_positions(edited, 0, len(edited))
    np.testing.assert_allclose(again.groups[1].pose()[:3, 3], wanted[:3, 3], atol=5.1e-8)
    np.testing.assert_allclose(again.groups[1].pose()[:3, :3], wanted[:3, :3], atol=3e-7)
    if max(abs(x), abs(y), abs(z)) < 1000.0:
        assert abs(len(edited) - len(text)) <= 6


def test_a_new_position_is_read_back():
    q = np.radians([10.0, -20.0, 30.0, 40.0, -50.0, 160.0])
    (position,) = read_positions(f"P[9{listed((2, 3), joint_values(q), '', chr(10))}", 0, 10**6)
    np.testing.assert_allclose(position.groups[1].joints(6), q, atol=1e-9)
    assert (position.groups[1].frame, position.groups[1].tool) == (2, 3)
    T = only(pose(10, 20, 30, 170, 5, -60)).groups[1].pose()
    (position,) = read_positions(f"P[9{listed((0, 1), pose_values(T), 'N U T, 0, 0, 0', chr(10))}", 0, 10**6)
    np.testing.assert_allclose(position.groups[1].pose(), T, atol=1e-7)
    assert position.groups[1].configuration == "N U T, 0, 0, 0"


# Configurations: against what a controller printed, and between postures of one pose.


NUT = Configuration.parse("N U T, 0, 0, 0")


def test_a_position_that_a_controller_printed_both_ways_agrees():
    # joints and configuration of one position, as an R-J3iC printed them
    q = degrees(86.75, -45.63, -10.99, 56.19, -81.55, -94.01)
    assert NUT.agrees(R2000, q[None])[0]
    assert NUT.of(R2000, q) == NUT
    for other in ("F U T, 0, 0, 0", "N D T, 0, 0, 0", "N U B, 0, 0, 0", "N U T, 0, 0, 1", "N U T, 0, 1, 0"):
        assert not Configuration.parse(other).agrees(R2000, q[None])[0], other


@given(st.sampled_from("NF"), st.sampled_from("UD"), st.sampled_from("TB"), *[st.integers(-2, 2)] * 3)
def test_text_is_read_back(flip, elbow, front, a, b, c):
    text = f"{flip} {elbow} {front}, {a}, {b}, {c}"
    assert str(Configuration.parse(text)) == text


@pytest.mark.parametrize("text", ["", "R, 0, 0, 0", "N U", "N U T 0 0 0 0", "X Y Z, 0, 0, 0"])
def test_other_forms_are_not_understood(text):
    with pytest.raises(Unresolved, match="not understood"):
        Configuration.parse(text)


def test_turns_are_those_of_axis_6_and_of_1_and_4_or_4_and_5():
    q = degrees(0, 10, -20, 200, -60, -190)
    assert str(NUT.of(R2000, q)) == "N U T, 0, 1, -1"
    assert Configuration.parse("N U T, 1, 0, -1").agrees(R2000, q[None])[0]
    assert str(Configuration.parse("N U T, 1, 0, -1").of(R2000, q)) == "N U T, 1, 0, -1"
