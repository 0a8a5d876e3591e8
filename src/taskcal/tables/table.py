"""Cells of a file as a frame of strings, and the numbers in them; errors name file, line, column and value."""

import math
import re
from array import array
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import islice
from pathlib import Path
from typing import Any, Literal, NamedTuple, overload

import numpy as np
from jaxtyping import Bool, Float

from taskcal.arguments import repeated
from taskcal.errors import Faults, FileError, shown

Row = tuple[str, ...]

TEXT = np.dtypes.StringDType()
"""Sixteen bytes a cell: texts of up to 15 letters lie in the array itself, where Python takes 60 bytes for each."""

CELLS_AT_ONCE = 30_000
"""Cells that are Python texts at once, on the way into an array and out of it."""


class Cells(Sequence[Row]):
    """Rows of cells, which may differ in length, in one array of strings."""

    def __init__(self, cells: np.ndarray, widths: np.ndarray):
        self.cells = cells
        """All cells, row after row."""
        self.widths = widths
        """Number of cells of each row."""
        self.ends = np.cumsum(widths)
        self.begins = self.ends - widths

    @classmethod
    def of(cls, rows: Iterable[Sequence[str]]) -> "Cells":
        """The cells of rows that are given one after another."""
        if isinstance(rows, cls):
            return rows
        widths, parts, block = array("q"), [np.array([], dtype=TEXT)], list[str]()
        for row in rows:
            widths.append(len(row))
            block.extend(row)
            if len(block) >= CELLS_AT_ONCE:
                parts.append(np.array(block, dtype=TEXT))
                block = []
        parts.append(np.array(block, dtype=TEXT))
        return cls(np.concatenate(parts), np.array(widths, dtype=np.int64))

    @classmethod
    def numbered(cls, rows: Iterable[tuple[int, Sequence[str]]]) -> tuple["Cells", np.ndarray]:
        """The cells of rows, each given with the number of its line, and these numbers."""
        lines = array("q")

        def cells() -> Iterator[Sequence[str]]:
            for line, row in rows:
                lines.append(line)
                yield row

        return cls.of(cells()), np.array(lines, dtype=np.int64)

    def __len__(self) -> int:
        return len(self.ends)

    def __iter__(self) -> Iterator[Row]:
        step = max(1, CELLS_AT_ONCE * len(self) // max(1, len(self.cells)))
        for first in range(0, len(self), step):
            begin, ends = int(self.begins[first]), self.ends[first : first + step].tolist()
            texts = self.cells[begin : ends[-1]].tolist()
            start = 0
            for end in ends:
                yield tuple(texts[start : end - begin])
                start = end - begin

    @overload
    def __getitem__(self, index: int) -> Row: ...
    @overload
    def __getitem__(self, index: slice | np.ndarray) -> "Cells": ...
    def __getitem__(self, index: int | slice | np.ndarray) -> "Row | Cells":
        """A row, or those of a slice or a mask, in their order."""
        if isinstance(index, np.ndarray):
            return Cells(self.cells[np.repeat(index, self.widths)], self.widths[index])
        if isinstance(index, slice):
            begin, end, step = index.indices(len(self))
            if step != 1:
                chosen = np.zeros(len(self), dtype=bool)
                chosen[index] = True
                return self[chosen]
            rows = slice(begin, max(begin, end))
            first, cells = self.begins[rows], self.widths[rows].sum()
            start = int(first[0]) if len(first) else 0
            return Cells(self.cells[start : start + int(cells)], self.widths[rows])
        return tuple(self.cells[self.begins[index] : self.ends[index]].tolist())

    def column(self, k: int) -> np.ndarray:
        """The cells of a column that all rows have."""
        return self.cells[self.begins + k]

    def with_columns(self, columns: Mapping[int, Sequence[str]]) -> "Cells":
        """Rows with other cells in some columns that all rows have."""
        cells = self.cells.copy()
        for k, texts in columns.items():
            cells[self.begins + k] = np.array(texts, dtype=TEXT)
        return Cells(cells, self.widths)

    def texts(self, at: Bool[np.ndarray, " cells"]) -> Iterator[str]:
        """Some of the cells, some thousand at a time."""
        where = np.flatnonzero(at)
        for first in range(0, len(where), CELLS_AT_ONCE):
            yield from self.cells[where[first : first + CELLS_AT_ONCE]].tolist()

    def mapped(self, function: Callable[[str], str], at: Bool[np.ndarray, " cells"]) -> "Cells":
        """Rows with some of the cells replaced by what a function makes of them."""
        cells, where = self.cells.copy(), np.flatnonzero(at)
        for first in range(0, len(where), CELLS_AT_ONCE):
            some = where[first : first + CELLS_AT_ONCE]
            cells[some] = np.array([function(text) for text in self.cells[some].tolist()], dtype=TEXT)
        return Cells(cells, self.widths)

    def holding(self, marks: str) -> Bool[np.ndarray, " cells"]:
        """Which cells have one of some characters."""
        return np.any([np.strings.find(self.cells, mark) >= 0 for mark in marks], axis=0)


LARGEST = 1e6
"""Of any number in a table: 1 km in millimetres, or 2800 turns in degrees."""

NUMBER = re.compile(r"[+-]?(?:\d+(?:\.\d*)?|\.\d+)(?:e[+-]?\d+)?", re.ASCII | re.IGNORECASE)
"""Python also reads 1_000 and the digits of other scripts, which no instrument writes."""


def number_of(text: str) -> float:
    """The number that a text is, as instruments write them; NaN of any other."""
    return float(text) if NUMBER.fullmatch(text) else math.nan


_NOT_FINITE = re.compile(r"[+-]?(nan|inf(inity)?)", re.IGNORECASE)

POSITION = ("x_mm", "y_mm", "z_mm")
QUATERNION = ("qx", "qy", "qz", "qw")

UNIT_LENGTH = 1e-3
"""How far the length of a quaternion or a direction may be from one: files round to a few digits."""

LEAVE_OUT = "give a number, or leave out the row"


@dataclass(frozen=True, eq=False)
class Table:
    """Cells as text under the names of their columns, with the line of the file each row stands in.

    Columns are asked for as the file writes them or in small letters; errors name them as the file does.
    """

    path: Path
    header: tuple[str, ...]
    rows: Sequence[Row]
    lines: Sequence[int] | np.ndarray
    header_line: int | None = 1
    """Where the names stand; None where the file has none."""
    units: tuple[str, ...] = ()
    """Units from a row of their own: one for each column, empty where it states none."""
    preamble: tuple[str, ...] = ()
    """Lines before the column names and comments, as text."""
    faults: tuple[FileError, ...] = ()
    """Lines with more or fewer cells than there are columns; the rows are without them."""
    notes: tuple[str, ...] = ()
    """What was decided on the way."""
    acted: frozenset[str] = frozenset()
    """What the user stated of its form that made a difference, by the fields of `TableForm`."""
    _used: set[str] = field(default_factory=set[str], init=False, repr=False)
    """Columns that were asked for, as the file writes them."""

    def __len__(self) -> int:
        return len(self.rows)

    @cached_property
    def cells(self) -> Cells:
        """The rows as a frame; all are as long as the header."""
        return Cells.of(self.rows)

    @cached_property
    def _index(self) -> dict[str, int]:
        lowered = {name.lower(): i for i, name in enumerate(self.header)}
        return {**lowered, **{name: i for i, name in enumerate(self.header)}}

    def __contains__(self, column: str) -> bool:
        return column in self._index or column.lower() in self._index

    def spelled(self, column: str) -> str:
        """A column's name as the file writes it, where it has it."""
        k = self._index.get(column, self._index.get(column.lower()))
        return column if k is None else self.header[k]

    def error(self, message: str, row: int | None = None, column: str | None = None) -> FileError:
        """An error that points at a cell, a line, or the file."""
        line = None if row is None else int(self.lines[row])
        return FileError(self.path, message, line=line, column=column and self.spelled(column))

    def header_error(self, message: str, column: str | None = None) -> FileError:
        """An error that points at the names of the columns."""
        return FileError(self.path, message, line=self.header_line, column=column and self.spelled(column))

    def noted(self, *notes: str) -> "Table":
        """The table with more notes."""
        return replace(self, notes=(*self.notes, *notes))

    def take(self, rows: slice | np.ndarray) -> "Table":
        """Some of the rows: a slice or a mask."""
        return replace(self, rows=self.cells[rows], lines=np.asarray(self.lines, dtype=np.int64)[rows])

    def texts(self, column: str) -> list[str]:
        """The cells of a column.

        Raises:
            FileError: there is no such column.
        """
        if column not in self:
            raise self.header_error(f"has no column '{column}'; it has {shown(', '.join(self.header))}")
        name = self.spelled(column)
        self._used.add(name)
        return self.cells.column(self._index[name]).tolist()

    def numbers(
        self, column: str, *, empty: bool = False, remedy: str = "give a number", largest: float = LARGEST
    ) -> Float[np.ndarray, " rows"]:
        """The numbers of a column; NaN for empty cells where `empty` allows them; `remedy` says what to do about others.

        Raises:
            FileError: there is no such column, or a cell is not a finite number, or one beyond ±`largest`.
        """
        texts = self.texts(column)
        out = np.array([number_of(text) for text in texts])
        # a cell that is no number is NaN here, which is not within any bound
        wrong = (row for row in np.flatnonzero(~(np.abs(out) <= largest)).tolist() if texts[row] or not empty)
        raise_all(self.error(trouble_with(texts[row], remedy, largest), row, column) for row in wrong)
        return out

    def side_by_side(self, columns: Sequence[str], **how: Any) -> Float[np.ndarray, "rows columns"]:
        """The numbers of several columns; `how` as of `numbers`, and its errors, those of all columns in one."""
        faults, values = Faults(), np.full((len(self), len(columns)), np.nan)
        for k, column in enumerate(columns):
            with faults.collecting():
                values[:, k] = self.numbers(column, **how)
        faults.raise_any()
        return values

    def together(self, columns: Sequence[str], why: str = "") -> tuple[str, ...]:
        """Columns that only make sense together, as the file writes them; none where it has none of them.

        Raises:
            FileError: it has some of them only, for the reason `why`, or they lack their unit.
        """
        given = tuple(self.spelled(name) for name in columns if name in self)
        lacking = [name for name in columns if name not in self]
        if given and lacking:
            raise self.header_error(f"has '{given[0]}' but no column '{lacking[0]}'{why and f'; {why}'}")
        for name in lacking:
            bare = name.removesuffix("_mm")
            if bare != name and bare in self:
                raise self.header_error(f"the unit is not stated; name the column {self.spelled(bare)}_mm", bare)
        self._used.update(given)
        return given

    def points(self, prefix: str = "", *, empty: bool = False, remedy: str = LEAVE_OUT) -> Float[np.ndarray, "rows 3"]:
        """``x_mm y_mm z_mm`` with a prefix, in metres; NaN for empty cells where `empty` allows them.

        Raises:
            FileError: a column is lacking, or a cell is not a number.
        """
        columns = [prefix + name for name in POSITION]
        self.together(columns)
        return self.side_by_side(columns, empty=empty, remedy=remedy) * 1e-3

    def quaternions(
        self,
        columns: Sequence[str] = QUATERNION,
        *,
        needed: Bool[np.ndarray, " rows"] | None = None,
        within: float = UNIT_LENGTH,
        remedy: str = LEAVE_OUT,
    ) -> Float[np.ndarray, "rows 4"]:
        """``qx qy qz qw``, each of length one.

        Args:
            columns: that hold them, in this order.
            needed: rows that must have one, all by default; the others may be empty, and turn nothing.
            within: how far a length may be from one.
            remedy: as of `numbers`.

        Raises:
            FileError: a column is lacking, a cell is empty or not a number, or a length is not one.
        """
        self.together(columns, "a pose needs qx qy qz qw")
        quaternions = self.side_by_side(columns, empty=needed is not None, remedy=remedy)
        needed = np.ones(len(self), dtype=bool) if needed is None else needed
        self.refuse_empty(quaternions, columns, needed, "a pose needs all of qx qy qz qw")
        self.check_lengths(quaternions, needed, columns[0], "quaternion", within)
        quaternions[~needed] = (0.0, 0.0, 0.0, 1.0)
        return quaternions

    def refuse_empty(self, values: np.ndarray, columns: Sequence[str], needed: np.ndarray, why: str) -> None:
        """Raise a `FileError` where a needed row lacks the number of a column."""
        for row, k in np.argwhere(np.isnan(values) & needed[:, None]).tolist():
            raise self.error(f"the cell is empty while the position is there; {why}", row, columns[k])

    def check_lengths(
        self,
        vectors: Float[np.ndarray, "rows k"],
        needed: Bool[np.ndarray, " rows"],
        column: str,
        what: str,
        within: float = UNIT_LENGTH,
    ) -> None:
        """See that the needed ones of some vectors have length one.

        Raises:
            FileError: one has not; it points at the column.
        """
        lengths = np.linalg.norm(vectors, axis=1)
        for row in np.flatnonzero(needed & (np.abs(lengths - 1.0) > within)):
            hint = " (is qw last?)" if what == "quaternion" else ""
            raise self.error(f"the {what} has length {lengths[row]:.4f}; it must be 1{hint}", int(row), column)

    def is_used(self, column: str) -> bool:
        """Whether a column was asked for."""
        return self.spelled(column) in self._used

    def refuse_unused(self, known: str) -> None:
        """See that every column was used; `known` says which there may be.

        Raises:
            FileError: one was not.
        """
        unused = [name for name in self.header if name not in self._used]
        if unused:
            named = shown(", ".join(map(repr, unused)))
            raise self.header_error(f"unknown column{'s' if len(unused) > 1 else ''} {named}; {known}")

    def refuse_repeated(self) -> None:
        """Raise a `FileError` where two columns have one name, whatever the letter case."""
        if twice := repeated(self.header):
            raise self.header_error(f"two columns are named '{shown(min(twice))}'; column names must differ")
        if twice := repeated(name.lower() for name in self.header):
            raise self.header_error(f"two columns are named '{shown(min(twice))}' but for letter case; keep one")


def raise_all(errors: Iterable[FileError]) -> None:
    """Raise the first twenty of some errors in one; nothing where there are none."""
    faults = Faults()
    for error in errors:
        with faults.collecting():
            raise error
    faults.raise_any()


def trouble_with(text: str, remedy: str, largest: float = LARGEST) -> str:
    """Fault of a cell that is no number within a bound, in words."""
    if not text:
        return f"the cell is empty; {remedy}"
    if NUMBER.fullmatch(text):
        return f"'{shown(text)}' is beyond ±{largest:g}; check the cell and its unit"
    if _NOT_FINITE.fullmatch(text):
        return f"'{shown(text)}' is not a finite number; {remedy}"
    return f"'{shown(text)}' is not a number; give a number such as 12.5"


# Units of measurements: each is one entry here, from which the reading of names, of rows of units and of cells is derived.


class Unit(NamedTuple):
    """A unit of measurements."""

    name: str
    """In a column's name, such as ``x_mm``."""
    quantity: Literal["length", "angle", "time", "temperature"]
    size: float
    """Metres, radians or seconds in one; 1 for a temperature, °C."""
    plural: str
    """In a message."""
    words: tuple[str, ...] = ()
    """Others that people write for it, in small letters."""


_UNITS = (
    Unit("mm", "length", 1e-3, "millimetres", ("millimeter", "millimeters", "millimetre", "millimetres")),
    Unit("m", "length", 1.0, "metres", ("meter", "meters", "metre", "metres")),
    Unit("um", "length", 1e-6, "micrometres", ("µm", "μm", "micron", "microns")),
    Unit("cm", "length", 1e-2, "centimetres", ("centimeter", "centimeters", "centimetre", "centimetres")),
    Unit("in", "length", 0.0254, "inches", ("inch", "inches")),
    Unit("ft", "length", 0.3048, "feet", ("foot", "feet")),
    Unit("yd", "length", 0.9144, "yards", ("yard", "yards")),
    # a German "Grad" is a degree; instruments on robots do not write the hundredth of a right angle so
    Unit("deg", "angle", math.pi / 180.0, "degrees", ("degree", "degrees", "°", "grad")),
    Unit("rad", "angle", 1.0, "radians", ("radian", "radians")),
    Unit("mrad", "angle", 1e-3, "milliradians"),
    Unit("gon", "angle", math.pi / 200.0, "gon"),
    Unit("s", "time", 1.0, "seconds", ("sec", "seconds")),
    Unit("ms", "time", 1e-3, "milliseconds"),
    Unit("min", "time", 60.0, "minutes"),
    Unit("h", "time", 3600.0, "hours"),
    Unit("C", "temperature", 1.0, "degrees Celsius", ("°c", "degc", "celsius")),
)

UNITS = {word: unit.name for unit in _UNITS for word in (unit.name.casefold(), *unit.words)}
"""Units by every word that people write for them."""

LENGTHS, ANGLES, TIMES = (
    {unit.name: unit.size for unit in _UNITS if unit.quantity == quantity} for quantity in ("length", "angle", "time")
)
"""Metres, radians and seconds in each unit."""

PLURALS = {unit.name: unit.plural for unit in _UNITS}
"""Units in a message."""


# Rows of cells as a file has them, before anyone says what they mean.


@dataclass(frozen=True, kw_only=True, eq=False)
class Sheet:
    """Cells as text, row by row; rows may differ in length."""

    path: Path
    rows: Sequence[Row]
    """Cells without surrounding blanks, numbers with a decimal point; rows without a cell are left out."""
    lines: Sequence[int] | np.ndarray
    """The line of the file each row ends in, or its number in a workbook, from 1."""
    separator: str = ""
    """What parts the cells; nothing in a workbook, whose rows end with their last filled cell."""
    comments: tuple[str, ...] = ()
    """Lines that a mark such as # or // makes comments, without the mark."""
    units: tuple[str, ...] = ()
    """Units that stood behind the numbers of each column, empty where none did; none beyond the last that had one."""
    notes: tuple[str, ...] = ()
    """What was decided on the way, for whoever reads the result."""
    acted: frozenset[str] = frozenset()
    """As of `Table`."""

    def noted(self, *notes: str) -> "Sheet":
        """The sheet with more notes."""
        return replace(self, notes=(*self.notes, *notes))


# How many columns a table may have, seen before its lines are parted into cells: of one line there may be millions.

MAX_COLUMNS = 20_000
"""A spreadsheet holds 16 384, motion capture of many bodies writes some thousand."""

MAX_MARKS = 3 * MAX_COLUMNS
"""Of one kind in a line: a number may have one before its thousands and one before its decimals, beside that behind it."""

_MARKS = ",;\t|"

_WORD = re.compile(r"\S+")


def too_wide(path: Path, line: int) -> FileError:
    """Error for a line with more columns than a table has."""
    return FileError(path, f"has more than {MAX_COLUMNS} columns; is it a table?", line=int(line))


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
            # no more words are counted than are needed
            words = sum(1 for _ in islice(_WORD.finditer(text, begin, end), MAX_COLUMNS + 1))
            if marks > MAX_MARKS or words > MAX_COLUMNS:
                raise too_wide(path, number)
        number += text.count("\n", begin, end + 1)
        begin = end + 1
