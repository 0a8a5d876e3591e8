import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot_programs.core.program import Unresolved, rotation
from robot_programs.krl.data import axes, edits_for, external, pose, pose_values
from robot_programs.krl.syntax import Aggregate, lines_of_words, parse_operand

degrees = st.floats(-360.0, 360.0)


def aggregate(text: str) -> Aggregate:
    (words,) = lines_of_words(text)
    (part,) = parse_operand(words).parts
    assert isinstance(part, Aggregate)
    return part


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
