"""Workbooks: the cells of one sheet as text."""

import io
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from datetime import date, datetime, time
from pathlib import Path
from typing import Any

import numpy as np

from taskcal.errors import FileError, UnknownName, listed, shown
from taskcal.tables.options import DecimalMark, HiddenRows
from taskcal.tables.table import Cells, Sheet
from taskcal.tables.text import with_decimal_points
from taskcal_groundwork.files import ZipKind, open_zip

WORKBOOK = ZipKind(
    name="workbook", remedy="save it again, or as CSV",
    most_entries=5000, largest_mb=200.0, small_mb=5.0, most_ratio=10.0, largest_entry_mb=200.0,
)  # fmt: skip
"""A campaign of 100 000 rows unpacks to less than 200 MB; measured numbers pack five to seven times, and a cell costs the same time
however well it packs."""

STYLES, MAX_STYLE_TAGS = "xl/styles.xml", 100_000
"""The part with the formats of cells, which are read with the cells; instruments and people define some hundreds."""

_NUMERIC = re.compile(r"[+-]?[.,]?\d[\d.,]*(?:e[+-]?\d+)?", re.ASCII | re.IGNORECASE)

MAX_CELLS = 4_000_000
"""Of a sheet, those counted that stand empty before a filled one: a campaign of 100 000 rows and 40 columns."""

MAX_SHEET_COLUMNS = 16_384

MAX_ROWS = 1_048_576
"""That a workbook has; a row with a far number makes those between it and the others."""


def read_workbook(
    path: Path,
    content: bytes,
    name: str | None = None,
    hidden: HiddenRows | None = None,
    decimal: DecimalMark | None = None,
) -> Sheet:
    """The cells of a sheet with their values as they were last computed.

    Args:
        path: of the file, for errors.
        content: its bytes.
        name: of the sheet; by default the visible one with most rows of numbers, the first among several, or a hidden one
            where no other has any.
        hidden: what becomes of rows of numbers that are hidden or have struck-out cells.
        decimal: the decimal mark of numbers that are stored as text; by default what these themselves tell.

    Raises:
        FileError: it is damaged, unpacks to too much, or has no cells; the sheet has rows of numbers that are hidden or struck out
            while `hidden` is not stated, formulas without values, merges cells over several of these rows, or has numbers stored as
            text whose comma may be either.
        UnknownName: there is no such sheet.
    """
    _check_parts(path, content)
    from openpyxl import load_workbook

    try:
        book: Any = load_workbook(io.BytesIO(content), read_only=True, data_only=True, rich_text=True)
        names = [sheet.title for sheet in book.worksheets]
        if name is not None and name not in names:
            raise UnknownName("sheet", name, names, f"in {path}")
        struck = frozenset(k for k, style in enumerate(book._cell_styles) if book._fonts[style.fontId].strike)
        filled = [_Filled(path, book[title], struck) for title in ([name] if name else names)]
    except (FileError, UnknownName):
        raise
    except Exception as error:
        # openpyxl raises what a damaged part happens to lead to: a KeyError, a TypeError, a parser's own error …
        raise FileError(path, f"is a damaged workbook ({shown(error)}); save it again, or as CSV") from error
    with_cells = [one for one in filled if len(one.rows)]
    if not with_cells:
        raise FileError(path, "is a workbook without cells")
    chosen = max(with_cells, key=lambda one: (one.visible and one.numeric.any(), one.numeric.sum()))
    others = [one.name for one in with_cells if one is not chosen]
    more = f"; others with cells: {', '.join(others)}" if others else ""
    notes = () if chosen.visible and not others else (f"sheet '{chosen.name}' is read{more}",)
    sheet = with_decimal_points(
        Sheet(path=path, rows=chosen.rows, lines=chosen.lines, notes=notes, acted=frozenset({"sheet"})),
        decimal,
        chosen.texts,
    )
    return _as_shown(sheet, chosen, hidden)


def _check_parts(path: Path, content: bytes) -> None:
    """See that a workbook can be unpacked in memory, and defines nothing of its own."""
    with open_zip(path, WORKBOOK, content) as packed:
        for part in packed.entries:
            if part.name == STYLES and (tags := packed.read(part).count(b"<")) > MAX_STYLE_TAGS:
                message = f"defines formats of cells by {tags} tags, more than {MAX_STYLE_TAGS}; save the sheet as CSV"
                raise FileError(path, message)
            if part.name.endswith((".xml", ".rels")):
                head = next(packed.pieces(part, 1024), b"")
                if b"\0" in head:
                    raise FileError(path, f"has {shown(part.name)} in UTF-16; save it again, or as CSV")
                if b"<!" in head.replace(b"<!--", b""):
                    raise FileError(path, f"has a document type in {shown(part.name)}; save it again, or as CSV")


class _Filled:
    """A sheet with its cells as text, and what it says of its rows and cells beside their values."""

    def __init__(self, path: Path, sheet: Any, struck: frozenset[int]):
        self.title: str = sheet.title
        self.visible = sheet.sheet_state == "visible"
        self.hidden: set[int] = set()
        """Rows that are, by hand, by a filter, or in a group that is folded."""
        self.struck: set[int] = set()
        """Rows with a filled cell in a struck-out font, whose styles are given."""
        self.torn: set[int] = set()
        """Rows with a text of which a part is struck out."""
        self.unvalued: set[int] = set()
        """Rows with a formula that has no value: a program wrote it, and none computed it."""
        self.merged: list[tuple[int, int, str]] = []
        """First and last row of each merged cell, and its range."""
        self.columns = np.zeros(MAX_SHEET_COLUMNS, dtype=bool)
        """Which are hidden."""
        self._texts = bytearray()
        self.rows, self.lines = Cells.numbered(self._read(path, sheet, struck))
        self.numeric = np.fromiter(map(_holds_numbers, self.rows), bool, len(self.rows))
        """Which rows hold numbers."""
        self.texts = np.frombuffer(self._texts, dtype=bool)
        """Which cells are stored as text."""

    @property
    def name(self) -> str:
        """The title, and whether it is hidden."""
        return shown(self.title) if self.visible else f"{shown(self.title)} (hidden)"

    def _read(self, path: Path, sheet: Any, struck: frozenset[int]) -> Iterator[tuple[int, tuple[str, ...]]]:
        """The rows that have cells, each with its number."""
        count = above = 0
        with sheet._get_source() as source:
            parser = _parser(sheet, source, self.unvalued)
            for number, cells in parser.parse():
                if parser.row_dimensions.pop(str(number), {}).get("hidden") in TRUE:
                    self.hidden.add(number)
                if number > MAX_ROWS:
                    raise FileError(
                        path, f"numbers a row beyond {MAX_ROWS}, the last of a workbook; save the table alone as CSV"
                    )
                width = cells[-1]["column"] if cells else 0
                count += width
                if count > MAX_CELLS:
                    raise FileError(
                        path, f"has more than {MAX_CELLS} cells, most of them empty; save the table alone as CSV"
                    )
                if number <= above:
                    message = f"row {number} stands behind row {above}; save the workbook again, or as CSV"
                    raise FileError(path, message, line=number)
                above = number
                if texts := self._texts_of(number, cells, width, struck):
                    yield number, texts
        for column in filter(lambda one: one.get("hidden") in TRUE, parser.column_dimensions.values()):
            self.columns[int(column["min"]) - 1 : int(column["max"])] = True
        if parser.merged_cells is not None:
            self.merged += [(one.min_row, one.max_row, one.coord) for one in parser.merged_cells.mergeCell]

    def _texts_of(
        self, number: int, cells: Sequence[dict[str, Any]], width: int, struck: frozenset[int]
    ) -> tuple[str, ...]:
        """Texts of a row up to its last that is not empty; its marks are noted."""
        from openpyxl.cell.rich_text import CellRichText, TextBlock

        texts, stored = [""] * width, bytearray(width)
        for cell in cells:
            value, column = cell["value"], cell["column"]
            if value is None or column > width:
                continue
            rich = isinstance(value, CellRichText)
            texts[column - 1], stored[column - 1] = _text(value), rich or isinstance(value, str)
            if cell["style_id"] in struck:
                self.struck.add(number)
            if rich and any(isinstance(part, TextBlock) and part.font.strike for part in value):
                self.torn.add(number)
        while texts and not texts[-1]:
            texts.pop()
        self._texts += stored[: len(texts)]
        return tuple(texts)


def _holds_numbers(cells: tuple[str, ...]) -> bool:
    return sum(_NUMERIC.fullmatch(cell) is not None for cell in cells[:10]) > 1


def _text(value: object) -> str:
    """A cell's value as a person would type it."""
    if value is None:
        return ""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float):
        return str(int(value)) if value.is_integer() and abs(value) < 1e15 else repr(value)
    if isinstance(value, (datetime, date, time)):
        return value.isoformat()
    return str(value).strip()


TRUE = ("1", "true")
"""How a workbook's XML writes it."""


def _parser(sheet: Any, source: Any, unvalued: set[int]) -> Any:
    """The parser with which openpyxl reads rows one after another; it notes those with a formula without a value, too."""
    from openpyxl.worksheet._reader import FORMULA_TAG, VALUE_TAG, WorkSheetParser

    class Parser(WorkSheetParser):
        def parse_row(self, row: Any) -> Any:
            number, cells = super().parse_row(row)
            if next(row.iter(FORMULA_TAG), None) is not None and any(
                cell.find(FORMULA_TAG) is not None and not cell.findtext(VALUE_TAG) and cell.get("t") != "str"
                for cell in row
            ):
                unvalued.add(number)
            return number, cells

    book = sheet.parent
    formats = {"date_formats": book._date_formats, "timedelta_formats": book._timedelta_formats}
    return Parser(source, sheet._shared_strings, data_only=True, epoch=book.epoch, rich_text=True, **formats)


def _as_shown(sheet: Sheet, filled: _Filled, stated: HiddenRows | None) -> Sheet:
    """A sheet in view of its marks.

    Raises:
        FileError: it is not stated what becomes of hidden rows, or values are not known.
    """
    from openpyxl.utils import get_column_letter

    path, lines, numeric, name = sheet.path, filled.lines, filled.numeric, f"sheet '{filled.name}'"

    def those(rows: Iterable[int], among: np.ndarray) -> list[int]:
        return sorted(set(lines[among].tolist()).intersection(rows))

    below = lines >= (lines[numeric][0] if numeric.any() else 0)
    if at := those(filled.unvalued, below):
        message = (
            f"{name}: formulas have no values ({_listed(at)}); open the workbook in a spreadsheet and save it there"
        )
        raise FileError(path, message, line=at[0])
    if at := those(filled.torn, numeric):
        message = f"{name}: part of a cell's text is struck out ({_listed(at)}); leave in it what is meant"
        raise FileError(path, message, line=at[0])
    of_numbers = lines[numeric]
    for first, last, cells in filled.merged:
        # a merged cell has its value in its first row only
        if len(at := of_numbers[slice(*np.searchsorted(of_numbers, (first, last), side="right"))]):
            message = f"{name}: cells are merged over several rows ({cells}); write its value in each of them"
            raise FileError(path, message, line=int(at[0]))
    hidden, struck = those(filled.hidden, numeric), those(filled.struck, numeric)
    found = [f"hidden {_listed(hidden)}"] if hidden else []
    found += [f"struck-out cells in {_listed(struck)}"] if struck else []
    if found and stated is None:
        message = (
            f"{name} has {' and '.join(found)}; state --hidden-rows drop to leave these rows out or keep to read them, "
            "or delete or show them in the workbook"
        )
        raise FileError(path, message, line=min(hidden + struck))
    if found:
        what = "left out" if stated == "drop" else "read as the others"
        sheet = sheet.noted(f"{name}: {' and '.join(found)}: {what}, as stated")
        sheet = replace(sheet, acted=sheet.acted | {"hidden_rows"})
    if found and stated == "drop":
        kept = ~(numeric & np.isin(lines, hidden + struck))
        sheet = replace(sheet, rows=Cells.of(sheet.rows)[kept], lines=lines[kept])
    letters = [get_column_letter(k + 1) for k in np.flatnonzero(filled.columns[: filled.rows.widths.max()]).tolist()]
    if letters:
        sheet = sheet.noted(f"{name}: hidden columns ({listed(letters, 5)}) are read as the others")
    return sheet


def _listed(rows: Sequence[int]) -> str:
    """Numbers of rows in words, each run as its first and last: ``rows 4, 7-9``."""
    runs = np.split(np.array(rows), np.flatnonzero(np.diff(rows) > 1) + 1)
    texts = [f"{run[0]}-{run[-1]}" if len(run) > 1 else f"{run[0]}" for run in runs]
    every = f" ({len(rows)} in all)" if len(runs) > 5 else ""
    return f"row{'s' if len(rows) > 1 else ''} {listed(texts, 5)}{every}"
