from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from taskcal.errors import FileError
from taskcal.tables.text import find_decimal_mark, with_point


def mark_of(*cells):
    return find_decimal_mark(Path("a.txt"), enumerate(cells, start=2))


@pytest.mark.parametrize(
    ("cells", "mark"),
    [
        (["1,5"], ","),
        (["12,345", "0,123"], ","),
        (["1234,567"], ","),
        (["1.234,5"], ","),
        (["-2,305.6424", "12,345"], "."),
        (["1,234,567"], "."),
        (["12,345", "7.25"], "."),
        (["3,14159"], ","),
        (["a,b", "x"], "."),
    ],
)
def test_unambiguous_cell_decides_decimal_mark(cells, mark):
    """One unambiguous cell decides the decimal mark of all cells."""
    assert mark_of(*cells) == mark


def test_a_doubtful_number_alone_is_not_guessed():
    with pytest.raises(FileError, match=r"a\.txt:2: '12,345' may be 12\.345 or 12345, .* state the decimal mark"):
        mark_of("12,345", "-6,789")


def test_both_marks_in_one_file_are_refused_with_a_line_of_each():
    with pytest.raises(
        FileError, match=r"a\.txt:4: '1,5' in line 2 has a decimal comma, '2\.25' in line 4 a decimal point"
    ):
        mark_of("1,5", "text", "2.25")


@given(st.floats(-1e9, 1e9, allow_nan=False))
def test_numbers_written_in_either_way_are_the_same(value):
    english = f"{value:,.4f}"
    german = english.translate(str.maketrans(",.", ".,"))
    assert float(with_point(english, ".")) == float(with_point(german, ",")) == float(f"{value:.4f}")


@pytest.mark.parametrize("text", ["point 1,5 mm", "a,b", "1,2,3x", ""])
def test_what_is_no_number_stays_as_it_is(text):
    assert with_point(text, ",") == with_point(text, ".") == text
