"""Rows in a frame of strings, their cells as numbers, and columns that belong together."""

import time
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from taskcal.errors import FaultyFile, FileError
from taskcal.tables import table as table_module
from taskcal.tables.forms import lay_out, parse_sheet
from taskcal.tables.table import CELLS_AT_ONCE, LARGEST, Cells, Table

CELL = st.text("1.,;-e \x00\x1f\x1eaµ−\U0001f600", max_size=4)
ROWS = st.lists(st.lists(CELL, max_size=4).map(tuple), max_size=20)


@given(rows=ROWS, begin=st.integers(-22, 22), end=st.integers(-22, 22), data=st.data())
def test_cells_are_the_rows_that_were_given(rows, begin, end, data):
    """A frame is the sequence of its rows, whatever is taken of it."""
    cells = Cells.of(iter(rows))
    assert list(cells) == rows
    assert [cells[k] for k in range(-len(rows), len(rows))] == rows * 2
    assert list(cells[begin:end]) == rows[begin:end]
    some = data.draw(st.lists(st.booleans(), min_size=len(rows), max_size=len(rows)))
    assert list(cells[np.array(some, dtype=bool)]) == [row for row, taken in zip(rows, some, strict=True) if taken]


def test_cells_replace_columns_and_keep_lines():
    wide = [(str(k), "a", "b" * 30) for k in range(CELLS_AT_ONCE // 2)]
    cells, lines = Cells.numbered((3 * k, row) for k, row in enumerate(wide))
    assert lines[2:4].tolist() == [6, 9]
    texts = [f"\x1f{k}" for k in range(len(wide))]
    put = cells.with_columns({1: texts})
    assert list(put) == [(first, text, last) for (first, _, last), text in zip(wide, texts, strict=True)]
    assert put.column(1).tolist() == texts
    assert list(cells) == wide


def test_table_takes_little_more_memory_than_its_text(monkeypatch):
    monkeypatch.setattr(table_module, "CELLS_AT_ONCE", 400)
    row = "-131,3893;52,7610;-105,2011;110,8037;71,7963;94,5966;2188,6205;865,4579;693,3739"
    text = "\n".join(f"p{k};{row}" for k in range(2400))
    tracemalloc.start()
    table = lay_out(parse_sheet(Path("a.csv"), text))
    kept, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert len(table) == 2400
    assert kept < 3 * len(text)
    assert most < 8 * len(text)


def column(*cells: str) -> Table:
    lines = tuple(range(2, len(cells) + 2))
    return Table(path=Path("a.csv"), header=("x_mm",), rows=tuple((cell,) for cell in cells), lines=lines)


@given(st.lists(st.floats(-LARGEST, LARGEST)))
def test_numbers_are_those_that_were_written(values: list[float]) -> None:
    np.testing.assert_array_equal(column(*map(repr, values)).numbers("x_mm"), np.array(values, dtype=float))


@pytest.mark.parametrize(
    ("cell", "message"),
    [
        ("1_000", "'1_000' is not a number"),
        ("١٢", "'١٢' is not a number"),
        ("-inf", "'-inf' is not a finite number; leave the row out"),
        ("", "the cell is empty; leave the row out"),
        ("1000001", "'1000001' is beyond ±1e.06; check the cell and its unit"),
    ],
)
def test_numbers_refuse_a_cell_by_line_column_and_value(cell: str, message: str) -> None:
    with pytest.raises(FileError, match=message) as raised:
        column("1", cell, "3").numbers("x_mm", remedy="leave the row out")
    assert (raised.value.line, raised.value.column) == (3, "x_mm")


def test_all_wrong_cells_of_a_column_are_told_together() -> None:
    with pytest.raises(FaultyFile) as raised:
        column("a", "1", "b").numbers("x_mm")
    assert [fault.line for fault in raised.value.faults] == [2, 4]


def test_empty_cells_are_nan_where_they_may_be() -> None:
    np.testing.assert_array_equal(column("1", "").numbers("x_mm", empty=True), [1.0, np.nan])


def test_a_column_that_is_not_there_is_told_with_those_that_are() -> None:
    assert "x_mm" in column("1")
    with pytest.raises(FileError, match="no column 'y_mm'; it has x_mm"):
        column("1").texts("y_mm")


def test_a_cell_of_many_digits_is_refused_soon() -> None:
    begin = time.process_time()
    with pytest.raises(FileError, match="is not a number"):
        column("9" * 200_000 + "}").numbers("x_mm")
    assert time.process_time() - begin < 1.0


def groups(*lines):
    header, *rows = (tuple(line.split(",")) for line in lines)
    return Table(Path("table.csv"), header, rows, range(2, len(rows) + 2))


def test_what_was_asked_for_is_remembered_in_any_letters():
    columns = groups("ID,X_mm,y_MM,z_mm,note,qx,qy,qz,qw", "a,1,2,3,hot,0,0,0,1")
    assert columns.texts("id") == ["a"]
    np.testing.assert_allclose(columns.points(), [[1e-3, 2e-3, 3e-3]])
    with pytest.raises(FileError, match="unknown columns 'note', 'qx', 'qy', 'qz', 'qw'; only points"):
        columns.refuse_unused("only points")
    np.testing.assert_array_equal(columns.quaternions(), [[0, 0, 0, 1]])
    with pytest.raises(FileError, match="unknown column 'note'; no notes"):
        columns.refuse_unused("no notes")
    assert columns.texts("Note") == ["hot"]
    columns.refuse_unused("anything")


def test_rows_that_need_no_rotation_get_none_that_turns():
    columns = groups("id,p_qx,p_qy,p_qz,p_qw", "a,1,0,0,0", "b,,,,", "c,0.6,0,0,0.7")
    needed = np.array([True, False, False])
    np.testing.assert_array_equal(
        columns.quaternions([f"p_{part}" for part in ("qx", "qy", "qz", "qw")], needed=needed),
        [[1, 0, 0, 0], [0, 0, 0, 1], [0, 0, 0, 1]],
    )


WRONG = {
    "case": (lambda: groups("a,A", "1,2").refuse_repeated(), "csv:1: two columns are named 'a' but for letter case"),
    "some": (lambda: groups("X_mm,z_mm", "1,2").points(), "csv:1: has 'X_mm' but no column 'y_mm'"),
    "none": (lambda: groups("a", "1").points(), "csv:1: has no column 'x_mm'; it has a"),
    "unit": (
        lambda: groups("X,y,z", "1,2,3").points(),
        "csv:1: column 'X': the unit is not stated; name the column X_mm",
    ),
    "cell": (lambda: groups("x_mm,y_mm,Z_mm", "1,2,").points(), "csv:2: column 'Z_mm': the cell is empty; .*leave out"),
    "length": (
        lambda: groups("QX,qy,qz,qw", "0,0,0,1", "1,0,0,1").quaternions(),
        r"csv:3: column 'QX': the quaternion has length 1\.4142; it must be 1 \(is qw last\?\)",
    ),
}


@pytest.mark.parametrize(("read", "message"), WRONG.values(), ids=WRONG)
def test_a_wrong_group_is_told_where_and_what(read, message):
    with pytest.raises(FileError, match=message):
        read()
