"""Rows of cells as a file has them, before anyone says what they mean."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path


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
