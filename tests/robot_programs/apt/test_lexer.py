"""Numbers of a path."""

import pytest

from robot_programs.apt.syntax import parse


@pytest.mark.parametrize(
    ("text", "number"),
    [("1", 1.0), ("-.5", -0.5), ("+2.5E3", 2500.0), ("1E99", None), ("1.5.", None), ("MM", None), (".", None)],
)
def test_numbers_are_those_of_a_path(text, number):
    (statement,) = parse(f"GOTO/{text}")
    assert statement.tokens[2].number == number
