"""Lines of more cells than a table has are refused before they are parted."""

from pathlib import Path

import pytest

from taskcal.errors import FileError
from taskcal.tables.forms import parse_sheet
from taskcal.tables.table import MAX_COLUMNS, MAX_MARKS, refuse_wide
from tests.readers.own_process import in_own_process

PATH = Path("wide.csv")


@pytest.mark.parametrize("cell", ["1,", "x;", "1.5\t", "a|", "1 ", "1, ", '"",', '"some\nmore lines",'])
def test_wide_line_costs_little_more_than_its_text(cell):
    text = "id,x\n" + 1_000_000 * cell
    outcome = in_own_process(lambda: parse_sheet(PATH, text), 10)
    assert "wide.csv:" in outcome.said
    assert f"has more than {MAX_COLUMNS} columns; is it a table?" in outcome.said
    assert outcome.within(seconds=3.0, megabytes=30.0 + 5.0 * len(text) / 1e6)


@pytest.mark.parametrize("cell", ["1.234.567,5;", "1,234,567.5;", "1 ", "1,5\t"])
def test_as_many_columns_as_a_table_may_have_are_not_too_many(cell):
    refuse_wide(PATH, 3 * (MAX_COLUMNS * cell[:-1].join(["", cell[-1]]) + "\n"))


def test_the_line_is_named_wherever_it_stands():
    for before in (0, 1, 7, MAX_MARKS):
        with pytest.raises(FileError) as raised:
            refuse_wide(PATH, before * "1,2\n" + (MAX_MARKS + 1) * "," + "\n1,2\n")
        assert raised.value.line == before + 1


def test_long_line_without_separators_is_not_wide():
    refuse_wide(PATH, "# " + 10_000_000 * "a" + "\n1,2,3\n" + 1_000_000 * "-")
