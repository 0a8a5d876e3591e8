"""Motion capture as Motive exports it: a line of settings, then names, kinds and axes of the columns in rows of their own.

Source: OptiTrack's documentation of Motive's CSV export.
"""

from itertools import chain
from pathlib import Path

from taskcal.errors import FileError, shown
from taskcal.tables.table import Cells, Sheet
from taskcal.tables.text import quoted_rows

_UNITS = {"millimeters": "mm", "centimeters": "cm", "meters": "m"}


def is_motion_capture(text: str) -> bool:
    """Whether a text begins as such an export does."""
    return text.startswith("Format Version,")


def parse_motion_capture(path: Path, text: str) -> Sheet:
    """A row for every frame; bodies' poses as ``NAME_x_mm … NAME_qw``, markers' positions as ``NAME_x_mm …``.

    Raises:
        FileError: rotations are not quaternions, the unit is not stated, or the rows of names are not as they should be.
    """
    rows, lines = Cells.numbered((line, tuple(row)) for line, row in quoted_rows(path, text, ","))
    settings = dict(zip(rows[0][::2], rows[0][1::2], strict=False))
    unit = _UNITS.get(settings.get("Length Units", "").casefold())
    if unit is None:
        raise FileError(path, f"states no unit of length that is known; known: {', '.join(_UNITS)}", line=1)
    if settings.get("Rotation Type", "Quaternion") != "Quaternion":
        message = f"has rotations as {shown(settings['Rotation Type'])}; export them as quaternions"
        raise FileError(path, message, line=1)
    axes_at = next((k for k, row in enumerate(rows) if row and row[0].strip().casefold() == "frame"), None)
    heads = _heads([row for row in rows[1 : axes_at or 0] if any(row)])
    if axes_at is None or axes_at < 2 or not {"type", "name"} <= heads.keys():
        raise FileError(path, "begins as an export of Motive, but lacks its rows of types, names and axes", line=1)
    axes, kinds = rows[axes_at], rows[axes_at - 1]
    header = tuple(_column(k, heads, kinds, axes, unit) for k in range(len(axes)))
    below = zip(lines[axes_at + 1 :], rows[axes_at + 1 :], strict=True)
    body = ((line, tuple(cell.strip() for cell in row)) for line, row in below if any(row))
    rows, lines = Cells.numbered(chain([(lines[axes_at], header)], body))
    return Sheet(path=path, rows=rows, lines=lines, separator=",")


def _heads(rows: list[tuple[str, ...]]) -> dict[str, tuple[str, ...]]:
    """Rows above the axes by what they hold; Motive 2 and before write types and names first, and do not say so."""
    told = {row[1].strip().casefold(): row for row in rows if len(row) > 2 and row[1].strip()}
    return told or dict(zip(("type", "name"), rows, strict=False))


def _column(k: int, heads: dict[str, tuple[str, ...]], kinds: tuple[str, ...], axes: tuple[str, ...], unit: str) -> str:
    """A column's name from its type, name, kind and axis."""

    def cell(row: tuple[str, ...]) -> str:
        return row[k].strip() if k < len(row) else ""

    if k < 2:
        # the frame and its time
        return axes[k].strip()
    name = "_".join(cell(heads["name"]).replace(":", " ").split())
    kind, axis = cell(kinds).casefold(), cell(axes)
    if kind == "rotation":
        return f"{name}_q{axis.lower()}"
    if kind == "position":
        return f"{name}_{axis.lower()}_{unit}"
    return "_".join(filter(None, (name, kind.replace(" ", "_"), axis))) or f"column {k + 1}"
