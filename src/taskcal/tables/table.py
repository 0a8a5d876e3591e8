"""A table of cells whose errors name file, line, column and value, whatever form of file it comes from."""

import math
import re
from array import array
from bisect import bisect_right
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import accumulate, chain, islice
from pathlib import Path
from typing import overload

import numpy as np
from jaxtyping import Float

from taskcal.errors import Faults, FileError, shown

# Rows of cells that take little more memory than their text.
#
# A text of its own takes sixty bytes beside its letters, and a cell of a table has six letters. So the cells of
# some hundred rows are kept as one text for each column, and parted again when they are asked for.

Row = tuple[str, ...]

CELLS, ROWS, MOST_CELLS = 30_000, 64, 1_000_000
"""Of a block: so many cells, but no fewer rows, as each column of a block costs as much as a cell outside of one; at most the last,
where rows are very long."""

_MARK = "\x1f"
"""Stands between cells where it is in none of them."""


@dataclass(frozen=True, slots=True)
class _Even:
    """Rows of one length: the cells of each column behind one another."""

    columns: tuple[str, ...]
    mark: str

    def __iter__(self) -> Iterator[Row]:
        return zip(*(column.split(self.mark) for column in self.columns), strict=True)

    def column(self, k: int) -> list[str]:
        return self.columns[k].split(self.mark)


@dataclass(frozen=True, slots=True)
class _Uneven:
    """Rows of several lengths: all cells behind one another."""

    cells: str
    mark: str
    widths: Sequence[int]

    def __iter__(self) -> Iterator[Row]:
        cells = iter(self.cells.split(self.mark))
        return (tuple(islice(cells, width)) for width in self.widths)

    def column(self, k: int) -> list[str]:
        return [row[k] for row in self]


class PackedRows(Sequence[Row]):
    """Rows in blocks; made by `pack`."""

    def __init__(self, blocks: Sequence[_Even | _Uneven], counts: Sequence[int]):
        self._blocks = tuple(blocks)
        self._ends = tuple(accumulate(counts))

    def __len__(self) -> int:
        return self._ends[-1]

    def __iter__(self) -> Iterator[Row]:
        return chain.from_iterable(self._blocks)

    @overload
    def __getitem__(self, index: int) -> Row: ...
    @overload
    def __getitem__(self, index: slice) -> Sequence[Row]: ...
    def __getitem__(self, index: int | slice) -> Row | Sequence[Row]:
        if isinstance(index, slice):
            begin, end, step = index.indices(len(self))
            assert step == 1, "rows are taken as they follow one another"
            return pack(islice(self._from(begin), max(end - begin, 0)))
        at = index + len(self) if index < 0 else index
        if not 0 <= at < len(self):
            raise IndexError(index)
        return next(self._from(at))

    def _from(self, begin: int) -> Iterator[Row]:
        """The rows from one on."""
        k = bisect_right(self._ends, begin)
        before = self._ends[k - 1] if k else 0
        return islice(chain.from_iterable(self._blocks[k:]), begin - before, None)

    def column(self, k: int) -> Iterator[list[str]]:
        """The cells of a column, some hundred at a time."""
        return (block.column(k) for block in self._blocks)

    def with_columns(self, columns: Mapping[int, Iterable[str]]) -> "PackedRows":
        """Rows of one length with other cells in some columns."""
        cells = {k: iter(column) for k, column in columns.items()}
        blocks: list[_Even | _Uneven] = []
        counts = [end - begin for begin, end in zip((0, *self._ends), self._ends, strict=False)]
        for block, count in zip(self._blocks, counts, strict=True):
            assert isinstance(block, _Even), "rows of one length are packed so"
            put = {k: list(islice(column, count)) for k, column in cells.items()}
            if all(block.mark not in cell for column in put.values() for cell in column):
                texts = tuple(block.mark.join(put[k]) if k in put else text for k, text in enumerate(block.columns))
                blocks.append(_Even(texts, block.mark))
            else:
                blocks.append(_packed([_replaced(row, put, i) for i, row in enumerate(block)]))
        return PackedRows(blocks, counts)


def pack(rows: Iterable[Row]) -> Sequence[Row]:
    """Rows in little memory; the rows themselves in a tuple where they are few."""
    blocks: list[_Even | _Uneven] = []
    counts: list[int] = []
    block: list[Row] = []
    cells = 0
    for row in rows:
        block.append(row)
        cells += len(row)
        if cells >= CELLS and (len(block) >= ROWS or cells >= MOST_CELLS):
            blocks.append(_packed(block))
            counts.append(len(block))
            block, cells = [], 0
    if not blocks:
        return tuple(block)
    if block:
        blocks.append(_packed(block))
        counts.append(len(block))
    return PackedRows(blocks, counts)


def _packed(rows: list[Row]) -> _Even | _Uneven:
    widths = array("L", map(len, rows))
    if widths[0] and widths.count(widths[0]) == len(widths):
        columns = list(zip(*rows, strict=True))
        mark = _MARK
        texts = tuple(mark.join(column) for column in columns)
        if sum(text.count(mark) for text in texts) != len(columns) * (len(rows) - 1):
            mark = _mark_beside(texts)
            texts = tuple(mark.join(column) for column in columns)
        return _Even(texts, mark)
    cells = list(chain.from_iterable(rows))
    text = _MARK.join(cells)
    if text.count(_MARK) == len(cells) - 1 or not cells:
        return _Uneven(text, _MARK, widths)
    mark = _mark_beside((text,))
    return _Uneven(mark.join(cells), mark, widths)


def _mark_beside(texts: Iterable[str]) -> str:
    """A character that no text has."""
    taken = set[str]().union(*texts)
    return next(mark for mark in map(chr, range(len(taken) + 1)) if mark not in taken)


def _replaced(row: Row, columns: Mapping[int, Sequence[str]], at: int) -> Row:
    return tuple(columns[k][at] if k in columns else cell for k, cell in enumerate(row))


def column_of(rows: Sequence[Row], k: int) -> Iterator[list[str]]:
    """The cells of a column of rows that all have it, many at a time."""
    return rows.column(k) if isinstance(rows, PackedRows) else iter(([row[k] for row in rows],))


def with_columns(rows: Sequence[Row], columns: Mapping[int, Iterable[str]]) -> Sequence[Row]:
    """Rows of one length with other cells in some columns, one for each row."""
    if isinstance(rows, PackedRows):
        return rows.with_columns(columns)
    put = {k: tuple(column) for k, column in columns.items()}
    return tuple(_replaced(row, put, at) for at, row in enumerate(rows))


def pack_numbered(numbered: Iterable[tuple[int, Row]]) -> tuple[Sequence[Row], Sequence[int]]:
    """Rows, each behind the number of its line, and these numbers, in little memory."""
    lines = array("q")

    def rows() -> Iterator[Row]:
        for line, row in numbered:
            lines.append(line)
            yield row

    packed = pack(rows())
    return packed, lines if isinstance(packed, PackedRows) else tuple(lines)


LARGEST = 1e6
"""Of any number in a table: 1 km in millimetres, or 2800 turns in degrees."""

_NUMBER = re.compile(r"[+-]?(\d+(?:\.\d*)?|\.\d+)(e[+-]?\d+)?", re.ASCII | re.IGNORECASE)
"""Python also reads 1_000 and the digits of other scripts, which no instrument writes."""

_NOT_FINITE = re.compile(r"[+-]?(nan|inf(inity)?)", re.IGNORECASE)


@dataclass(frozen=True, eq=False)
class Table:
    """Cells as text, with the line of the file each row stands in."""

    path: Path
    header: tuple[str, ...]
    rows: Sequence[tuple[str, ...]]
    lines: Sequence[int]
    header_line: int | None = 1
    """Where the names stand; None where the file has none."""

    def __len__(self) -> int:
        return len(self.rows)

    @cached_property
    def _index(self) -> dict[str, int]:
        return {name: i for i, name in enumerate(self.header)}

    def __contains__(self, column: str) -> bool:
        return column in self._index

    def error(self, message: str, row: int | None = None, column: str | None = None) -> FileError:
        """An error that points at a cell, a line, or the file."""
        return FileError(self.path, message, line=None if row is None else self.lines[row], column=column)

    def header_error(self, message: str, column: str | None = None) -> FileError:
        """An error that points at the names of the columns."""
        return FileError(self.path, message, line=self.header_line, column=column)

    def texts(self, column: str) -> list[str]:
        """The cells of a column.

        Raises:
            FileError: there is no such column.
        """
        return [cell for cells in self._parts(column) for cell in cells]

    def _parts(self, column: str) -> Iterator[list[str]]:
        """The cells of a column, many at a time: as texts of their own all of them take far more memory than as numbers."""
        if column not in self._index:
            raise FileError(
                self.path, f"has no column '{column}'; it has {shown(', '.join(self.header))}", line=self.header_line
            )
        return column_of(self.rows, self._index[column])

    def numbers(
        self, column: str, *, empty: bool = False, remedy: str = "give a number", largest: float = LARGEST
    ) -> Float[np.ndarray, " rows"]:
        """The numbers of a column; NaN for empty cells where `empty` allows them; `remedy` says what to do about others.

        Raises:
            FileError: there is no such column, or a cell is not a finite number, or one beyond ±`largest`.
        """
        out = np.empty(len(self))
        faults = Faults()
        first = 0
        for texts in self._parts(column):
            numbers = [float(text) if _NUMBER.fullmatch(text) else math.nan for text in texts]
            out[first : first + len(texts)] = numbers
            for k, (text, number) in enumerate(zip(texts, numbers, strict=True)):
                # a cell that is no number is NaN here, which is not within any bound
                if not abs(number) <= largest and (text or not empty):
                    with faults.collecting():
                        raise self.error(_trouble(text, remedy, largest), first + k, column)
            first += len(texts)
        faults.raise_any()
        return out


def _trouble(text: str, remedy: str, largest: float) -> str:
    """What is wrong with a cell that is no number within a bound."""
    if not text:
        return f"the cell is empty; {remedy}"
    if _NUMBER.fullmatch(text):
        return f"'{shown(text)}' is beyond ±{largest:g}; check the cell and its unit"
    if _NOT_FINITE.fullmatch(text):
        return f"'{shown(text)}' is not a finite number; {remedy}"
    return f"'{shown(text)}' is not a number; give a number such as 12.5"


# Rows of cells as a file has them, before anyone says what they mean.


@dataclass(frozen=True, kw_only=True, eq=False)
class Sheet:
    """Cells as text, row by row; rows may differ in length."""

    path: Path
    rows: Sequence[tuple[str, ...]]
    """Cells without surrounding blanks, numbers with a decimal point; rows without a cell are left out."""
    lines: Sequence[int]
    """The line of the file each row ends in, or its number in a workbook, from 1."""
    separator: str = ""
    """What parts the cells; nothing in a workbook, whose rows end with their last filled cell."""
    comments: tuple[str, ...] = ()
    """Lines that a mark such as # or // makes comments, without the mark."""
    units: tuple[str, ...] = ()
    """That stood behind the numbers of each column, empty where none did; none beyond the last that had one."""
    notes: tuple[str, ...] = ()
    """What was decided on the way, for whoever reads the result."""


# How many columns a table may have, seen before its lines are parted into cells: of one line there may be millions.

MAX_COLUMNS = 20_000
"""A spreadsheet holds 16 384, motion capture of many bodies writes some thousand."""

MAX_MARKS = 3 * MAX_COLUMNS
"""Of one kind in a line: a number may have one before its thousands and one before its decimals, beside that behind it."""

_MARKS = ",;\t|"

_WORD = re.compile(r"\S+")


def too_wide(path: Path, line: int) -> FileError:
    """What is said of a line that no table has."""
    return FileError(path, f"has more than {MAX_COLUMNS} columns; is it a table?", line=line)


def refuse_wide(path: Path, text: str) -> None:
    """See that no line would be parted into far more cells than a table has.

    Raises:
        FileError: one would.
    """
    begin, number = 0, 1
    while begin < len(text):
        # most lines are far shorter: as many characters at once as have too few marks, up to the end of a line
        end = text.rfind("\n", begin, begin + MAX_MARKS)
        if end < 0:
            end = text.find("\n", begin)
            end = len(text) if end < 0 else end
            marks = max(text.count(mark, begin, end) for mark in _MARKS)
            if marks > MAX_MARKS or _words(text, begin, end) > MAX_COLUMNS:
                raise too_wide(path, number)
        number += text.count("\n", begin, end + 1)
        begin = end + 1


def _words(text: str, begin: int, end: int) -> int:
    """Between blanks; no more are counted than are needed."""
    return sum(1 for _ in islice(_WORD.finditer(text, begin, end), MAX_COLUMNS + 1))
