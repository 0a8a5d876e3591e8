"""A program's text keeps every byte that is not edited, and knows its lines."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot_programs.core.source import MAX_LINE_LENGTH, MAX_LINES, Edit, Source
from taskcal.errors import FileError

PATH = Path("program.mod")
texts = st.text(st.sampled_from("ab \t\r\nß"), max_size=40)


@given(st.binary(max_size=60))
def test_every_byte_comes_back_whatever_the_encoding(data):
    assert Source.of(PATH, data).encode() == data


@given(st.data(), texts)
def test_edits_are_those_of_the_text_cut_by_hand_in_whatever_order_they_come(data, text):
    cuts = sorted(
        data.draw(st.lists(st.integers(0, len(text)), min_size=4, max_size=4, unique=True))
        if len(text) > 3
        else [0] * 4
    )
    a, b, c, d = cuts
    edits = [Edit(start=a, end=b, text="first"), Edit(start=c, end=d, text="second")]
    source = Source(path=PATH, text=text, encoding="utf-8")
    expected = text[:a] + "first" + text[b:c] + "second" + text[d:]
    assert source.edited(edits).text == expected
    if a < c:
        assert source.edited(edits[::-1]).text == expected


def test_edits_that_overlap_are_refused_with_their_line():
    source = Source(path=PATH, text="one\ntwo three\n", encoding="utf-8")
    with pytest.raises(ValueError, match=r"edits of program\.mod overlap in line 2"):
        source.edited([Edit(start=4, end=9, text=""), Edit(start=8, end=10, text="")])


@given(texts)
def test_lines_are_counted_by_their_ends_and_indents_are_what_they_begin_with(text):
    source = Source(path=PATH, text=text, encoding="utf-8")
    lines = text.split("\n")
    for position in range(len(text)):
        number = text.count("\n", 0, position) + 1
        assert source.line(position) == number
        assert str(source.place(position)) == f"program.mod:{number}"
        line = lines[number - 1]
        assert source.indent(position) == line[: len(line) - len(line.lstrip(" \t"))]


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_a_file_without_lines_is_refused_and_one_of_long_lines_is_not(end):
    line = "a " * (MAX_LINE_LENGTH // 2)
    assert Source.of(PATH, end.join([line, "b", line, line]).encode()).text.count(line) == 3
    with pytest.raises(FileError, match=r"program\.mod:\d: has more than 1,000,000 characters in one line") as raised:
        Source.of(PATH, end.join([line, "b", line + "a", line]).encode())
    assert raised.value.line == (1 if end == "\r" else 3)


def test_a_file_of_more_lines_than_any_program_is_refused():
    assert Source.of(PATH, b"\n" * MAX_LINES).line(MAX_LINES) == MAX_LINES + 1
    with pytest.raises(FileError, match=r"program\.mod: has 3,000,001 lines, more than 3,000,000; divide it"):
        Source.of(PATH, b"\n" * (MAX_LINES + 1))
