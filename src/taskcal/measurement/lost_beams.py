"""What instruments and programs write in place of a point that they did not see."""

import re
from collections.abc import Sequence
from dataclasses import replace

from taskcal.errors import shown
from taskcal.tabular.packed_rows import with_columns
from taskcal.tabular.table import Table

_LOST = re.compile(
    r"nan|nil|none|null|n/?a|#n/a|#nv|#value!|-+|–|—|\?+|\*+|inf|lost|no data|beam lost|invalid|[+-]?9{4,}(?:\.[09]*)?",
    re.ASCII | re.IGNORECASE,
)
"""All three cells of a target are the same."""


_FLAG = ("valid", "is valid", "visible", "tracked", "measured ok", "point ok", "gültig", "gueltig")
_YES = frozenset({"1", "true", "yes", "y", "ja", "j", "ok", "valid", "x", "wahr", "1.0", "checked"})
_NO = frozenset({"0", "false", "no", "n", "nein", "nok", "nio", "invalid", "falsch", "0.0", "unchecked"})


def is_lost(cell: str) -> bool:
    """Whether a cell is empty, or holds what stands for a lost beam."""
    return not cell or _LOST.fullmatch(cell) is not None


def rows_not_valid(table: Table) -> tuple[list[int], tuple[str, ...]]:
    """Rows that a column such as ``valid`` calls not valid, and a note of them."""
    for name in table.header:
        if " ".join(name.casefold().replace("_", " ").split()) not in _FLAG:
            continue
        said = [text.casefold() for text in table.texts(name)]
        rows = [row for row, text in enumerate(said) if text in _NO]
        if rows and set(said) <= _YES | _NO:
            lines = ", ".join(str(table.lines[row]) for row in rows[:5]) + (", …" if len(rows) > 5 else "")
            return rows, (f"what was measured is taken for lost where '{shown(name, 40)}' says so (line {lines})",)
    return [], ()


def without_lost(table: Table, columns: Sequence[str]) -> tuple[Table, tuple[str, ...]]:
    """A table whose cells of a target are empty where all three hold one word, or the nines, for a beam that was lost.

    Args:
        table: the cells.
        columns: of the target's axes.

    Returns:
        The table, and a note of what was taken for a lost beam.
    """
    axes = [table.header.index(column) for column in columns]
    by_axis = [table.texts(column) for column in columns]
    lost = {
        row: cells[0]
        for row, cells in enumerate(zip(*by_axis, strict=True))
        if cells[0] and len(set(cells)) == 1 and _LOST.fullmatch(cells[0])
    }
    if not lost:
        return table, ()
    for cells in by_axis:
        for row in lost:
            cells[row] = ""
    rows = with_columns(table.rows, dict(zip(axes, by_axis, strict=True)))
    words = ", ".join(f"'{shown(word, 20)}'" for word in dict.fromkeys(lost.values()))
    lines = ", ".join(str(table.lines[row]) for row in list(lost)[:5]) + (", …" if len(lost) > 5 else "")
    return replace(table, rows=rows), (f"{words} for {columns[0]} … is taken for a lost beam (line {lines})",)
