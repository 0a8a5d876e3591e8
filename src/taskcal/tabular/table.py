"""A table of cells whose errors name file, line, column and value, whatever form of file it comes from."""

import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from jaxtyping import Float

from taskcal.errors import FileError, shown
from taskcal.tabular.faults import Faults
from taskcal.tabular.packed_rows import column_of

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
