"""Numbers written anew."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot_programs.core.source import numeral, renumbered

values = st.floats(-1e5, 1e5)


@given(values, values, st.integers(0, 9), st.integers(0, 9))
def test_a_new_value_comes_back_to_the_decimals_that_matter_and_an_old_one_keeps_its_text(was, value, shown, decimals):
    text = f"{was:.{shown}f}"
    written = renumbered(text, float(text), value, decimals)
    assert float(written) == pytest.approx(value, abs=0.51 * 10.0**-decimals)
    assert renumbered(text, float(text), float(text), decimals) == text


@pytest.mark.parametrize(
    ("text", "value", "expected"),
    [
        ("1.", 2.0, "2.000"),
        ("1.00000", 2.0, "2.00000"),
        ("1.5E+01", 2.0, "2.000"),
        ("7", 7.0004, "7"),
        ("7", -0.0001, "0.000"),
    ],
)
def test_decimals_follow_the_text(text, value, expected):
    assert renumbered(text, float(text), value, 3) == expected


def test_zero_has_no_sign():
    assert numeral(-1e-9, 3) == "0.000"
