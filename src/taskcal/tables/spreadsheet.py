"""Workbooks: the cells of one sheet as text."""

import io
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from datetime import date, datetime, time
from itertools import chain
from pathlib import Path
from typing import Any, Literal

import numpy as np

from robot_programs.core.files import ZipKind, open_zip
from taskcal.errors import FileError, UnknownName, shown
from taskcal.tables.table import Cells, Sheet
from taskcal.tables.text import DecimalMark, with_decimal_points

HiddenRows = Literal["keep", "drop"]
"""What becomes of rows of numbers that are hidden or struck out."""

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
        filled = [_Filled(path, book[title]) for title in ([name] if name else names)]
        struck = frozenset(k for k, style in enumerate(book._cell_styles) if book._fonts[style.fontId].strike)
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
    with open_zip(path, WORKBOOK, content) as packed:
        part = next(p for p in packed.entries if p.info.filename == book[chosen.title]._worksheet_path)
        marks = _marks(packed.pieces(part), struck)
    sheet = with_decimal_points(
        Sheet(path=path, rows=chosen.rows, lines=chosen.lines, notes=notes), decimal, chosen.texts
    )
    return _as_shown(sheet, chosen, marks, hidden)


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
    """A sheet with its cells as text."""

    def __init__(self, path: Path, sheet: Any):
        self.title: str = sheet.title
        self.visible = sheet.sheet_state == "visible"
        self.torn: set[int] = set()
        """Rows with a text of which a part is struck out."""
        self._texts = bytearray()
        self.rows, self.lines = Cells.numbered(self._read(path, sheet))
        self.numeric = np.fromiter(map(_holds_numbers, self.rows), bool, len(self.rows))
        """Which rows hold numbers."""
        self.texts = np.frombuffer(self._texts, dtype=bool)
        """Which cells are stored as text."""

    @property
    def name(self) -> str:
        """The title, and whether it is hidden."""
        return shown(self.title) if self.visible else f"{shown(self.title)} (hidden)"

    def _read(self, path: Path, sheet: Any) -> Iterator[tuple[int, tuple[str, ...]]]:
        """The rows that have cells, each with its number."""
        from openpyxl.cell.rich_text import CellRichText, TextBlock

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
                raise FileError(
                    path, f"has more than {MAX_CELLS} cells, most of them empty; save the table alone as CSV"
                )
            if not cells:
                continue
            texts = [_text(value) for value in cells]
            while texts and not texts[-1]:
                texts.pop()
            if not texts:
                continue
            for value in cells[: len(texts)]:
                rich = isinstance(value, CellRichText)
                self._texts.append(rich or isinstance(value, str))
                if rich and any(isinstance(part, TextBlock) and part.font.strike for part in value):
                    self.torn.add(number)
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


# What a sheet says of its rows and cells beside their values, which openpyxl does not read where rows come one after another.

_TAG = rb"<(?:\w+:)?"

_OF_ROWS = _TAG + rb"row\b(?P<row>[^<>]*)>"

_UNVALUED = (
    _TAG + rb"c\b(?P<formula>[^<>]*)>\s*+" + _TAG + rb"f\b[^<>]*>(?:[^<]*</(?:\w+:)?f>)?\s*+"
    rb"(?:" + _TAG + rb"v\s*+(?:/>|>\s*+</(?:\w+:)?v>))?\s*+</(?:\w+:)?c>"
)  # fmt: skip
"""A formula without the value that it had when the workbook was saved: a program wrote it, and none computed it."""

_FILLED = _TAG + rb"c\b(?P<cell>[^<>]*)(?<!/)>"

_STRIKE = _TAG + rb"(?P<strike>strike)\b"
"""In a sheet itself only where a part of a text is struck out; formats stand elsewhere."""

_USUAL, _STRUCK = (
    re.compile(b"|".join(kinds)) for kinds in ((_OF_ROWS, _UNVALUED), (_OF_ROWS, _UNVALUED, _FILLED, _STRIKE))
)

_MERGED = re.compile(_TAG + rb"mergeCell\b[^<>]*\bref\s*=\s*[\"']([A-Z]+(\d+):[A-Z]+(\d+))[\"']")

_COLUMNS = re.compile(_TAG + rb"col\b([^<>]*)>")

_HIDDEN = re.compile(rb"\bhidden\s*=\s*[\"'](?:1|true)[\"']")

_NUMBERS = {name: re.compile(rb"\b%s\s*=\s*[\"'][A-Z]*(\d+)[\"']" % name) for name in (b"r", b"s", b"min", b"max")}
"""By the names of attributes, behind the letters of a column."""

_TEXT = re.compile(rb"\bt\s*=\s*[\"']str[\"']")
"""A formula that gives a text, which may be empty."""

MAX_ROW_BYTES = 8_000_000
"""Of a row of the widest sheet, 16 384 cells; what is longer is searched in pieces."""


@dataclass(eq=False, kw_only=True)
class _Marks:
    """Marks of a sheet, by the numbers of its rows."""

    hidden: set[int] = field(default_factory=set[int])
    """By hand, by a filter, or in a group that is folded."""
    struck: set[int] = field(default_factory=set[int])
    """Rows with a filled cell in a struck-out font."""
    torn: set[int] = field(default_factory=set[int])
    """Rows with a text of which a part is struck out."""
    unvalued: set[int] = field(default_factory=set[int])
    """Rows with a formula that has no value."""
    merged: list[tuple[int, int, str]] = field(default_factory=list[tuple[int, int, str]])
    """First and last row of each merged cell, and its range."""
    columns: np.ndarray = field(default_factory=lambda: np.zeros(MAX_SHEET_COLUMNS, dtype=bool))
    """Which are hidden."""


def _marks(pieces: Iterable[bytes], struck: frozenset[int]) -> _Marks:
    """Marks of a sheet in the pieces of its XML; `struck` has the styles whose font is struck out."""
    marks, rest, number = _Marks(), b"", 0
    for piece in chain(pieces, (b"",)):
        text = rest + piece
        # what is cut in the middle of a row waits for the rest of it
        cut = text.rfind(b"row>")
        end = len(text) if not piece or len(text) > MAX_ROW_BYTES else cut + len(b"row>") if cut >= 0 else 0
        part, rest = text[:end], text[end:]
        number = _mark_rows(part, number, marks, struck)
        for attributes in filter(_HIDDEN.search, _COLUMNS.findall(part)):
            first, last = _number(attributes, b"min"), _number(attributes, b"max")
            marks.columns[max(first, 1) - 1 : last] = True
        marks.merged += [(int(first[:10]), int(last[:10]), ref.decode()) for ref, first, last in _MERGED.findall(part)]
    return marks


def _mark_rows(text: bytes, number: int, marks: _Marks, struck: frozenset[int]) -> int:
    """Note the marks in a part of a sheet behind a row; says the number of its last row."""
    at = number
    for match in (_STRUCK if struck or b"strike" in text else _USUAL).finditer(text):
        match match.lastgroup:
            case "row":
                at = number = _number(match["row"], b"r") or number + 1
                if _HIDDEN.search(match["row"]):
                    marks.hidden.add(number)
            case "formula":
                if not _TEXT.search(match["formula"]):
                    marks.unvalued.add(_number(match["formula"], b"r") or number)
            case "cell":
                at = _number(match["cell"], b"r") or number
                if _number(match["cell"], b"s") in struck:
                    marks.struck.add(at)
            case _:
                marks.torn.add(at)
    return number


def _number(attributes: bytes, name: bytes) -> int:
    """The number of an attribute; 0 where it has none, as the first style has."""
    found = _NUMBERS[name].search(attributes)
    return int(found[1][:10]) if found else 0


def _as_shown(sheet: Sheet, filled: _Filled, marks: _Marks, stated: HiddenRows | None) -> Sheet:
    """A sheet in view of its marks.

    Raises:
        FileError: it is not stated what becomes of hidden rows, or values are not known.
    """
    from openpyxl.utils import get_column_letter

    path, lines, numeric, name = sheet.path, filled.lines, filled.numeric, f"sheet '{filled.name}'"

    def those(rows: Iterable[int], among: np.ndarray) -> list[int]:
        return sorted(set(lines[among].tolist()).intersection(rows))

    below = lines >= (lines[numeric][0] if numeric.any() else 0)
    if at := those(marks.unvalued, below):
        message = (
            f"{name}: formulas have no values ({_listed(at)}); open the workbook in a spreadsheet and save it there"
        )
        raise FileError(path, message, line=at[0])
    if at := those(marks.torn | filled.torn, numeric):
        message = f"{name}: part of a cell's text is struck out ({_listed(at)}); leave in it what is meant"
        raise FileError(path, message, line=at[0])
    of_numbers = lines[numeric]
    for first, last, cells in marks.merged:
        # a merged cell has its value in its first row only
        if len(at := of_numbers[slice(*np.searchsorted(of_numbers, (first, last), side="right"))]):
            message = f"{name}: cells are merged over several rows ({cells}); write its value in each of them"
            raise FileError(path, message, line=int(at[0]))
    hidden, struck = those(marks.hidden, numeric), those(marks.struck, numeric)
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
    if found and stated == "drop":
        kept = ~(numeric & np.isin(lines, hidden + struck))
        sheet = replace(sheet, rows=Cells.of(sheet.rows)[kept], lines=lines[kept])
    letters = [get_column_letter(k + 1) for k in np.flatnonzero(marks.columns[: filled.rows.widths.max()]).tolist()]
    if letters:
        some = f"{', '.join(letters[:5])}{', …' if letters[5:] else ''}"
        sheet = sheet.noted(f"{name}: hidden columns ({some}) are read as the others")
    return sheet


def _listed(rows: Sequence[int]) -> str:
    """Numbers of rows in words, each run as its first and last: ``rows 4, 7-9``."""
    runs = np.split(np.array(rows), np.flatnonzero(np.diff(rows) > 1) + 1)
    texts = [f"{run[0]}-{run[-1]}" if len(run) > 1 else f"{run[0]}" for run in runs]
    more = f", … ({len(rows)} in all)" if len(runs) > 5 else ""
    return f"row{'s' if len(rows) > 1 else ''} {', '.join(texts[:5])}{more}"
