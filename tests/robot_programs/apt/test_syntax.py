"""What stands behind the slash of a statement."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot_programs.apt.syntax import parse


@given(st.lists(st.floats(-1e6, 1e6), min_size=1, max_size=6))
def test_arguments_between_commas_are_numbers_where_all_are(values: list[float]) -> None:
    (statement,) = parse("GOTO/" + ",".join(map(repr, values)))
    assert statement.numbers == tuple(values)
    (statement,) = parse("GOTO/" + ",".join([*map(repr, values), "on"]))
    assert statement.numbers is None
    assert statement.words[-1] == "ON"


@pytest.mark.parametrize("text", ["GOTO/1,,2", "GOTO/1,2,", "GOTO/(P1),2", "GOTO=1,2", "GOTO/"])
def test_arguments_that_are_not_so_simple_are_none(text: str) -> None:
    (statement,) = parse(text)
    assert not statement.words
    assert statement.arguments is None


def test_a_word_alone_has_no_arguments() -> None:
    (statement,) = parse("RAPID")
    assert statement.arguments == ()
