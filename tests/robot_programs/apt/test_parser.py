"""Statements of APT: every word where it stands, whatever lines, blanks and comments lie between."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot_programs.apt.syntax import parse

words = st.sampled_from(["GOTO", "1.5", "-2.", "+.5E-1", "MMPM", "TOOL PATH", "PT"])
separators = st.sampled_from(["/", ",", "(", ")", "="])
breaks = st.sampled_from(["", " ", "  ", "$\n", " $ text that is passed over\r\n"])


@given(st.lists(st.tuples(breaks, separators, breaks, words), min_size=1, max_size=8))
def test_a_statement_is_its_words_wherever_its_lines_are_broken(parts):
    text = "FROM" + "".join("".join(part) for part in parts)
    (statement,) = parse(text + "\n")
    expected = ["FROM", *(piece for _, separator, _, word in parts for piece in (separator, word))]
    if len(expected) > 2 and expected[1] == ")":  # a label
        expected = expected[2:]
    assert [token.text for token in statement.tokens] == expected
    assert all(text[token.start : token.end] == token.text for token in statement.tokens)
    assert text[statement.start : statement.end].split("/")[0].startswith(expected[0])


def test_comments_and_lines_of_text_hold_no_words():
    comment, part, motion = parse("$$ GOTO/1,2,3\nPARTNO A/1,2\nGOTO/1,2,3 $$ behind\n")
    assert (comment.word, comment.text, comment.tokens) == ("$$", " GOTO/1,2,3", ())
    assert (part.word, part.text, part.tokens) == ("PARTNO", " A/1,2", ())
    assert motion.numbers == (1.0, 2.0, 3.0)


def test_the_number_of_a_card_is_no_part_of_its_statement():
    (statement,) = parse("GOTO/1.0,2.0,3.0".ljust(72) + "PT    12\n")
    assert statement.numbers == (1.0, 2.0, 3.0)


# Numbers of a path.


@pytest.mark.parametrize(
    ("text", "number"),
    [("1", 1.0), ("-.5", -0.5), ("+2.5E3", 2500.0), ("1E99", None), ("1.5.", None), ("MM", None), (".", None)],
)
def test_numbers_are_those_of_a_path(text, number):
    (statement,) = parse(f"GOTO/{text}")
    assert statement.tokens[2].number == number


# What stands behind the slash of a statement.


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


@pytest.mark.parametrize("sign", ["", "+", "-"])
def test_a_number_that_no_path_has_is_none(sign):
    """Too large with either sign, or for a number at all."""
    (statement,) = parse(f"GOTO/{sign}1E9,{sign}1.1E9,{sign}1E999\n")
    assert [token.number is None for token in statement.tokens[2::2]] == [False, True, True]
