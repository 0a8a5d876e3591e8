"""Units behind the numbers in the cells, as in ``31,4°`` or ``812.5 mm``."""

import re
from collections import Counter
from dataclasses import replace

from taskcal.tabular.packed_rows import pack
from taskcal.tabular.sheet import Sheet

_MEASURED = re.compile(
    r"([+-]?(?:\d[\d.,]*|[.,]\d+)(?:e[+-]?\d+)?)\s*(°|deg|grad|gon|m?rad|[mcuµ]?m|in|inch|ft|°c)",
    re.ASCII | re.IGNORECASE,
)

_MOST = 0.8
"""Share of a column's cells with digits first that have one unit, where it is the column's."""

_BEGINS_A_NUMBER = re.compile(r"[+-]?[.,]?\d", re.ASCII)


def with_units_apart(sheet: Sheet) -> Sheet:
    """A sheet in which the unit that most cells of a column have behind their numbers is the column's.

    Cells of that column in another unit stay as they are, and are no numbers.
    """
    last = sheet.rows[-min(len(sheet.rows), 20) :]
    columns = {k for row in last for k, cell in enumerate(row) if _MEASURED.fullmatch(cell)}
    units = {k: unit for k in columns if (unit := _common_unit(sheet, k))}
    if not units:
        return sheet
    rows = pack(
        tuple(_number(cell, units[k]) if k in units else cell for k, cell in enumerate(row)) for row in sheet.rows
    )
    return replace(sheet, rows=rows, units=tuple(units.get(k, "") for k in range(max(units) + 1)))


def _common_unit(sheet: Sheet, column: int) -> str:
    """The unit that most cells of a column have; empty where there is none."""
    cells = (row[column] for row in sheet.rows if len(row) > column and _BEGINS_A_NUMBER.match(row[column]))
    units = Counter(match and match[2].casefold() for match in map(_MEASURED.fullmatch, cells))
    common = max(filter(None, units), key=units.__getitem__)
    return common if units[common] >= _MOST * units.total() else ""


def _number(cell: str, unit: str) -> str:
    match = _MEASURED.fullmatch(cell)
    return match[1] if match and match[2].casefold() == unit else cell
