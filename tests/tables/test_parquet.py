import io
from pathlib import Path

import numpy as np
import pyarrow
import pyarrow.parquet
import pytest
from hypothesis import given
from hypothesis import strategies as st

from taskcal.errors import FileError, TaskcalError
from taskcal.tables import parquet
from taskcal.tables.forms import read_csv
from taskcal.tables.parquet import parquet_of, read_parquet

PATH = Path("a.parquet")


@given(st.lists(st.tuples(st.floats(allow_nan=False, allow_infinity=False), st.text("ab07", max_size=3)), min_size=1))
def test_parquet_keeps_every_digit_and_every_name(rows):
    content = parquet_of(["x_mm", "id"], [[repr(x), name] for x, name in rows])
    header, *cells = read_parquet(PATH, content).rows
    assert header == ("x_mm", "id")
    assert [(float(x), name) for x, name in cells] == rows


def test_rows_are_packed_in_groups_and_the_file_says_what_it_is(monkeypatch):
    monkeypatch.setattr(parquet, "GROUP_ROWS", 10)
    file = pyarrow.parquet.ParquetFile(io.BytesIO(parquet_of(["id", "x_mm"], [[str(k), "1.5"] for k in range(25)])))
    assert file.num_row_groups == 3
    assert b"units in their names" in file.schema_arrow.metadata[b"taskcal"]
    assert [str(kind) for kind in file.schema_arrow.types] == ["string", "double"]


def test_what_other_programs_write_is_read(tmp_path):
    table = pyarrow.table({
        "id": pyarrow.array([1, 2, 3]),
        "q1_deg": pyarrow.array([0.5, 1.5, None]),
        "x_mm": pyarrow.array(np.array([1.25, np.nan, 3.0], dtype=np.float32)),
    })  # fmt: skip
    pyarrow.parquet.write_table(table, tmp_path / "a.parquet")
    read = read_csv(tmp_path / "a.parquet")
    assert read.header == ("id", "q1_deg", "x_mm")
    assert [read.texts(name) for name in read.header] == [["1", "2", "3"], ["0.5", "1.5", ""], ["1.25", "", "3.0"]]
    assert list(read.lines) == [2, 3, 4]


def test_a_file_of_others_without_rows_is_not_called_damaged():
    written = io.BytesIO()
    pyarrow.parquet.write_table(pyarrow.table({"x_mm": pyarrow.array([], pyarrow.float64())}), written)
    assert list(read_parquet(PATH, written.getvalue()).rows) == [("x_mm",)]


@pytest.mark.parametrize("damage", [lambda c: c[:40], lambda c: c[:20] + c[30:], lambda c: c[:4] + bytes(len(c) - 4)])
def test_a_damaged_file_is_refused(damage):
    content = parquet_of(["id", "x_mm"], [[str(k), "1.5"] for k in range(25)])
    with pytest.raises(FileError, match=r"a\.parquet: is (a damaged Parquet file|damaged: its bytes)"):
        read_parquet(PATH, damage(content))


def test_no_changed_byte_of_our_files_changes_a_cell():
    rng = np.random.default_rng(0)
    rows = [[f"p{k}", *(f"{x:.4f}" for x in rng.normal(size=3))] for k in range(60)]
    content = parquet_of(["id", "x_mm", "y_mm", "z_mm"], rows)
    whole, refused = list(read_parquet(PATH, content).rows), 0
    for at in range(len(content)):
        damaged = content[:at] + bytes([content[at] ^ 1 << int(rng.integers(8))]) + content[at + 1 :]
        try:
            assert list(read_parquet(PATH, damaged).rows) == whole
        except FileError:
            refused += 1
    # all but those of the mark before the digest
    assert refused == len(content) - len(parquet.SEAL)


def test_parts_of_a_damaged_file_are_refused(tmp_path):
    content = bytearray(parquet_of(["x_mm"], [[repr(k / 7)] for k in range(100)]))
    content[100] ^= 1
    path = tmp_path / "a.parquet"
    path.write_bytes(content)
    for reading in (parquet.count_rows, lambda p: next(parquet.parts_of(p, 10)), lambda p: parquet.every_row(p, 2, 10)):
        with pytest.raises(FileError, match="is damaged: its bytes are not those that were written"):
            reading(path)


@pytest.mark.parametrize("checked", [True, False])
def test_page_checksums_of_others_are_verified_or_missed(checked):
    values = np.random.default_rng(0).normal(size=500)
    out = io.BytesIO()
    table = pyarrow.table({"x_mm": values})
    pyarrow.parquet.write_table(
        table, out, compression="none", use_dictionary=False, column_encoding="PLAIN", write_page_checksum=checked
    )
    content = out.getvalue()
    assert (parquet.UNCHECKED in read_parquet(PATH, content).notes) != checked
    at = content.index(values[250].tobytes())
    damaged = content[:at] + b"\xff" + content[at + 1 :]
    if checked:
        with pytest.raises(FileError, match="is a damaged Parquet file"):
            read_parquet(PATH, damaged)
    else:
        assert read_parquet(PATH, damaged).notes == (parquet.UNCHECKED,)


def test_more_than_fits_is_refused_before_it_is_unpacked(monkeypatch):
    monkeypatch.setattr(parquet, "MAX_CELLS", 49)
    with pytest.raises(FileError, match="25 rows of 2 columns, more than 49 cells"):
        read_parquet(PATH, parquet_of(["id", "x_mm"], [[str(k), "1.5"] for k in range(25)]))


def written(columns):
    out = io.BytesIO()
    pyarrow.parquet.write_table(pyarrow.table(columns), out, compression="zstd")
    return out.getvalue()


def test_parquet_refuses_one_long_text_in_every_row():
    content = written({"id": pyarrow.DictionaryArray.from_arrays(np.zeros(400, dtype=np.int32), ["x" * 1_000_000])})
    assert len(content) < 10_000
    with pytest.raises(FileError, match=r"column 'id': text column too long \(1000000 characters in 400 rows\)"):
        read_parquet(PATH, content)


def test_equal_rows_cost_no_more_than_others():
    content = written({name: pyarrow.array(np.full(300_000, 1.5)) for name in ("x_mm", "y_mm")})
    with pytest.raises(FileError, match=r"300000 rows of 2 columns, more than 50\d\d\d\d cells"):
        read_parquet(PATH, content)


def test_lists_and_records_are_refused_by_the_column_s_name():
    for values in ([[1.0, 2.0]], [{"x": 1.0}]):
        with pytest.raises(FileError, match="column 'xyz': holds lists or records"):
            read_parquet(PATH, written({"xyz": pyarrow.array(values)}))


def test_a_day_that_no_calendar_has_is_refused():
    days = pyarrow.array([2**62]).cast(pyarrow.date64(), safe=False)
    with pytest.raises(FileError, match=r"a\.parquet: is a damaged Parquet file"):
        read_parquet(PATH, written({"when": days}))


def test_without_pyarrow_the_extra_is_named(monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "pyarrow", None)
    with pytest.raises(TaskcalError, match="install Taskcal with its extra: parquet"):
        read_parquet(PATH, b"PAR1")


def test_parquet_rows_are_bounded_by_its_bytes(tmp_path):
    path = tmp_path / "a.parquet"
    path.write_bytes(written({name: pyarrow.array(np.full(300_000, 1.5)) for name in ("x_mm", "y_mm")}))
    for reading in (parquet.count_rows, lambda p: next(parquet.parts_of(p, 10)), lambda p: parquet.every_row(p, 2, 10)):
        with pytest.raises(FileError, match=r"a\.parquet: has 300000 rows of 2 columns, more than 50\d\d\d\d cells"):
            reading(path)


def test_parquet_is_bounded_before_it_is_unpacked(monkeypatch):
    content = written({"id": ["x" * 1_000_000] * 2, "x_mm": [1.0, 2.0]})
    monkeypatch.setattr(parquet, "MAX_STATED_TEXT_MB", 0.5)
    with pytest.raises(FileError, match="has texts of 1 MB, more than 0 MB; leave out their columns"):
        read_parquet(PATH, content)
    monkeypatch.setattr(parquet, "MAX_COLUMNS", 1)
    with pytest.raises(FileError, match="has more than 20000 columns; is it a table"):
        read_parquet(PATH, content)
    monkeypatch.setattr(parquet, "MAX_DIRECTORY_MB", 1e-4)
    with pytest.raises(FileError, match="has a directory of 0 MB; save it with fewer columns, or larger groups"):
        read_parquet(PATH, content)
