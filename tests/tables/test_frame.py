"""Rows as CSV, and as a frame of pandas."""

import io
import math
import sys

import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from taskcal.errors import TaskcalError
from taskcal.tables.frame import csv_of, frame_of

CELLS = st.one_of(st.floats(), st.booleans(), st.text("ab,;\"' \n"))
ROWS = st.lists(st.dictionaries(st.sampled_from(["a", "b", "c, d"]), CELLS, min_size=1), min_size=1, max_size=4)


@given(ROWS)
def test_csv_is_that_of_pandas_and_keeps_every_digit(rows):
    """Columns in the order of the rows, quoted where needed, empty where a row lacks one."""
    columns = list(dict.fromkeys(name for row in rows for name in row))
    cells = {name: pd.Series([row.get(name) for row in rows], dtype=object) for name in columns}
    assert csv_of(rows) == pd.DataFrame(cells).to_csv(index=False, lineterminator="\n")


def test_numbers_are_rounded_only_where_asked():
    row = {"count": 2, "mm": 0.1 + 0.2, "none": math.nan}
    assert csv_of([row]) == "count,mm,none\n2,0.30000000000000004,\n"
    assert csv_of([row], digits=3) == "count,mm,none\n2,0.300,\n"


def test_frame_holds_the_rows():
    rows = [{"a": 1, "b": 0.5}, {"a": 2}]
    assert csv_of(frame_of(rows).to_dict("records")) == csv_of(rows)
    assert list(pd.read_csv(io.StringIO(csv_of(rows)))["a"]) == list(frame_of({"a": [1, 2]})["a"])


def test_missing_pandas_names_the_extra(monkeypatch):
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(TaskcalError, match="extra: pandas"):
        frame_of([{"a": 1}])
