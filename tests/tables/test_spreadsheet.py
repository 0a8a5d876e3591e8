import io
import time
import zipfile
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from openpyxl import Workbook

from taskcal.errors import FileError, TaskcalError
from taskcal.tables.forms import TableForm, read_csv, read_table
from taskcal.tables.spreadsheet import read_workbook


def book(*sheets):
    made = Workbook()
    made.remove(made.active)
    for title, rows in sheets:
        sheet = made.create_sheet(title)
        for row in rows:
            sheet.append(row)
    out = io.BytesIO()
    made.save(out)
    return out.getvalue()


SHEET = ("points", [["made by hand"], [], ["id", "x_mm", "y_mm"], ["a", 1, 2.5], ["b", -3.25, None]])


def test_cells_come_back_as_they_were_typed(tmp_path):
    path = tmp_path / "a.xlsx"
    path.write_bytes(book(("empty", []), SHEET, ("more", [[1]])))
    table = read_csv(path)
    assert table.header == ("id", "x_mm", "y_mm")
    assert tuple(table.rows) == (("a", "1", "2.5"), ("b", "-3.25", ""))
    assert tuple(table.lines) == (4, 5)
    with pytest.raises(TaskcalError, match=r"no sheet 'pints' .*did you mean 'points'\?"):
        read_csv(path, TableForm(sheet="pints"))


def test_what_unpacks_to_too_much_is_refused_before_it_is():
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as parts:
        parts.writestr("xl/workbook.xml", b" " * 10)
        parts.writestr("xl/worksheets/sheet1.xml", b" " * 30_000_000)
    with pytest.raises(FileError, match=r"a\.xlsx: unpacks to 30 MB, more than 5 MB"):
        read_workbook(Path("a.xlsx"), packed.getvalue())


def test_formats_without_end_are_refused_before_they_are_read():
    packed = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(book(SHEET))) as whole, zipfile.ZipFile(packed, "w", zipfile.ZIP_STORED) as again:
        for part in whole.infolist():
            formats = b"<styleSheet><cellXfs>" + b"<xf/>" * 120_000 + b"</cellXfs></styleSheet>"
            again.writestr(part.filename, formats if part.filename == "xl/styles.xml" else whole.read(part))
    with pytest.raises(
        FileError, match="defines formats of cells by 120004 tags, more than 100000; save the sheet as CSV"
    ):
        read_workbook(Path("a.xlsx"), packed.getvalue())


@pytest.mark.parametrize("share", [0.3, 0.7, 0.99])
def test_a_workbook_that_was_cut_off_is_called_damaged(tmp_path, share):
    whole, path = book(SHEET), tmp_path / "a.xlsx"
    # the part that lists the sheets comes after the sheets; a file without it is any packed file
    path.write_bytes(whole[: max(int(share * len(whole)), whole.index(b"xl/workbook.xml") + 20)])
    with pytest.raises(FileError, match=r"a\.xlsx: is a damaged workbook .*; save it again, or as CSV"):
        read_csv(path)


def test_parts_that_define_entities_are_refused():
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w") as parts:
        parts.writestr("xl/workbook.xml", b'<?xml version="1.0"?><!DOCTYPE a [<!ENTITY b "c">]><a>&b;</a>')
    with pytest.raises(FileError, match=r"has a document type in xl/workbook\.xml"):
        read_workbook(Path("a.xlsx"), packed.getvalue())


@settings(max_examples=60)
@given(st.integers(0, 4000), st.binary(min_size=1, max_size=30))
def test_damaged_workbooks_are_refused_or_read(position, noise):
    whole = book(SHEET)
    at = position % len(whole)
    content = whole[:at] + noise + whole[at + len(noise) :]
    try:
        read_workbook(Path("a.xlsx"), content)
    except TaskcalError as refusal:
        if "a.xlsx" not in str(refusal):
            raise


def test_sheet_without_a_size_ends_with_its_last_cells():
    from openpyxl import Workbook

    workbook, packed = Workbook(write_only=True), io.BytesIO()
    sheet = workbook.create_sheet("all")
    for k in range(1500):
        sheet.append([k, 0.5])
    workbook.save(packed)
    assert tuple(read_workbook(Path("a.xlsx"), packed.getvalue()).rows) == tuple((str(k), "0.5") for k in range(1500))


def test_sheet_is_the_named_one_or_the_one_with_numbers(tmp_path):
    path = tmp_path / "a.xlsx"
    path.write_bytes(
        book(("about", [["robot", "UR5"], ["date", "today"]]), SHEET, ("more", [["a", "b"], [1, 2], [3, 4], [5, 6]]))
    )
    laid = read_table(path)
    assert laid.header == ("a", "b")
    assert laid.notes == ("sheet 'more' is read; others with cells: about, points",)
    assert read_table(f"{path}#points").header == ("id", "x_mm", "y_mm")
    with pytest.raises(TaskcalError, match=r"no sheet 'pints' .*did you mean 'points'\?"):
        read_table(f"{path}#pints")


def test_a_row_with_a_far_number_is_refused_soon(tmp_path):
    packed = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(book(SHEET))) as whole, zipfile.ZipFile(packed, "w") as again:
        for name in whole.namelist():
            again.writestr(name, whole.read(name).replace(b'<row r="4"', b'<row r="99999999999999"'))
    began = time.process_time()
    with pytest.raises(FileError, match=r"numbers a row beyond 1048576, the last of a workbook"):
        read_workbook(tmp_path / "a.xlsx", packed.getvalue())
    assert time.process_time() - began < 2.0
