import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from taskcal.errors import RobotError, UnknownName
from taskcal.robot.robot_file import parse_linear

NAMES = ("J1", "J2", "slide", "J10")

values = st.floats(-1e3, 1e3, allow_subnormal=False).map(lambda v: round(v, 6))


@st.composite
def expressions(draw, depth=4):
    """Text of a homogeneous linear expression, and its coefficients, built side by side."""
    if depth == 0 or draw(st.booleans()):
        name = draw(st.sampled_from(NAMES))
        return name, np.array([float(n == name) for n in NAMES])
    kind = draw(st.sampled_from(["negate", "plus", "sum", "difference", "times", "timed", "over", "nothing"]))
    text, coefficients = draw(expressions(depth=depth - 1))
    match kind:
        case "negate":
            return f"-({text})", -coefficients
        case "plus":
            return f"+({text})", coefficients
        case "sum" | "difference":
            other, more = draw(expressions(depth=depth - 1))
            sign = "+" if kind == "sum" else "-"
            return f"{text} {sign} ({other})", coefficients + (more if kind == "sum" else -more)
        case "times":
            factor = draw(values)
            return f"{factor!r}*({text})", factor * coefficients
        case "timed":
            factor = draw(values)
            return f"({text}) * ({factor!r} - 2)", coefficients * (factor - 2)
        case "over":
            factor = draw(values.filter(lambda v: abs(v) > 1e-3))
            return f"({text}) / {factor!r}", coefficients / factor
    return f"  {text} + 0", coefficients


@given(expressions())
def test_linear_expression_gives_its_coefficients(case):
    """Any way of writing a linear expression gives its coefficients."""
    text, coefficients = case
    np.testing.assert_allclose(parse_linear(text, NAMES), coefficients, rtol=1e-12, atol=1e-300)


@pytest.mark.parametrize(
    "text",
    [
        "J1*J2", "J1/J2", "2/J1", "J1**2", "sin(J1)", "J1 if J2 else J1", "J1 // 2", "True*J1", "J1/0", "J1.x", "J1[0]",
        "'J1'", "1j*J1", "J1 & J2", "not J1", "__import__('os')",
    ],
)  # fmt: skip
def test_what_is_not_linear_is_refused_with_an_example(text):
    with pytest.raises(RobotError, match=r"is not linear in joint names; write for example '-\(J2 \+ J3\)'"):
        parse_linear(text, NAMES)


@pytest.mark.parametrize("text", ["", "J1 +", "J1 J2", "(J1", "J1; J2", "J1 = J2", "\0"])
def test_what_is_no_expression_is_refused(text):
    with pytest.raises(RobotError, match="is not an expression"):
        parse_linear(text, NAMES)


def test_a_constant_belongs_into_the_offset():
    with pytest.raises(RobotError, match=r"'J1 \+ 90' has a constant 90; put it into the joint's offset"):
        parse_linear("J1 + 90", NAMES)


def test_an_unknown_joint_is_named_with_its_nearest():
    with pytest.raises(UnknownName, match=r"no joint 'J11' \(in 'J11 - J2'\); did you mean 'J1'"):
        parse_linear("J11 - J2", NAMES)


@pytest.mark.parametrize(
    "text", ["(" * 5000 + "J1" + ")" * 5000, "J1" + "+J1" * 20_000, "9" * 5000, "J1\0", "-" * 5000 + "J1"]
)
def test_hostile_text_is_refused_with_a_short_message(text):
    with pytest.raises(RobotError) as caught:
        parse_linear(text, ["J1"])
    assert len(str(caught.value)) < 400


def test_nesting_as_deep_as_an_expression_may_be_is_followed():
    np.testing.assert_array_equal(parse_linear("-" * 190 + "J1", ["J1"]), [1.0])
