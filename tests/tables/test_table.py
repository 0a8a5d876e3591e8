"""Cells of a table as numbers, and what is said of those that are none."""

import time
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from taskcal.errors import FaultyFile, FileError
from taskcal.tables.table import LARGEST, Table


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
def test_a_cell_that_is_not_a_number_is_named_by_line_column_and_value(cell: str, message: str) -> None:
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
