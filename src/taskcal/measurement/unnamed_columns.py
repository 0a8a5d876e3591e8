"""Names for the columns of a file that has none, where their number and their cells leave one reading."""

import re
from dataclasses import replace

from taskcal.errors import FileError, shown
from taskcal.robot.robot import Robot
from taskcal.tabular.layout import Laid

_COUNT = re.compile(r"\d{1,9}", re.ASCII)
_NUMBER = re.compile(r"[+-]?(\d+(?:\.\d*)?|\.\d+)(e[+-]?\d+)?", re.ASCII | re.IGNORECASE)


def name_columns(laid: Laid, robot: Robot) -> Laid:
    """The table with names: as it has them, or an id, the robot's joints and a position, as many of these as it has columns.

    A first column of whole numbers or words is the id where the rest has a reading. What was decided is noted.

    Raises:
        FileError: it names no columns, and they can be read in no way, or in several.
    """
    if any(laid.table.header):
        return laid
    laid = _without_numbering(laid)
    table = laid.table
    width = len(table.header)
    joints, position = list(robot.joint_names), ["x", "y", "z"]
    readings = {len(joints): joints, 3: position, len(joints) + 3: [*joints, *position]}
    first = [row[0] for row in table.rows]
    words = not all(_NUMBER.fullmatch(text) for text in first)
    counts = all(_COUNT.fullmatch(text) for text in first)
    options = [["id", *readings[width - 1]]] if (words or counts) and width - 1 in readings else []
    if not words and width in readings and not (options and counts):
        options.append(readings[width])
    if words and not options and width > 4 and _three_numbers(laid):
        options.append(["id", *position, *["-"] * (width - 4)])
    if len(options) != 1:
        example = shown(" ".join(table.rows[0]), 60)
        message = (
            f"names no columns, and its {width} columns (line {table.lines[0]}: {example}) are not the {len(joints)} joints of "
            f'{robot.name}, a position, or both; name them: --columns "{" ".join(["id", *joints, "x_mm", "y_mm", "z_mm"])}"'
        )
        raise FileError(table.path, message)
    named = options[0]
    header = tuple(name if name != "-" else f"column {k}" for k, name in enumerate(named, start=1))
    note = f"the file names no columns; they are read as {' '.join(named)} (--columns states others)"
    return replace(laid, table=replace(table, header=header), notes=(*laid.notes, note))


def _without_numbering(laid: Laid) -> Laid:
    """Without a first row that only numbers the columns, as programs write that know no names."""
    table = laid.table
    width = len(table.header)
    numbering = [tuple(str(k + first) for k in range(width)) for first in (0, 1)]
    if width < 3 or len(table) < 2 or table.rows[0] not in numbering:
        return laid
    note = f"line {table.lines[0]} numbers the columns, and is left out"
    rest = replace(table, rows=table.rows[1:], lines=table.lines[1:])
    return replace(laid, table=rest, notes=(*laid.notes, note))


def _three_numbers(laid: Laid) -> bool:
    """Whether the three columns behind the first hold numbers only."""
    return all(_NUMBER.fullmatch(cell) for row in laid.table.rows for cell in row[1:4])
