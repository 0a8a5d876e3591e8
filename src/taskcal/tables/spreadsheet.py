"""Workbooks: the cells of one sheet as text."""

import io
import re
from collections.abc import Iterator
from datetime import date, datetime, time
from pathlib import Path
from typing import Any

from robot_programs.core.files import ZipKind, open_zip
from taskcal.errors import FileError, UnknownName, shown
from taskcal.tables.table import Cells, Sheet

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

MAX_ROWS = 1_048_576
"""That a workbook has; a row with a far number makes those between it and the others."""


def read_workbook(path: Path, content: bytes, name: str | None = None) -> Sheet:
    """The cells of a sheet with their values as they were last computed.

    Args:
        path: of the file, for errors.
        content: its bytes.
        name: of the sheet; the one with most rows of numbers by default, the first among several.

    Raises:
        FileError: it is damaged, unpacks to too much, or has no cells.
        UnknownName: there is no such sheet.
    """
    _check_parts(path, content)
    from openpyxl import load_workbook

    try:
        book = load_workbook(io.BytesIO(content), read_only=True, data_only=True)
        names = [sheet.title for sheet in book.worksheets]
        if name is not None and name not in names:
            raise UnknownName("sheet", name, names, f"in {path}")
        filled = [(title, *Cells.numbered(_rows(path, book[title]))) for title in ([name] if name else names)]
    except (FileError, UnknownName):
        raise
    except Exception as error:
        # openpyxl raises what a damaged part happens to lead to: a KeyError, a TypeError, a parser's own error …
        raise FileError(path, f"is a damaged workbook ({shown(error)}); save it again, or as CSV") from error
    with_cells = [sheet for sheet in filled if len(sheet[1])]
    if not with_cells:
        raise FileError(path, "is a workbook without cells")
    title, rows, lines = max(with_cells, key=lambda sheet: sum(map(_holds_numbers, sheet[1])))
    others = [shown(other) for other, *_ in with_cells if other != title]
    notes = (f"sheet '{shown(title)}' is read; others with cells: {', '.join(others)}",) if others else ()
    return Sheet(path=path, rows=rows, lines=lines, notes=notes)


def _check_parts(path: Path, content: bytes) -> None:
    """See that a workbook can be unpacked in memory, and defines nothing of its own."""
    with open_zip(path, WORKBOOK, content) as packed:
        for part in packed.entries:
            if part.name == STYLES and (tags := packed.read(part).count(b"<")) > MAX_STYLE_TAGS:
                message = f"defines formats of cells by {tags} tags, more than {MAX_STYLE_TAGS}; save the sheet as CSV"
                raise FileError(path, message)
            if part.name.endswith((".xml", ".rels")):
                head = next(packed.pieces(part, 1024), b"")
                if b"<!" in head.replace(b"<!--", b""):
                    raise FileError(path, f"has a document type in {shown(part.name)}; save it again, or as CSV")


def _rows(path: Path, sheet: Any) -> Iterator[tuple[int, tuple[str, ...]]]:
    """The rows of a sheet that have cells, each with its number."""
    count = 0
    # rows end with their own last cell: what the sheet says of its size may be missing or wrong
    sheet.reset_dimensions()
    for number, cells in enumerate(sheet.iter_rows(values_only=True), start=1):
        if number > MAX_ROWS:
            raise FileError(
                path, f"numbers a row beyond {MAX_ROWS}, the last of a workbook; save the table alone as CSV"
            )
        count += len(cells)
        if count > MAX_CELLS:
            raise FileError(path, f"has more than {MAX_CELLS} cells, most of them empty; save the table alone as CSV")
        if not cells:
            continue
        texts = [_text(value) for value in cells]
        while texts and not texts[-1]:
            texts.pop()
        if texts:
            yield number, tuple(texts)


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
