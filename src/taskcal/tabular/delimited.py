"""Text in columns: commas, semicolons, tabs, bars or blanks between the cells."""

import csv
import re
from collections import Counter, deque
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import chain, islice
from operator import eq
from pathlib import Path

from taskcal.errors import FileError
from taskcal.tabular.decimal_mark import DecimalMark, find_decimal_mark, with_point
from taskcal.tabular.digit_groups import without_blanks
from taskcal.tabular.lines import lines_of
from taskcal.tabular.packed_rows import pack, pack_numbered
from taskcal.tabular.sheet import Sheet
from taskcal.tabular.unit_cells import with_units_apart
from taskcal.tabular.width import MAX_MARKS, too_wide

_SEPARATOR_LINE = re.compile(r"\Asep=(.)[ \t]*(?=\n)", re.IGNORECASE)
"""What a spreadsheet writes first to say how it separates."""

_LINE = re.compile(r"[^\r\n]+")

_COMMENT = re.compile(r"\s*(?:#|//|%|;;|!)(.*)")

_NUMBER = re.compile(r"[+-]?(?:\d+(?:[\d.,]*\d|\.)?|[.,]\d+)(?:e[+-]?\d+)?", re.ASCII | re.IGNORECASE)
"""A number with any decimal mark, to tell one way of parting lines from another; a comma behind it parts."""

_SAMPLED = 120
"""Lines that tell the separator, from the beginning and as many from the end."""

BLANKS = " "
COMMA_BLANK = ", "
"""A comma and a blank: what programs write that print decimal commas between commas."""

_SEPARATORS = ("\t", ";", "|", ",", COMMA_BLANK, BLANKS)
"""The first of those that part equally well is taken."""


_SELDOM_ELSE = ("\t", ";", "|")
"""What stands in nearly every line for no other reason than to part it."""


def parse_delimited(path: Path, text: str, decimal: DecimalMark | None = None) -> Sheet:
    """The rows of a file's text.

    Args:
        path: of the file, for errors.
        text: its whole text, lines ended by line feeds.
        decimal: the decimal mark; by default what the numbers themselves tell.

    Raises:
        FileError: a quote is not closed, or a comma may be a decimal mark or part thousands.
    """
    stated = _SEPARATOR_LINE.match(text)
    if stated:
        text = text[stated.end() + 1 :]
    numbered = enumerate(map(_COMMENT.match, lines_of(text)), start=1)
    commented = ((number, match[1].strip()) for number, match in numbered if match)
    first_comments = tuple(islice(commented, 2 * _SAMPLED))
    comments = tuple(comment for _, comment in chain(first_comments, commented))
    separator = stated[1] if stated and stated[1] in _SEPARATORS else separator_of(lines_of(text))
    first, grouped = 1 if stated else 0, separator != BLANKS and " " in text
    rows, lines = pack_numbered(
        (number + first, tuple(map(without_blanks, cells)) if grouped else cells)
        for number, cells in _cells(path, text, separator)
        if any(cells)
    )
    sheet = Sheet(path=path, rows=rows, lines=lines, separator=separator, comments=comments)
    if not rows:
        return sheet
    sheet = with_units_apart(replace(sheet, notes=_commented(first_comments, separator, len(rows[-1]), first)))
    # of a large file each form of its rows takes as much memory as its text
    del rows
    if separator == ",":
        # a comma that parts cells is in none of them, but for quoted ones
        return with_decimal_points(sheet, decimal) if '"' in text else sheet
    return with_decimal_points(sheet, decimal)


def _commented(comments: Sequence[tuple[int, str]], separator: str, width: int, first: int) -> tuple[str, ...]:
    """What is said of rows of numbers behind a comment mark, as people leave them out."""
    lines = [
        number + first
        for number, comment in comments
        if len(row := split_line(comment, separator)) == width and sum(map(bool, map(_NUMBER.fullmatch, row))) > 2
    ]
    if not lines:
        return ()
    listed = ", ".join(map(str, lines[:5])) + (", …" if len(lines) > 5 else "")
    return (f"numbers behind a comment mark are left out (line {listed})",)


def parse_plain(path: Path, text: str) -> Sheet:
    """The rows of plain CSV, whatever its numbers look like: commas, semicolons or tabs, as most of the first line's are.

    Raises:
        FileError: a quote is not closed.
    """
    separator, stated = delimiter_of(text), _SEPARATOR_LINE.match(text)
    first = 0
    if stated:
        text, first = text[stated.end() + 1 :], 1
    rows, lines = pack_numbered(
        (number + first, cells) for number, cells in _cells(path, text, separator) if any(cells)
    )
    return Sheet(path=path, rows=rows, lines=lines, separator=separator)


def delimiter_of(text: str) -> str:
    """What separates the cells of plain CSV, by its header."""
    # one after another: of a large file all lines take far more memory than its text
    lines = (line[0] for line in _LINE.finditer(_SEPARATOR_LINE.sub("", text, count=1)))
    header = next((line for line in lines if line.strip() and not line.startswith("#")), "")
    return max(",;\t", key=header.count)


def with_decimal_points(sheet: Sheet, decimal: DecimalMark | None = None) -> Sheet:
    """A sheet whose numbers have decimal points and no parted thousands.

    Raises:
        FileError: the decimal mark is not stated and cannot be told.
    """
    if not any("," in cell for row in sheet.rows for cell in row):
        return sheet
    marked = (
        (line, cell)
        for line, row in zip(sheet.lines, sheet.rows, strict=True)
        for cell in row
        if "," in cell or "." in cell
    )
    mark = find_decimal_mark(sheet.path, marked) if decimal is None else decimal
    rows = pack(tuple(with_point(cell, mark) for cell in row) for row in sheet.rows)
    if all(map(eq, rows, sheet.rows)):
        return sheet
    note = "numbers are read with decimal commas" if mark == "," else "commas in numbers are read as parting thousands"
    return replace(sheet, rows=rows, notes=(*sheet.notes, note))


def separator_of(lines: Iterable[str]) -> str:
    """What parts the cells: what gives most lines the same count of cells, and most cells numbers."""
    plain = (line for line in lines if line.strip() and not _COMMENT.match(line))
    sample = [*islice(plain, _SAMPLED), *deque(plain, _SAMPLED)]
    for separator in _SELDOM_ELSE:
        if (
            sample
            and sum(separator in line for line in sample) >= 0.9 * len(sample)
            and _fit(sample, separator)[0] > 0.2
        ):
            return separator
    best = max(_SEPARATORS, key=lambda separator: _fit(sample, separator))
    # where commas with a blank behind them part the lines as well, commas without one are decimal marks
    return COMMA_BLANK if best == "," and _fit(sample, COMMA_BLANK)[0] >= _fit(sample, best)[0] else best


def _fit(lines: Sequence[str], separator: str) -> tuple[float, int]:
    """How well a separator parts lines: share of cells that are numbers in lines of the usual count; then the count."""
    rows = [split_line(line, separator) for line in lines]
    counts = Counter(len(row) for row in rows if len(row) > 1)
    if not counts:
        return 0.0, 0
    usual, times = max(counts.items(), key=lambda item: (item[1], item[0]))
    cells = [cell for row in rows if len(row) == usual for cell in row]
    numeric = sum(_NUMBER.fullmatch(cell) is not None for cell in cells)
    return round((numeric + 0.01 * len(cells)) / len(cells) * times / len(rows), 6), usual


def split_line(line: str, separator: str) -> tuple[str, ...]:
    """The cells of one line."""
    if separator == BLANKS:
        return tuple(line.split())
    if separator == COMMA_BLANK:
        return tuple(cell.strip() for cell in re.split(r",\s+", line.strip()))
    if '"' not in line:
        return tuple(cell.strip() for cell in line.split(separator))
    try:
        return tuple(cell.strip() for cell in next(csv.reader([line], delimiter=separator), []))
    except csv.Error:
        return ()


def _cells(path: Path, text: str, separator: str) -> Iterator[tuple[int, tuple[str, ...]]]:
    """The cells of every line that is not a comment, with the line's number."""
    if separator in (BLANKS, COMMA_BLANK) or '"' not in text:
        for number, line in enumerate(lines_of(text), start=1):
            if not _COMMENT.match(line):
                yield number, split_line(line, separator)
        return
    for number, row in quoted_rows(path, text, separator):
        cells = tuple(cell.strip() for cell in row)
        if cells and not _COMMENT.match(cells[0]):
            yield number, cells


def quoted_rows(path: Path, text: str, separator: str) -> Iterator[tuple[int, list[str]]]:
    """The cells of every row of text with quotes, which may hold ends of lines, with the number of its last line.

    Raises:
        FileError: a quote is not closed, or the lines of one row have too many cells.
    """
    marks = 0

    def lines() -> Iterator[str]:
        nonlocal marks
        begin = 0
        while begin < len(text):
            end = text.find("\n", begin) + 1 or len(text)
            marks += text.count(separator, begin, end)
            if marks > MAX_MARKS:
                raise too_wide(path, reader.line_num + 1)
            yield text[begin:end]
            begin = end

    reader = csv.reader(lines(), delimiter=separator)
    try:
        for row in reader:
            marks = 0
            yield reader.line_num, row
    except csv.Error as error:
        raise FileError(path, f"cannot be parted into cells: {error}", line=reader.line_num) from error
