"""Positions of KRL: their numbers, and status and turn."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot_programs.core.program import Unresolved, rotation
from robot_programs.core.values import Structure
from robot_programs.krl.points import ACCURATE_BIT, StatusTurn
from robot_programs.krl.syntax import lines_of_words
from robot_programs.krl.values import axes, edits_for, external, pose, pose_values, value_in
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from tests.laws.robots import generators

KR16 = load_robot("kuka-kr16-2")


def postures(rng: np.random.Generator, n: int) -> np.ndarray:
    return rng.uniform(KR16.limits[:, 0], KR16.limits[:, 1], (n, 6))


def wrist_centre(q: np.ndarray) -> np.ndarray:
    """158 mm behind the flange, along its z axis."""
    T = ErrorModel(KR16).poses(q)
    return T[:, :3, 3] - 0.158 * T[:, :3, 2]


@pytest.mark.parametrize(
    ("q_deg", "S", "T"),
    [
        ((0, -90, 90, 0, 0, 0), 0b010, 0b000010),  # the usual home position
        ((0, -90, 90, 0, 45, 0), 0b010, 0b000010),
        ((0, -90, 90, 0, -45, 0), 0b110, 0b010010),
        ((-1, -90, -90, -1, 45, -350), 0b000 | 0b001, 0b101111),  # forearm backwards: overhead
        ((0, -90, -2.9, 0, 45, 0), 0b010, 0b000110),  # the elbow is straight at A3 = −arctan(35/670) = −2.99°
        ((0, -90, -3.1, 0, 45, 0), 0b000, 0b000110),
        ((170, 30, 10, 180, 120, 350), 0b010, 0b000000),
    ],
)
def test_status_and_turn_of_postures_by_hand(q_deg, S, T):
    q = np.radians(np.array(q_deg, dtype=float))
    assert StatusTurn(S=0, T=0).of(KR16, q) == StatusTurn(S=S, T=T)
    assert StatusTurn(S=S, T=T).agrees(KR16, q[None]).all()
    for bit in range(3):
        if abs(q[4]) > 1e-6 or bit != 2:
            assert not StatusTurn(S=S ^ 1 << bit, T=T).agrees(KR16, q[None]).any()


@given(generators)
def test_turn_is_the_signs_of_the_axes(rng):
    for q in postures(rng, 10):
        T = StatusTurn(S=None, T=0).of(KR16, q).T
        assert [bool(T >> i & 1) for i in range(6)] == [angle < 0 for angle in q]


@given(generators)
def test_overhead_is_behind_axis_1(rng):
    q = postures(rng, 20)
    centre = wrist_centre(q)
    # axis 1 counts clockwise from above; x of a frame that turns with it
    x = centre[:, 0] * np.cos(-q[:, 0]) + centre[:, 1] * np.sin(-q[:, 0])
    S = np.array([StatusTurn(S=0, T=None).of(KR16, row).S for row in q])
    np.testing.assert_array_equal(S & 1 == 1, x < 0)


@given(generators)
def test_status_elbow_bit_is_the_side_of_a_straight_arm(rng):
    """The elbow bit is axis 3 against the angle where it is straight."""
    q = postures(rng, 20)
    S = np.array([StatusTurn(S=0, T=None).of(KR16, row).S for row in q])
    np.testing.assert_array_equal(S & 2 == 2, np.sin(q[:, 2] + np.arctan2(35.0, 670.0)) >= 0)


@given(generators, st.integers(0, 31), st.integers(0, 4095))
def test_bits_of_other_meaning_stay(rng, S, T):
    found = StatusTurn(S=S, T=T).of(KR16, postures(rng, 1)[0])
    assert found.S is not None
    assert found.T is not None
    assert found.S & ~0b111 == S & ~0b111
    assert found.S & ACCURATE_BIT == S & ACCURATE_BIT
    assert found.T & ~0b111111 == T & ~0b111111


@given(generators, st.integers(0, 7), st.integers(0, 63))
def test_a_posture_agrees_with_its_own_status_alone(rng, S, T):
    q = postures(rng, 10)
    stated = StatusTurn(S=S, T=T)
    own = [stated.of(KR16, row) == stated for row in q]
    np.testing.assert_array_equal(stated.agrees(KR16, q), own)


def test_optional_fields_are_not_required():
    """Unstated S and T agree with every configuration."""
    q = postures(np.random.default_rng(0), 5)
    assert StatusTurn(S=None, T=None).agrees(KR16, q).all()
    assert StatusTurn(S=None, T=None).of(KR16, q[0]) == StatusTurn(S=None, T=None)


@pytest.mark.parametrize("name", ["ur10", "barrett-wam"])
def test_status_stays_without_a_spherical_wrist(name):
    """Without a wrist of three axes through one point status stays."""
    robot = load_robot(name)
    q = np.full(len(robot.joints), -0.3)
    assert StatusTurn(S=5, T=0).of(robot, q) == StatusTurn(S=5, T=0b111111)
    assert StatusTurn(S=5, T=0b111111).agrees(robot, q[None]).all()
    assert not StatusTurn(S=5, T=0b111110).agrees(robot, q[None]).any()


def test_bits_on_the_border_may_have_either_value():
    q = np.radians([[0.0, -90.0, 90.0, 0.0, 0.0, 0.0]])
    for T in (0b000010, 0b111010):
        assert StatusTurn(S=None, T=T).agrees(KR16, q).all()
        assert StatusTurn(S=None, T=T).of(KR16, q[0]).T == T
    assert not StatusTurn(S=None, T=0b000110).agrees(KR16, q).any()


degrees = st.floats(-360.0, 360.0)


def aggregate(text: str) -> Structure:
    (words,) = lines_of_words(text)
    value = value_in(0, words)
    assert isinstance(value, Structure)
    return value


def with_edits(text: str, values: dict[str, float]) -> str:
    for edit in reversed(edits_for(aggregate(text), values)):
        text = text[: edit.start] + edit.text + text[edit.end :]
    return text


def test_a_pose_by_hand():
    T = pose(aggregate("{X 100.0,Y -20,Z 5E1,A 90,B 0,C 0}"))
    np.testing.assert_allclose(T, [[0, -1, 0, 0.1], [1, 0, 0, -0.02], [0, 0, 1, 0.05], [0, 0, 0, 1]], atol=1e-15)


def test_axes_are_radians():
    q = axes(aggregate("{A1 0,A2 -90,A3 90.0,A4 180,A5 -45,A6 360}"))
    np.testing.assert_allclose(q, np.pi * np.array([0, -0.5, 0.5, 1, -0.25, 2]))


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("{X 1,Y 2,Z 3,A 0,B 0}", "C is not stated, so it keeps its value of before"),
        ("{X height,Y 2,Z 3,A 0,B 0,C 0}", "X is 'height', which is not a number"),
        ("{X 1e999,Y 2,Z 3,A 0,B 0,C 0}", "X is '1e999', which is not a number"),
    ],
)
def test_an_incomplete_position_says_what_is_missing(text, reason):
    with pytest.raises(Unresolved, match=reason):
        pose(aggregate(text))


def test_external_axes_are_read_where_they_are_stated():
    np.testing.assert_equal(external(aggregate("{X 1,E1 0.0,E2 12.5}")), [0.0, 12.5, *[np.nan] * 4])
    with pytest.raises(Unresolved, match="E2 is 'nPos', which is not a number"):
        external(aggregate("{X 1,E1 0.0,E2 nPos}"))


@given(st.tuples(*[st.floats(-3000, 3000)] * 3), st.tuples(degrees, degrees, degrees), st.floats(-1e-9, 1e-9))
def test_numbers_that_stay_keep_their_text(xyz, abc, noise):
    (x, y, z), (A, B, C) = xyz, abc
    text = f"{{X {x:.3f}, Y {y:.6f} ,Z {z:.1f},A {A:.4f},B {B:.2f},C {C:.6f},S 2,T 35,E1 0.0}}"
    T = pose(aggregate(text))
    T[:3, 3] += noise
    values = pose_values(T, aggregate(text))
    new = with_edits(text, values)
    if abs(np.cos(np.radians(abc[1]))) > 1e-3:
        assert new == text
    np.testing.assert_allclose(pose(aggregate(new)), T, atol=2e-8)


@given(st.tuples(*[st.floats(-3000, 3000)] * 3), st.tuples(degrees, degrees, degrees))
def test_new_numbers_are_within_what_krl_can_hold(xyz, abc):
    text = "{C 1,B 2,A 3,  Z 4,Y 5,X 6}"
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = rotation(*abc), np.array(xyz) * 1e-3
    again = pose(aggregate(with_edits(text, pose_values(T, aggregate(text)))))
    np.testing.assert_allclose(again[:3, 3], T[:3, 3], atol=0.51e-8)
    np.testing.assert_allclose(again[:3, :3], T[:3, :3], atol=3e-8)


def test_a_number_stays_apart_from_its_name():
    assert with_edits("{X-1.5,Y+2,Z 3}", {"X": 1.25, "Y": 2.0, "Z": 4.0}) == "{X 1.25000,Y+2,Z 4.00000}"


def test_what_is_no_number_stays():
    assert with_edits("{X 1,T turn,S 'B2'}", {"X": 1.0, "T": 5.0, "S": 2.0}) == "{X 1,T turn,S 'B2'}"


def test_only_the_digits_change():
    text = "{E6POS: X 1.5, y 2.000 ,Z 3, A 0,B 0,C 0,S 'B010',T 'H23', E1 0.0}"
    values = {"X": 1.5, "Y": 2.1, "Z": -3.25, "A": 0.0, "B": 0.0, "C": 0.0, "S": 6.0, "T": 3.0}
    expected = "{E6POS: X 1.5, y 2.10000 ,Z -3.25000, A 0,B 0,C 0,S 'B110',T 'H03', E1 0.0}"
    assert with_edits(text, values) == expected


def test_what_is_no_component_stays():
    """A blank that is missing, or one too many digit, makes a component that no position has."""
    assert with_edits("{X 1,E50.0,E6 0.0}", {"X": 2.0, "E50": 0.0, "E6": 3.0}) == "{X 2.00000,E50.0,E6 3.000000}"
