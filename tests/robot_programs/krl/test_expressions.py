"""Expressions of KRL: their values against those of Python, and what is refused."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot_programs.core.form import Routine
from robot_programs.core.interpreter import Moment, Walker, interpreted
from robot_programs.core.program import Unresolved
from robot_programs.core.values import Structure
from robot_programs.krl.data import KrlFile, Names
from robot_programs.krl.lower import RoutineScope, lowered
from robot_programs.krl.meaning import KrlMeaning
from robot_programs.krl.syntax import lines_of_words
from robot_programs.krl.values import ARRAY, Real, frame_of, inverse, is_whole, position, product
from tests.laws.robots import generators
from tests.robot_programs.krl.samples import source

POINT = position("POS", {"X": 10.0, "Y": 0.0, "Z": 0.0})
VALUES = {
    "A": 2.0,
    "B1": Real(-3.5),
    "OK": True,
    "P": Structure(kind=ARRAY, parts={2: position("E6POS", {"X": 10.0, "S": 2.0})}),
    "MODE": "#BASE",
    "POINT": POINT,
}
FILES = (KrlFile.of(0, source("part.src", "DEF PART( )\nEND\n")),)
FORM = lowered(Names(files=FILES))
FLOW = interpreted(list(FORM.routines.values()), KrlMeaning(lowered=FORM, given_frames={}))


def value(text):
    """Value of an expression where `VALUES` hold."""
    expression = RoutineScope(next(iter(FORM.routines)), FORM).expression(next(lines_of_words(text), []))
    return Walker(flow=FLOW, routine=Routine(name="PART"), inside=()).value(expression, Moment(variables=VALUES))


numbers = st.sampled_from(["1.5", "2", "A", "B1", "0.25"])
sums = st.recursive(
    numbers,
    lambda inner: st.tuples(inner, st.sampled_from("+-*"), inner).map(lambda t: f"({t[0]} {t[1]} {t[2]})"),
    max_leaves=8,
)


@given(sums, st.sampled_from(["+", "-", "*"]), sums, st.sampled_from(["<", "<=", ">", ">="]))
def test_numbers_are_those_of_python(left, sign, right, compare):
    python = {"A": 2.0, "B1": -3.5}
    text = f"{left} {sign} {right} * A - B1"
    assert value(text) == pytest.approx(eval(text, python))
    text = f"{left} {compare} {right}"
    assert value(text) == eval(text, python)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("A == 2", True),
        ("A <> 2", False),
        ("NOT OK", False),
        ("OK AND A > 1 OR FALSE", True),
        ("OK EXOR OK", False),
        ("MODE == #BASE", True),
        ("P[A].X + 1", 11.0),
        ("P[1 + 1].S", 2.0),
        ("'B101'", 5.0),
        ("'HFF'", 255.0),
        ("-A", -2.0),
        ("1.0 / 4.5", 1.0 / 4.5),
        ("6 / 3", 2.0),
        ("5.0 / 2", 2.5),
        ("POINT.X / 4", 2.5),
        ("SQRT(25) / 2", 2.5),
        ("ABS(B1) + SQRT(6.25)", 6.0),
        ("100.0 * COS(60) + SIN(-30)", pytest.approx(49.5)),
        ("ATAN2(1.0, -1.0) - ACOS(0.0) - TAN(45)", pytest.approx(44.0)),
    ],
)
def test_values(text, expected):
    assert value(text) == expected


@pytest.mark.parametrize(
    "text",
    [
        "C", "A +", "A 1", "F(A)", "P[B1]", "P[0]", "P[2].Y", "1 / 2", "1 / 0", "A + OK", "NOT A", "P[2] + 1", "{X}", "{X 1,X 2}",
        "(" * 60 + "1" + ")" * 60, "MODE < 1", "SQRT(-1)", "ACOS(2)", "ATAN2(1)", "SIN(1,2)", "ABS(OK)", "{X {Y 1}}", "", "1E400",
    ],
)  # fmt: skip
def test_what_the_text_does_not_tell_has_no_value(text):
    with pytest.raises(Unresolved):
        value(text)


@given(generators)
def test_the_geometric_operator_multiplies_poses(rng):
    texts = [
        "{" + ",".join(f"{name} {rng.uniform(-170, 170):.3f}" for name in ("X", "Y", "Z", "A", "B", "C")) + "}"
        for _ in range(3)
    ]
    frames = [value(text) for text in texts]
    expected = np.linalg.multi_dot([frame_of(frame) for frame in frames])
    np.testing.assert_allclose(frame_of(value(":".join(texts))), expected, atol=1e-12)


def test_a_product_has_the_status_of_its_right_factor():
    zero = {"X": 0.0, "Y": 0.0, "Z": 0.0, "A": 0.0, "B": 0.0, "C": 0.0}
    left, right = position("E6POS", {**zero, "S": 2.0, "T": 10.0}), position("POS", {**zero, "S": 6.0})
    assert product(left, right).parts == {**zero, "S": 6.0}
    with pytest.raises(Unresolved, match="external axes"):
        product(position("E6POS", {**zero, "E1": 5.0}), right)
    with pytest.raises(Unresolved, match="must be FRAME or POS"):
        product(position("E6AXIS", {"A1": 0.0}), right)


def test_an_element_is_that_of_its_index():
    with pytest.raises(Unresolved, match="which element of P is meant"):
        value("P[C]")
    with pytest.raises(Unresolved, match="a number is expected"):
        value("P[OK]")


def test_a_structure_is_whole_or_says_nothing_of_a_kind():
    assert is_whole(position("", {"TOOL_NO": 1.0}))
    assert not is_whole(position("", {"X": 1.0}))
    assert not is_whole(position("", {"A1": 1.0, "A2": 0.0}))


@given(generators)
def test_inv_pos_gives_the_inverse_frame(rng):
    """Homogeneous transformations, with R = Rz(A) Ry(B) Rx(C)."""
    values = dict(zip("XYZABC", [*rng.uniform(-2000, 2000, 3), *rng.uniform(-180, 180, 3)], strict=True))
    frame = position("FRAME", values)
    (cA, cB, cC), (sA, sB, sC) = (f(np.radians([values[n] for n in "ABC"])) for f in (np.cos, np.sin))
    T = np.eye(4)
    T[:3, :3] = [
        [cA * cB, cA * sB * sC - sA * cC, cA * sB * cC + sA * sC],
        [sA * cB, sA * sB * sC + cA * cC, sA * sB * cC - cA * sC],
        [-sB, cB * sC, cB * cC],
    ]
    T[:3, 3] = [values[n] / 1e3 for n in "XYZ"]
    np.testing.assert_allclose(frame_of(inverse(frame)), np.linalg.inv(T), atol=1e-9)
    np.testing.assert_allclose(frame_of(product(frame, inverse(frame))), np.eye(4), atol=1e-9)
