"""Words of RAPID: each stands where it says, and nothing but blanks, comments and the header lies between them."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot_programs.rapid.syntax import number, tokenize

pieces = st.sampled_from(
    ["MoveL", "p1", "10", "0x1F", "1.5E-3", ":=", "<=", "[", ",", '"a ""b"" !c"', "!x\n", " ", "\n", "\\"]
)


@given(st.lists(pieces, max_size=20).map("".join) | st.text(max_size=40))
def test_words_stand_where_they_say_and_only_blanks_and_comments_lie_between(text):
    *tokens, end = tokenize(text)
    assert (end.kind, end.start) == ("end", len(text))
    position = 0
    for token in (*tokens, end):
        between = text[position : token.start]
        if not between.lstrip("\ufeff \t\r\n").startswith("%%%"):
            left = "".join(line.split("!")[0] for line in between.splitlines())
            assert not left.replace("\ufeff", "").strip()
        assert text[token.start : token.end] == token.text
        position = token.end


@pytest.mark.parametrize(
    ("text", "value"), [("12", 12.0), (".5", 0.5), ("1e3", 1e3), ("0xFf", 255.0), ("0b101", 5.0), ("0o17", 15.0)]
)
def test_numbers_have_their_value_in_every_base(text, value):
    token, _ = tokenize(text)
    assert token.kind == "number"
    assert number(token) == value


def test_letter_case_counts_in_strings_only_and_a_header_has_no_words():
    name, text, _ = tokenize('%%%\n VERSION:1\n%%%\nMoveL "Abc"')
    assert (name.text, name.key) == ("MoveL", "movel")
    assert (text.kind, text.key) == ("text", '"Abc"')
