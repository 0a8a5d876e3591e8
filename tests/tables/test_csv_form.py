import time

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from taskcal.errors import FileError
from taskcal.tables.forms import read_csv


def write(folder, content):
    path = folder / "table.csv"
    path.write_bytes(content if isinstance(content, bytes) else content.encode("utf-8"))
    return path


@given(
    st.lists(st.lists(st.floats(-1e6, 1e6), min_size=3, max_size=3)),
    st.sampled_from(",;\t"),
)
def test_numbers_come_back_exactly_whatever_separates_the_fields(tmp_path_factory, rows, delimiter):
    lines = [delimiter.join(["a", "b", "c"]), *(delimiter.join(map(repr, row)) for row in rows)]
    table = read_csv(write(tmp_path_factory.mktemp("csv"), "\n".join(lines)))
    assert len(table) == len(rows)
    expected = np.array(rows, dtype=float).reshape(-1, 3)
    for column, values in zip("abc", expected.T, strict=True):
        np.testing.assert_array_equal(table.numbers(column), values)


@pytest.mark.parametrize(
    "content",
    [
        b"a,b\r\n1,2\r\n",
        b"\xef\xbb\xbfa,b\n1,2\n",
        b"\n\na,b\n\n1,2\n\n",
        b" a , b \n 1 , 2 \n",
        b'"a","b"\n"1","2"',
        b"a;b\n1;2\n",
    ],
    ids=["Windows", "byte order mark", "blank lines", "spaces", "quotes", "semicolons"],
)
def test_spreadsheets_habits_are_read(tmp_path, content):
    table = read_csv(write(tmp_path, content))
    assert table.header == ("a", "b")
    assert tuple(table.rows) == (("1", "2"),)


def test_errors_point_at_the_line_of_the_file(tmp_path):
    table = read_csv(write(tmp_path, "a,b\n\n1,2\n\n\n3,oops\n"))
    assert tuple(table.lines) == (3, 6)
    with pytest.raises(FileError, match=r"table\.csv:6: column 'b': 'oops' is not a number; give a number") as caught:
        table.numbers("b")
    assert (caught.value.line, caught.value.column) == (6, "b")


def test_empty_cells_are_nan_only_where_allowed(tmp_path):
    table = read_csv(write(tmp_path, "a,b\n1,\n"))
    assert np.isnan(table.numbers("b", empty=True)).all()
    with pytest.raises(FileError, match=r"table\.csv:2: column 'b': the cell is empty"):
        table.numbers("b")


WRONG = {
    "empty": ("", r"table\.csv: is empty; its first line must name the columns"),
    "blank": ("\n \n\n", r"table\.csv: is empty"),
    "binary": (b"a,b\n\x00\x01,2\n", r"table\.csv: is a binary file; export it as CSV"),
    "spreadsheet": (b"PK\x03\x04\xff\xfe\x80", r"table\.csv: is a packed file; a table in it must be a workbook"),
    "too many fields": ("a,b\n1,2\n1,2,3\n", r"table\.csv:3: the line has 3 fields, the header 2"),
    "too few fields": ("a,b\n1\n", r"table\.csv:2: the line has 1 fields, the header 2"),
    "a row of units": ("a,b\nmm,deg\n1,2\n", r"table\.csv: has a row of units \(mm deg\); state them in the names"),
    "two columns of one name": ("a,b,a\n1,2,3\n", r"table\.csv:1: two columns are named 'a'"),
    "decimal commas between commas": (
        "a,b\n1,5,2,5\n",
        r"table\.csv:2: .* 4 fields, .* is it written with decimal commas\?",
    ),
}


@pytest.mark.parametrize("case", WRONG)
def test_rejects_file_without_table_and_names_line(tmp_path, case):
    """A file without a table is rejected, with the line of the cause."""
    content, message = WRONG[case]
    with pytest.raises(FileError, match=message):
        read_csv(write(tmp_path, content))


@pytest.mark.parametrize(
    ("cell", "message"),
    [
        ("nan", "'nan' is not a finite number"),
        ("inf", "'inf' is not a finite number"),
        ("12 mm", "'12 mm' is not a number"),
        ("0x10", "'0x10' is not a number"),
        ("1_000", "'1_000' is not a number"),
        ("١٢", "'١٢' is not a number"),
        ("１２", "'１２' is not a number"),
        ("1e200", r"'1e200' is beyond ±1e\+06; check the cell and its unit"),
        ("-1e400", r"'-1e400' is beyond ±1e\+06"),
        ("1" * 5000, r"'1+…1+ \(5000 characters\)' is beyond"),
        ("x" * 5000, r"'x+…x+ \(5000 characters\)' is not a number"),
    ],
)
def test_a_cell_that_is_no_number_is_shown_with_a_remedy(tmp_path, cell, message):
    table = read_csv(write(tmp_path, f"a;b\n1;2\n3;{cell}\n"))
    with pytest.raises(FileError, match=rf"table\.csv:3: column 'b': {message}"):
        table.numbers("b")


def test_an_unknown_column_is_named_with_those_there_are(tmp_path):
    table = read_csv(write(tmp_path, "a,b\n1,2\n"))
    assert "a" in table
    assert "c" not in table
    with pytest.raises(FileError, match=r"table\.csv:1: has no column 'c'; it has a, b"):
        table.texts("c")


@pytest.mark.parametrize("name", ["none.csv", "."])
def test_a_file_that_cannot_be_read_says_why(tmp_path, name):
    with pytest.raises(FileError, match="cannot be read: "):
        read_csv(tmp_path / name)


def test_header_check_takes_linear_time(tmp_path):
    header = ",".join(f"c{i}" for i in range(15_000))
    began = time.perf_counter()
    with pytest.raises(FileError, match=r"two columns are named 'c0'"):
        read_csv(write(tmp_path, f"{header},c0\n"))
    assert time.perf_counter() - began < 2.0


@pytest.mark.parametrize("line", ["1\n", "1,2,3\n", "\n"])
def test_more_lines_than_rows_so_short_can_be_are_refused(tmp_path, line):
    with pytest.raises(FileError, match=rf"has 40000 lines of {len(line) - 1} characters by the mean; is it a table"):
        read_csv(write(tmp_path, line * 40_000))


def test_many_short_rows_are_read(tmp_path):
    assert len(read_csv(write(tmp_path, "x_mm,y_mm,z_mm\n" + "1.234,5.678,9.012\n" * 40_000))) == 40_000


def test_of_a_fault_in_every_line_the_first_are_told(tmp_path):
    path = write(tmp_path, "a,b,c\n" + 5000 * "1,2,3\n1,2\n")
    with pytest.raises(
        FileError, match=r"table\.csv:3: the line has 2 fields, the header 3; write one for each column.*\n"
    ) as raised:
        read_csv(path)
    assert str(raised.value).endswith("and at least 1980 more faults")
    path.write_text("a,b\n" + 5000 * "1,nan\n")
    with pytest.raises(FileError, match=r"(?s)table\.csv:2: .*and at least 1980 more faults$"):
        read_csv(path).numbers("b")
