"""Columns of a file that a kind of observation reads, by the kind's own names for them."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from jaxtyping import Float, Int

from taskcal.errors import FileError, shown
from taskcal.tabular.table import Table


@dataclass(frozen=True, eq=False, kw_only=True)
class ObservedColumns:
    """The cells of such columns."""

    path: Path
    lines: Int[np.ndarray, " n"]
    """Of the file, from 1."""
    cells: Mapping[str, tuple[str, ...]]
    """As text, by the kind's name of the column."""
    headers: Mapping[str, str]
    """The file's name of each column."""
    scales: Mapping[str, float | None]
    """From the column's unit to metres; None where it states none."""

    def __contains__(self, column: str) -> bool:
        return column in self.cells

    def __len__(self) -> int:
        return len(self.lines)

    def texts(self, column: str) -> tuple[str, ...]:
        """The cells of a column; empty ones where there is no such column."""
        return self.cells.get(column, ("",) * len(self.lines))

    def lengths(self, column: str) -> Float[np.ndarray, " n"]:
        """The numbers of a column, metres; NaN for empty cells.

        Raises:
            FileError: a cell is not a number, or the column states no unit.
        """
        scale = self.scales[column]
        if scale is None:
            name = self.headers[column]
            raise FileError(self.path, f"the unit is not stated; name the column {name}_mm", line=1, column=name)
        return scale * self.numbers(column)

    def numbers(self, column: str) -> Float[np.ndarray, " n"]:
        """The numbers of a column as they stand; NaN for empty cells.

        Raises:
            FileError: a cell is not a number.
        """
        rows = tuple((text,) for text in self.cells[column])
        lines = tuple(int(line) for line in self.lines)
        table = Table(path=self.path, header=(self.headers[column],), rows=rows, lines=lines)
        return table.numbers(self.headers[column], empty=True)

    def error(self, message: str, row: int, column: str) -> FileError:
        """An error that points at a cell."""
        return FileError(self.path, message, line=int(self.lines[row]), column=self.headers.get(column, column))

    def refuse_without(self, column: str, present: np.ndarray, needs: str) -> None:
        """See that rows which have one thing have another.

        Raises:
            FileError: a row has no cell where it needs one.
        """
        for row in np.flatnonzero(present):
            if not self.texts(column)[row]:
                raise self.error(f"the cell is empty; {needs}", int(row), column)

    def take(self, rows: Int[np.ndarray, " k"]) -> "ObservedColumns":
        """Some of the rows."""
        cells = {name: tuple(texts[i] for i in rows) for name, texts in self.cells.items()}
        return replace(self, lines=self.lines[rows], cells=cells)

    def shown(self, column: str, row: int) -> str:
        """A cell, for a message."""
        return shown(self.cells[column][row])
