"""Whether a comma in a number is its decimal mark or parts its thousands."""

import re
from collections.abc import Iterable
from pathlib import Path
from typing import Literal

from taskcal.errors import FileError, shown

DecimalMark = Literal[".", ","]

_COMMA_IS_DECIMAL = re.compile(
    r"[+-]?(?:\d*,(?:\d{1,2}|\d{4,})|\d{4,},\d+|0+,\d+|,\d+|\d{1,3}(?:\.\d{3})+,\d+|\d*,\d+e[+-]?\d+)", re.ASCII | re.I
)
"""No number with thousands parted by commas looks so: ``12,5``, ``1234,567``, ``0,123``, ``1.234,5``, ``1,5e3``."""

_COMMA_PARTS_THOUSANDS = re.compile(r"[+-]?(?:\d{1,3}(?:,\d{3})+\.\d*|\d{1,3}(?:,\d{3}){2,})", re.ASCII)
"""No number with a decimal comma looks so: ``-2,305.6424``, ``1,234,567``."""

_POINT_IS_DECIMAL = re.compile(r"[+-]?(?:\d*\.(?:\d{1,2}|\d{4,})|\d{4,}\.\d+|0+\.\d+|\.\d+)", re.ASCII)
"""No number with thousands parted by points looks so."""

_WITH_COMMA = re.compile(r"[+-]?[\d.]*(?:,\d*)+(?:\.\d*)?(?:e[+-]?\d+)?", re.ASCII | re.I)


def find_decimal_mark(path: Path, cells: Iterable[tuple[int, str]]) -> DecimalMark:
    """The decimal mark of a table, by all of its numbers.

    Args:
        path: of the file, for errors.
        cells: the cells that hold a comma or a point, each with its line.

    Raises:
        FileError: some cells can only be read with one mark and some only with the other, or a comma may be either.
    """
    comma: tuple[int, str] | None = None
    point: tuple[int, str] | None = None
    unsure: tuple[int, str] | None = None
    for line, cell in cells:
        if "," in cell:
            if _COMMA_IS_DECIMAL.fullmatch(cell):
                comma = comma or (line, cell)
            elif _COMMA_PARTS_THOUSANDS.fullmatch(cell):
                point = point or (line, cell)
            elif _WITH_COMMA.fullmatch(cell):
                unsure = unsure or (line, cell)
        elif point is None and _POINT_IS_DECIMAL.fullmatch(cell):
            point = (line, cell)
    if comma and point:
        line = max(comma[0], point[0])
        message = (
            f"'{shown(comma[1])}' in line {comma[0]} has a decimal comma, '{shown(point[1])}' in line {point[0]} a decimal "
            "point; write all with one of them"
        )
        raise FileError(path, message, line=line)
    if comma:
        return ","
    if unsure and not point:
        line, cell = unsure
        message = (
            f"'{shown(cell)}' may be {shown(cell.replace(',', '.'))} or {shown(cell.replace(',', ''))}, and no other number "
            "tells which; state the decimal mark, comma or point"
        )
        raise FileError(path, message, line=line)
    return "."


def with_point(cell: str, mark: DecimalMark) -> str:
    """A number's text with a decimal point and no parted thousands; any other text as it is."""
    if "," not in cell:
        return cell if mark == "." or not _POINTS_PART_THOUSANDS.fullmatch(cell) else cell.replace(".", "")
    if not _WITH_COMMA.fullmatch(cell):
        return cell
    if mark == ",":
        whole, _, rest = cell.rpartition(",")
        return cell if "," in whole else f"{whole.replace('.', '')}.{rest}"
    return cell.replace(",", "") if _PARTED.fullmatch(cell) else cell


_POINTS_PART_THOUSANDS = re.compile(r"[+-]?\d{1,3}(?:\.\d{3})+", re.ASCII)

_PARTED = re.compile(r"[+-]?\d{1,3}(?:,\d{3})+(?:\.\d*)?", re.ASCII)
