"""Configurations: against what a controller printed, and between postures of one pose."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot_programs.core.program import Unresolved
from robot_programs.tp.listing import Configuration
from taskcal.robot.error_model import ErrorModel
from tests.laws.robots import generators
from tests.robot_programs.tp.samples import R2000, degrees

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


@given(generators)
def test_a_posture_agrees_with_its_own_configuration(rng):
    for _ in range(5):
        q = rng.uniform(*R2000.limits.T)
        own = NUT.of(R2000, q)
        assert own.agrees(R2000, q[None])[0]


@given(generators)
def test_configuration_distinguishes_ik_branches(rng):
    """The configuration string distinguishes the IK branches of one pose."""
    q = degrees(*rng.uniform([-80, 0, -40, -90, -100, -90], [80, 40, 0, 90, -10, 90]))
    flipped = q * [1, 1, 1, 1, -1, 1] + degrees(0, 0, 0, 180, 0, 180)
    turned = q + degrees(0, 0, 0, 0, 0, 360)
    poses = ErrorModel(R2000).poses(np.stack([q, flipped, turned]))
    np.testing.assert_allclose(poses, poses[[0, 0, 0]], atol=1e-9)
    np.testing.assert_array_equal(NUT.of(R2000, q).agrees(R2000, np.stack([q, flipped, turned])), [True, False, False])


def test_turns_are_those_of_axis_6_and_of_1_and_4_or_4_and_5():
    q = degrees(0, 10, -20, 200, -60, -190)
    assert str(NUT.of(R2000, q)) == "N U T, 0, 1, -1"
    assert Configuration.parse("N U T, 1, 0, -1").agrees(R2000, q[None])[0]
    assert str(Configuration.parse("N U T, 1, 0, -1").of(R2000, q)) == "N U T, 1, 0, -1"
