"""Rows that sum others up, which spreadsheets and instruments write below their tables."""

from collections.abc import Sequence
from dataclasses import replace

from taskcal.measurement.column_meaning import Meaning
from taskcal.tabular.footer import footer_note, is_statistic
from taskcal.tabular.layout import Laid


def without_summaries(laid: Laid, meanings: Sequence[Meaning | None]) -> Laid:
    """The table without rows whose id is the name of a statistic, such as ``Mean``; a note says which.

    Args:
        laid: the table.
        meanings: of its columns.
    """
    table = laid.table
    named = [k for k, meaning in enumerate(meanings) if meaning is not None and meaning.kind == "id"]
    summing = {row: cells[k] for row, cells in enumerate(table.rows) for k in named if is_statistic(cells[k])}
    if not summing:
        return laid
    kept = [row for row in range(len(table)) if row not in summing]
    listed = footer_note([table.lines[row] for row in summing], [(text,) for text in summing.values()])
    rest = replace(table, rows=tuple(table.rows[k] for k in kept), lines=tuple(table.lines[k] for k in kept))
    return replace(laid, table=rest, notes=(*laid.notes, f"rows that sum others up are left out: {listed}"))
