"""Rows that are packed are the rows that were given, and read as if they were not."""

import tracemalloc
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from taskcal.errors import FileError
from taskcal.tables import table as packed_rows
from taskcal.tables.forms import parse_sheet
from taskcal.tables.layout import lay_out
from taskcal.tables.table import PackedRows, column_of, pack, pack_numbered, with_columns

CELL = st.text("1.,;-e \x00\x1f\x1eaµ−\U0001f600", max_size=4)
ROWS = st.lists(st.lists(CELL, max_size=4).map(tuple), min_size=1, max_size=20)
EVEN = st.integers(1, 4).flatmap(lambda n: st.lists(st.tuples(*[CELL] * n), min_size=1, max_size=20))
LINES = st.lists(
    st.lists(
        st.sampled_from(["", "a", "x mm", "1", "-2.5", "3,5", "1 234", "4°", "Mean", "mm", '"q"', "---"]), max_size=5
    ),
    max_size=14,
)


@pytest.fixture(autouse=True, scope="module")
def small_blocks():
    """Of a few rows, so that few rows are several blocks."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(packed_rows, "CELLS", 5)
        patch.setattr(packed_rows, "ROWS", 2)
        yield


def test_few_rows_stay_as_they_are():
    assert pack(iter([("a", "b")])) == (("a", "b"),)
    assert pack([]) == ()


@given(rows=ROWS, begin=st.integers(-22, 22), end=st.integers(-22, 22))
@example(rows=[("",)] * 9, begin=0, end=9)
@example(rows=[(chr(k), "\x1f") for k in range(300)], begin=0, end=1)
def test_rows_are_those_that_were_packed(rows, begin, end):
    packed = pack(iter(rows))
    assert list(packed) == rows
    assert len(packed) == len(rows)
    assert [packed[k] for k in range(-len(rows), len(rows))] == rows * 2
    assert list(packed[begin:end]) == rows[begin:end]
    assert list(packed[begin:]) == rows[begin:]
    with pytest.raises(IndexError):
        packed[len(rows)]


@given(rows=EVEN)
def test_columns_are_those_of_the_rows_and_can_be_replaced(rows):
    packed = pack(rows)
    width = len(rows[0])
    for k in range(width):
        assert [cell for cells in column_of(packed, k) for cell in cells] == [row[k] for row in rows]
    texts = [f"\x1f{k}" if k % 3 else str(k) for k in range(len(rows))]
    put = with_columns(packed, {width - 1: iter(texts)})
    assert list(put) == [(*row[:-1], text) for row, text in zip(rows, texts, strict=True)]
    for k in range(width):
        assert [cell for cells in column_of(put, k) for cell in cells] == [row[k] for row in put]


def test_lines_stay_with_their_rows():
    rows, lines = pack_numbered((3 * k, (str(k), "1")) for k in range(40))
    assert isinstance(rows, PackedRows)
    assert list(lines) == list(range(0, 120, 3))
    assert list(lines[2:4]) == [6, 9]


def read(text):
    """What a text is read as, or why it is not."""
    try:
        laid = lay_out(parse_sheet(Path("a.csv"), text))
    except FileError as refusal:
        return str(refusal)
    table = replace(laid.table, rows=tuple(laid.table.rows), lines=tuple(laid.table.lines))
    return vars(table), laid.units, laid.preamble, list(map(str, laid.faults)), laid.notes


@given(lines=LINES, separator=st.sampled_from([",", ";", "\t", "  "]))
def test_tables_of_several_blocks_are_read_as_those_of_one(lines, separator):
    text = "\n".join(separator.join(line) for line in lines)
    in_blocks = read(text)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(packed_rows, "CELLS", 10**6)
        assert read(text) == in_blocks


def test_a_table_takes_little_more_memory_than_its_text():
    row = "-131,3893;52,7610;-105,2011;110,8037;71,7963;94,5966;2188,6205;865,4579;693,3739"
    text = "\n".join(f"p{k};{row}" for k in range(600))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(packed_rows, "CELLS", 600)
        tracemalloc.start()
        table = lay_out(parse_sheet(Path("a.csv"), text)).table
        kept, most = tracemalloc.get_traced_memory()
        tracemalloc.stop()
    assert len(table) == 600
    assert kept < 3 * len(text)
    assert most < 8 * len(text)
