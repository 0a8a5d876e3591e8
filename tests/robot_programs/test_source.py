"""A program's text keeps every byte that is not edited, and knows its lines."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot_programs.core.source import MAX_LINE_LENGTH, MAX_LINES, FreshNames, Source, TextEdit, numeral, renumbered
from taskcal.errors import FileError

PATH = Path("program.mod")
texts = st.text(st.sampled_from("ab \t\r\nß"), max_size=40)


@given(st.binary(max_size=60))
def test_every_byte_comes_back_whatever_the_encoding(data):
    assert Source.of(PATH, data).encode() == data


@given(st.data(), texts)
def test_edits_may_come_in_any_order(data, text):
    """Edits are those of the text cut by hand in whatever order they come."""
    cuts = sorted(
        data.draw(st.lists(st.integers(0, len(text)), min_size=4, max_size=4, unique=True))
        if len(text) > 3
        else [0] * 4
    )
    a, b, c, d = cuts
    edits = [TextEdit(start=a, end=b, text="first"), TextEdit(start=c, end=d, text="second")]
    source = Source(path=PATH, text=text, encoding="utf-8")
    expected = text[:a] + "first" + text[b:c] + "second" + text[d:]
    assert source.edited(edits).text == expected
    if a < c:
        assert source.edited(edits[::-1]).text == expected


def test_edits_that_overlap_are_refused_with_their_line():
    source = Source(path=PATH, text="one\ntwo three\n", encoding="utf-8")
    with pytest.raises(ValueError, match=r"edits of program\.mod overlap in line 2"):
        source.edited([TextEdit(start=4, end=9, text=""), TextEdit(start=8, end=10, text="")])


@given(texts)
def test_lines_are_counted_by_their_ends(text):
    """Lines are counted by their ends and indents are what they begin with."""
    source = Source(path=PATH, text=text, encoding="utf-8")
    lines = text.split("\n")
    for position in range(len(text)):
        number = text.count("\n", 0, position) + 1
        assert source.line(position) == number
        assert str(source.place(position)) == f"program.mod:{number}"
        line = lines[number - 1]
        assert source.indent(position) == line[: len(line) - len(line.lstrip(" \t"))]


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_file_without_line_ends_is_refused(end):
    """A file without lines is refused and one of long lines is not."""
    line = "a " * (MAX_LINE_LENGTH // 2)
    assert Source.of(PATH, end.join([line, "b", line, line]).encode()).text.count(line) == 3
    with pytest.raises(FileError, match=r"program\.mod:\d: has more than 1,000,000 characters in one line") as raised:
        Source.of(PATH, end.join([line, "b", line + "a", line]).encode())
    assert raised.value.line == (1 if end == "\r" else 3)


def test_a_file_of_more_lines_than_any_program_is_refused():
    assert Source.of(PATH, b"\n" * MAX_LINES).line(MAX_LINES) == MAX_LINES + 1
    with pytest.raises(FileError, match=r"program\.mod: has 3,000,001 lines, more than 3,000,000; divide it"):
        Source.of(PATH, b"\n" * (MAX_LINES + 1))


# Numbers written anew.


values = st.floats(-1e5, 1e5)


@given(values, values, st.integers(0, 9), st.integers(0, 9))
def test_numeral_keeps_the_decimals_that_matter(was, value, shown, decimals):
    """A new value comes back to the decimals that matter and an old one keeps its text."""
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


# Names for new data: fresh, short enough, and as few characters away from what they are like as can be.


names = st.text("abAB12", min_size=1, max_size=6)


@given(words=st.lists(names), wanted=st.lists(names, min_size=1, max_size=12), longest=st.integers(5, 8))
def test_names_are_new_whatever_their_case_and_never_too_long(words, wanted, longest):
    fresh = FreshNames(words, longest=longest, reserved=("A",))
    made = [fresh.like(name) for name in wanted]
    in_use = {word.lower() for word in words} | {"a"}
    assert len({name.lower() for name in made}) == len(made)
    assert in_use.isdisjoint(name.lower() for name in made)
    assert all(len(name) <= longest for name in made)


@given(words=st.lists(names), wanted=names)
def test_a_free_name_is_taken_as_it_is_but_once(words, wanted):
    fresh = FreshNames(words, longest=12)
    free = wanted.lower() not in {word.lower() for word in words}
    assert (fresh.nearest(wanted) == wanted) == free
    assert fresh.nearest(wanted) != wanted


def test_fresh_names_are_long_only_among_long_words():
    """Names grow beyond the usual length only where a word does."""
    assert FreshNames(["short"], longest=32, usual=8).like("abcdefghijkl") == "abcdef_2"
    assert FreshNames(["a" * 10], longest=32, usual=8).like("abcdefghijkl") == "abcdefgh_2"
    assert FreshNames(["a" * 40], longest=11, usual=8).like("abcdefghijkl") == "abcdefghi_2"


def test_the_words_are_read_when_the_first_name_is_asked_for():
    def words():
        read.append(True)
        yield "p_2"

    read: list[bool] = []
    fresh = FreshNames(words(), longest=8)
    assert not read
    assert (fresh.like("p"), fresh.like("p")) == ("p_3", "p_4")
    assert len(read) == 1
