import io
import re
import time
import zipfile
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from openpyxl import Workbook, load_workbook
from openpyxl.cell.rich_text import CellRichText, TextBlock
from openpyxl.cell.text import InlineFont
from openpyxl.styles import Font

from taskcal.errors import FileError, TaskcalError
from taskcal.tables.forms import read_csv, read_table
from taskcal.tables.options import TableForm
from taskcal.tables.spreadsheet import _Filled, read_workbook


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


def points(edit, rows=8):
    """A sheet of numbers as a person changed it; its first row of numbers is row 2."""
    made = Workbook()
    sheet = made.active
    sheet.title = "points"
    sheet.append(["id", "J1_deg", "x_mm", "y_mm", "z_mm"])
    for k in range(2, rows + 2):
        sheet.append([f"p{k}", 1.25 * k, 100.5 + k, 200.25, 300.125])
    edit(made, sheet)
    out = io.BytesIO()
    made.save(out)
    return out.getvalue()


def hide(_, sheet):
    for row in (4, 5, 8):
        sheet.row_dimensions[row].hidden = True


def filter_out(_, sheet):
    sheet.auto_filter.ref = "A1:E9"
    sheet.auto_filter.add_filter_column(0, ["p2"])
    sheet.row_dimensions[3].hidden = True


def strike_row(_, sheet):
    for cell in sheet[6]:
        cell.font = Font(strike=True)


def strike_cell(_, sheet):
    sheet["C6"].font = Font(strike=True)


def fold(_, sheet):
    sheet.row_dimensions.group(3, 5, hidden=True)


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


@pytest.mark.parametrize(
    ("edit", "said", "left"),
    [
        (hide, "hidden rows 4-5, 8;", {4, 5, 8}),
        (filter_out, "hidden row 3;", {3}),
        (fold, "hidden rows 3-5;", {3, 4, 5}),
        (strike_row, "struck-out cells in row 6;", {6}),
        (strike_cell, "struck-out cells in row 6;", {6}),
    ],
)
def test_hidden_and_struck_out_rows_are_asked_about(tmp_path, edit, said, left):
    path = tmp_path / "a.xlsx"
    path.write_bytes(points(edit))
    with pytest.raises(FileError, match=rf"a\.xlsx:{min(left)}: sheet 'points' has {said} state --hidden-rows drop"):
        read_table(path)
    kept, dropped = (read_table(path, TableForm(hidden_rows=what)) for what in ("keep", "drop"))
    assert list(kept.lines) == list(range(2, 10))
    assert list(dropped.lines) == [line for line in range(2, 10) if line not in left]
    assert len(kept.notes) == len(dropped.notes) == 1


@pytest.mark.parametrize(
    "edit",
    [
        lambda _, sheet: sheet.row_dimensions.group(3, 5, hidden=False),
        lambda _, sheet: setattr(sheet.row_dimensions[1], "hidden", True),
        lambda _, sheet: setattr(sheet["A1"], "font", Font(strike=True)),
        lambda _, sheet: setattr(sheet.row_dimensions[40], "hidden", True),
        lambda _, sheet: setattr(sheet["G1"], "value", "=TODAY()"),
        lambda _, sheet: sheet.merge_cells("A1:B1"),
    ],
)
def test_marks_that_touch_no_number_are_ignored(tmp_path, edit):
    path = tmp_path / "a.xlsx"
    path.write_bytes(points(edit))
    assert len(read_table(path)) == 8
    assert read_table(path).notes == ()


def test_hidden_columns_and_sheets_are_noted(tmp_path):
    def columns(_, sheet):
        sheet.column_dimensions["C"].hidden = sheet.column_dimensions["AB"].hidden = True

    def other(made, _):
        hidden = made.create_sheet("raw", 0)
        hidden.sheet_state = "hidden"
        for k in range(30):
            hidden.append([k, 1.5, 2.5])

    def only(made, sheet):
        made.create_sheet("about").append(["made by hand"])
        made.active, sheet.sheet_state = 1, "hidden"

    path = tmp_path / "a.xlsx"
    for edit, note in (
        (columns, "sheet 'points': hidden columns (C) are read as the others"),
        (other, "sheet 'points' is read; others with cells: raw (hidden)"),
        (only, "sheet 'points (hidden)' is read; others with cells: about"),
    ):
        path.write_bytes(points(edit))
        assert read_table(path).notes == (note,)


@pytest.mark.parametrize("shared", [True, False])
def test_partly_struck_out_text_is_refused(shared):
    content = points(
        lambda _, sheet: sheet.__setitem__("C4", CellRichText(TextBlock(InlineFont(strike=True), "12"), "13"))
    )
    if shared:
        content = with_shared_texts(content)
    with pytest.raises(FileError, match=r"a\.xlsx:4: sheet 'points': part of a cell's text is struck out \(row 4\)"):
        read_workbook(Path("a.xlsx"), content)


def with_shared_texts(content):
    """The workbook with its inline text in the table of texts, where Excel keeps it."""
    out = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(content)) as whole, zipfile.ZipFile(out, "w") as again:
        sheet = whole.read("xl/worksheets/sheet1.xml")
        inline = re.search(rb'<c r="C4"[^>]*><is>(.*?)</is></c>', sheet)
        kind = "application/vnd.openxmlformats-officedocument.spreadsheetml.sharedStrings+xml"
        listed = f'<Override PartName="/xl/sharedStrings.xml" ContentType="{kind}"/></Types>'.encode()
        begin = b'<sst xmlns="http://schemas.openxmlformats.org/spreadsheetml/2006/main"><si>'
        again.writestr("xl/sharedStrings.xml", begin + inline[1] + b"</si></sst>")
        for name in whole.namelist():
            part = whole.read(name).replace(b"</Types>", listed)
            part = part.replace(inline[0], b'<c r="C4" t="s"><v>0</v></c>')
            again.writestr(name, part)
    return out.getvalue()


def test_formulas_without_values_are_refused():
    content = points(lambda _, sheet: sheet.__setitem__("C4", "=C3+1"))
    with pytest.raises(FileError, match=r"a\.xlsx:4: sheet 'points': formulas have no values \(row 4\); open the"):
        read_workbook(Path("a.xlsx"), content)


def test_cells_merged_over_rows_of_numbers_are_refused():
    content = points(lambda _, sheet: sheet.merge_cells("B3:B5"))
    with pytest.raises(FileError, match=r"a\.xlsx:4: sheet 'points': cells are merged over several rows \(B3:B5\)"):
        read_workbook(Path("a.xlsx"), content)


def with_sheet(rows, form="r"):
    """A workbook with rows as they are written in XML: with the places of rows and cells, without, or with a prefix of names."""
    space = b"http://schemas.openxmlformats.org/spreadsheetml/2006/main"
    sheet = (
        b'<worksheet xmlns="%s"><sheetData>%s</sheetData><mergeCells><mergeCell ref="A2:B4"/></mergeCells></worksheet>'
    )
    sheet %= space, b"".join(rows)
    if form == "plain":
        sheet = re.sub(rb' r="\w+"', b"", sheet)
    if form == "prefix":
        sheet = re.sub(rb"<(/?)", rb"<\1x:", sheet).replace(b"xmlns=", b"xmlns:x=")
    out = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(points(strike_row))) as whole, zipfile.ZipFile(out, "w") as again:
        for name in whole.namelist():
            again.writestr(name, sheet if name == "xl/worksheets/sheet1.xml" else whole.read(name))
    return out.getvalue()


@pytest.mark.parametrize("form", ["r", "plain", "prefix"])
def test_marks_are_found_however_rows_are_written(form):
    rows = [
        b'<row r="%d" hidden="1"><c r="A%d" s="1"><v>1</v></c></row>' % (k, k) if k % 3 == 0
        else b'<row r="%d"><c r="A%d" s="0"><f>B1</f><v></v></c><c r="B%d" s="1"/><c r="C%d"><v>2</v></c></row>' % (k, k, k, k)
        for k in range(1, 8)
    ]  # fmt: skip
    made = load_workbook(io.BytesIO(with_sheet(rows, form)), read_only=True, data_only=True, rich_text=True)
    filled = _Filled(Path("a.xlsx"), made["points"], frozenset({1}))
    assert (filled.hidden, filled.struck, filled.unvalued) == ({3, 6}, {3, 6}, {1, 2, 4, 5, 7})
    assert filled.merged == [(2, 4, "A2:B4")]
    assert list(filled.lines) == list(range(1, 8))


def test_rows_that_are_not_in_order_are_refused():
    rows = [b'<row r="%d"><c r="A%d"><v>1</v></c></row>' % (k, k) for k in (1, 3, 2)]
    with pytest.raises(FileError, match=r"a\.xlsx:2: row 2 stands behind row 3; save the workbook again, or as CSV"):
        read_workbook(Path("a.xlsx"), with_sheet(rows))


def test_comma_of_a_text_is_not_decided_by_numbers(tmp_path):
    path = tmp_path / "a.xlsx"
    path.write_bytes(points(lambda _, sheet: sheet.__setitem__("C4", "1,025")))
    with pytest.raises(FileError, match=r"a\.xlsx:4: '1,025' may be 1\.025 or 1025"):
        read_table(path)
    for decimal, read in ((",", "1.025"), (".", "1025")):
        table = read_table(path, TableForm(decimal=decimal))
        assert table.texts("x_mm")[:4] == ["102.5", "103.5", read, "105.5"]
        assert table.texts("z_mm") == ["300.125"] * 8
    path.write_bytes(points(lambda _, sheet: sheet.__setitem__("C4", "104,5")))
    assert read_table(path).texts("x_mm")[2] == "104.5"
