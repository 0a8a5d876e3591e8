from pathlib import Path

import pytest

from taskcal.errors import FileError
from taskcal.tables.forms import lay_out
from taskcal.tables.text import parse_delimited


def laid(text, names=None):
    return lay_out(parse_delimited(Path("a.txt"), text), names)


FORMS = {
    "plain": ("a,b,c\n1,2,3\n4,5,6\n", 1, (2, 3), ()),
    "preamble": (
        "Report of today\nMade by hand\n\na,b,c\n1,2,3\n4,5,6\n",
        4,
        (5, 6),
        ("Report of today", "Made by hand"),
    ),
    "units in brackets": ("a,b,c\n,[mm],[°]\n1,2,3\n4,5,6\n", 1, (3, 4), ()),
    "bare units": ("a,b,c\n-,mm,deg\n1,2,3\n4,5,6\n", 1, (3, 4), ()),
    "separators at line ends": ("a,b,c,\n1,2,3,\n4,5,6,\n", 1, (2, 3), ()),
    "names in a comment": ("# a b c\n1 2 3\n4 5 6\n", None, (2, 3), ("a b c",)),
}


@pytest.mark.parametrize("case", FORMS)
def test_names_units_and_rows_are_found(case):
    text, header_line, lines, preamble = FORMS[case]
    out = laid(text)
    assert out.header == ("a", "b", "c")
    assert tuple(out.rows) == (("1", "2", "3"), ("4", "5", "6"))
    assert (out.header_line, tuple(out.lines), out.preamble) == (header_line, lines, preamble)
    if "units" in case:
        assert out.units[1] == "mm"


def test_a_file_without_names_takes_those_that_are_given():
    assert laid("1,2\n3,4\n").header == ("", "")
    assert laid("1,2\n3,4\n", ["x_mm", "y_mm"]).header == ("x_mm", "y_mm")
    with pytest.raises(FileError, match=r"a\.txt:1: has 2 columns, and 3 names were given"):
        laid("1,2\n3,4\n", ["x", "y", "z"])


def test_lines_of_another_width_are_faults_and_the_rest_is_read():
    out = laid("a,b\n1,2\n3\n4,5\n6,7,8\n9,9\n")
    assert list(out.lines) == [2, 4, 6]
    assert [str(fault) for fault in out.faults] == [
        "a.txt:3: the line has 1 fields, the header 2; write one for each column, or leave the line out",
        "a.txt:5: the line has 3 fields, the header 2; is it written with decimal commas?",
    ]


def test_a_report_in_words_is_called_one():
    report = "".join(f"Angle {k}: {k / 7:.3f}, {k / 9:.3f}\nError: {k}\nRemark: none\n" for k in range(9))
    with pytest.raises(FileError, match="is labelled text, not a table"):
        laid(report)


def test_the_table_is_what_most_rows_of_numbers_are():
    out = laid("9,9,9,9\na,b,c\n1,2,3\n4,5,6\n")
    assert out.header == ("a", "b", "c")
    assert tuple(out.lines) == (3, 4)
    assert any(note.startswith("line 1 holds numbers above the table") for note in out.notes)


@pytest.mark.parametrize("line", ["AXES = CARTESIAN", "Frame: base", "Frame;:;base", "Operator: N. N."])
def test_a_setting_right_above_the_numbers_names_no_columns(line):
    assert laid(f"{line}\n1;2;3\n4;5;6\n7;8;9\n").header == ("", "", "")


def test_units_behind_the_numbers_are_those_of_their_columns():
    out = laid("a;b;c;d;e\n1;2 mm;3;-4.5°;5\n6;7 mm;8;9.25°;10\n")
    assert (out.units[1], out.units[3]) == ("mm", "°")
    assert not any(out.units[k] for k in (0, 2, 4) if k < len(out.units))
    assert tuple(out.rows) == (("1", "2", "3", "-4.5", "5"), ("6", "7", "8", "9.25", "10"))
    assert laid("a;b\n1;2 mm\n6;7 mm\n8;9 deg\n3;4 deg\n").rows[0] == ("1", "2 mm")  # of neither
