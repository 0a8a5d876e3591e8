"""Rows of cells that take little more memory than their text.

A text of its own takes sixty bytes beside its letters, and a cell of a table has six letters. So the cells of some hundred rows are
kept as one text for each column, and parted again when they are asked for.
"""

from array import array
from bisect import bisect_right
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import accumulate, chain, islice
from typing import overload

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
