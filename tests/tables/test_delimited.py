from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from taskcal.tables.text import parse_delimited, separator_of

cells = st.lists(st.lists(st.floats(-1e6, 1e6), min_size=4, max_size=4), min_size=2, max_size=8)


@given(cells, st.sampled_from([",", ";", "\t", "|", " ", "   "]), st.booleans())
def test_rows_come_back_whatever_parts_them(rows, separator, named):
    lines = [separator.join(f"{v:.3f}" for v in row) for row in rows]
    if named:
        lines.insert(0, separator.join("abcd"))
    sheet = parse_delimited(Path("a.txt"), "\n".join(lines), ".")
    expected = [tuple(f"{v:.3f}" for v in row) for row in rows]
    assert list(sheet.rows) == ([tuple("abcd")] if named else []) + expected
    assert list(sheet.lines) == list(range(1, len(lines) + 1))


@given(cells, st.sampled_from([";", "\t", ", "]))
def test_decimal_commas_are_told_from_separators(rows, separator):
    lines = [separator.join(f"{v:.4f}".replace(".", ",") for v in row) for row in rows]
    sheet = parse_delimited(Path("a.txt"), "\n".join(lines))
    assert list(sheet.rows) == [tuple(f"{v:.4f}" for v in row) for row in rows]
    assert sheet.notes == ("numbers are read with decimal commas",)


def test_comments_are_kept_apart_and_lines_counted_with_them():
    sheet = parse_delimited(Path("a.txt"), "// made by hand\n# x y\n1,2\n\n! end\n3,4\n")
    assert tuple(sheet.rows) == (("1", "2"), ("3", "4"))
    assert tuple(sheet.lines) == (3, 6)
    assert sheet.comments == ("made by hand", "x y", "end")


@pytest.mark.parametrize("separator", [";", ",", "\t"])
def test_a_spreadsheets_line_says_the_separator(separator):
    sheet = parse_delimited(Path("a.txt"), f"sep={separator}\na{separator}b\n1{separator}2\n")
    assert tuple(sheet.rows) == (("a", "b"), ("1", "2"))
    assert tuple(sheet.lines) == (2, 3)


def test_quoted_cells_hold_separators_and_line_ends():
    sheet = parse_delimited(Path("a.txt"), 'a,b\n"1, or so",2\n"3\n4",5\n')
    assert tuple(sheet.rows[1:]) == (("1, or so", "2"), ("3\n4", "5"))
    assert tuple(sheet.lines) == (1, 2, 4)


def test_names_with_blanks_do_not_part_a_table_of_tabs():
    assert separator_of(["Point ID\tDev From Fit", "a b\t1", "c d\t2"]) == "\t"
