"""Expressions of KRL: their values against those of Python, and what is refused."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot_programs.core.program import Unresolved
from robot_programs.krl.data import pose
from robot_programs.krl.syntax import Aggregate, Reference, lines_of_words
from robot_programs.krl.values import evaluated, inverse, is_whole, name_of, number_of, product, structure, values_of
from tests.laws.robots import generators

POINT = structure("POS", {"X": 10.0, "Y": 0.0, "Z": 0.0})
VALUES = {
    "A": 2.0,
    "B1": -3.5,
    "OK": True,
    "P[2]": structure("E6POS", {"X": 10.0, "S": 2.0}),
    "MODE": "#BASE",
    "POINT": POINT,
}


class Table:
    def value(self, name):
        if name not in VALUES:
            raise Unresolved(f"{name} is not known")
        return VALUES[name]


def words(text):
    return next(lines_of_words(text), [])


def value(text):
    return evaluated(words(text), Table())


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
    got = value(":".join(texts))
    assert isinstance(got, Aggregate)
    expected = np.linalg.multi_dot([pose(frame) for frame in frames])
    np.testing.assert_allclose(pose(got), expected, atol=1e-12)


def test_a_product_has_the_status_of_its_right_factor():
    zero = {"X": 0.0, "Y": 0.0, "Z": 0.0, "A": 0.0, "B": 0.0, "C": 0.0}
    left, right = structure("E6POS", {**zero, "S": 2.0, "T": 10.0}), structure("POS", {**zero, "S": 6.0})
    assert values_of(product(left, right)) == {**zero, "S": 6.0}
    with pytest.raises(Unresolved, match="external axes"):
        product(structure("E6POS", {**zero, "E1": 5.0}), right)
    with pytest.raises(Unresolved, match="must be FRAME or POS"):
        product(structure("E6AXIS", {"A1": 0.0}), right)


def test_names_have_their_index_as_a_number():
    index = (tuple(words("A+1")), tuple(words("2")))
    assert name_of(Reference(name="Q[A+1,2]", start=0, end=0, index=index), Table()) == "Q[3,2]"
    with pytest.raises(Unresolved, match="which element of Q is meant"):
        name_of(Reference(name="Q[C]", start=0, end=0, index=(tuple(words("C")),)), Table())
    with pytest.raises(Unresolved, match="'OK' is not a number"):
        number_of(words("OK"), Table())


def test_a_structure_is_whole_or_says_nothing_of_a_kind():
    assert is_whole(structure("", {"TOOL_NO": 1.0}))
    assert not is_whole(structure("", {"X": 1.0}))
    assert not is_whole(structure("", {"A1": 1.0, "A2": 0.0}))


@given(generators)
def test_inv_pos_gives_the_inverse_frame(rng):
    """Homogeneous transformations, with R = Rz(A) Ry(B) Rx(C)."""
    values = dict(zip("XYZABC", [*rng.uniform(-2000, 2000, 3), *rng.uniform(-180, 180, 3)], strict=True))
    frame = structure("FRAME", values)
    (cA, cB, cC), (sA, sB, sC) = (f(np.radians([values[n] for n in "ABC"])) for f in (np.cos, np.sin))
    T = np.eye(4)
    T[:3, :3] = [
        [cA * cB, cA * sB * sC - sA * cC, cA * sB * cC + sA * sC],
        [sA * cB, sA * sB * sC + cA * cC, sA * sB * cC - cA * sC],
        [-sB, cB * sC, cB * cC],
    ]
    T[:3, 3] = [values[n] / 1e3 for n in "XYZ"]
    np.testing.assert_allclose(pose(inverse(frame)), np.linalg.inv(T), atol=1e-9)
    np.testing.assert_allclose(pose(product(frame, inverse(frame))), np.eye(4), atol=1e-9)
