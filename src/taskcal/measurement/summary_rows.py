"""Rows that sum others up, which spreadsheets and instruments write below their tables."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import compress

from taskcal.measurement.column_meaning import Meaning
from taskcal.tabular.footer import footer_note, is_statistic
from taskcal.tabular.layout import Laid
from taskcal.tabular.packed_rows import pack_numbered


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
    kept = [row not in summing for row in range(len(table))]
    listed = footer_note([table.lines[row] for row in summing], [(text,) for text in summing.values()])
    rows, lines = pack_numbered(compress(zip(table.lines, table.rows, strict=True), kept))
    rest = replace(table, rows=rows, lines=lines)
    return replace(laid, table=rest, notes=(*laid.notes, f"rows that sum others up are left out: {listed}"))
