"""Names for the columns of a file that has none, where their number and their cells leave one reading."""

import re
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float

from taskcal.errors import FileError, shown
from taskcal.reading.joints import within_limits
from taskcal.reading.positions import is_lost
from taskcal.robot.robot import Robot
from taskcal.tables.table import ANGLES, LENGTHS, NUMBER, Table

_COUNT = re.compile(r"\d{1,9}", re.ASCII)

_NAMES = ("collection", "group", "id")
"""Of points, the outermost first, as SpatialAnalyzer writes them."""

_SAMPLED = 500
"""Rows that tell numbers from texts. A convention that bounds the time."""

_COMPARED, _COMPARED_COLUMNS = 40, 200
"""Rows, and columns of numbers, in which a second block of positions is looked for."""

_ALIKE = 0.8
"""Correlation at least of the distances between points of two blocks that may be the same points, in any frames and units. A
convention: angles and uncertainties stay below."""

_NEAR = 0.1
"""Distance of two blocks over the scatter of one, at most, where they are the same points in one frame. A convention."""


def name_columns(table: Table, robot: Robot) -> Table:
    """The table with names: as it has them, or an id, the robot's joints and a position, as many of these as it has columns.

    A first column of whole numbers or words is the id where the rest has a reading. Several columns of words are the collection,
    group and name of a point, but for those with one word throughout. Words behind the numbers, such as a date, are left out.
    What was decided is noted.

    Raises:
        FileError: it names no columns, and they can be read in no way, or in several.
    """
    if any(table.header):
        return table
    table = _without_numbering(table)
    width, joints, position = len(table.header), list(robot.joint_names), ["x", "y", "z"]
    readings = {len(joints): joints, 3: position, len(joints) + 3: [*joints, *position]}
    leading, numbers = _words_and_numbers(table)
    names = _names_of_words([[row[k] for row in table.rows] for k in range(leading)])
    counts = numbers > 0 and all(_COUNT.fullmatch(row[leading]) for row in table.rows)
    options: list[list[str]] = []
    if counts and numbers - 1 in readings and len(names) < len(_NAMES) and not (names and _whole(table, leading)):
        options.append([*_with_count(names), *readings[numbers - 1]])
    if numbers in readings and not (options and counts):
        options.append([*names, *readings[numbers]])
    if (
        names
        and not options
        and not counts
        and numbers > 3
        and not _may_begin_with_joints(table, robot, leading, numbers)
    ):
        options.append([*names, *position, *["-"] * (numbers - 3)])
    if len(options) != 1 or (names and "id" not in options[0]):
        example = shown(" ".join(table.rows[0]), 60)
        message = (
            f"names no columns, and its {width} columns (line {table.lines[0]}: {example}) are not the {len(joints)} joints of "
            f'{robot.name}, a position, or both; name them: --columns "{" ".join(["id", *joints, "x_mm", "y_mm", "z_mm"])}"'
        )
        raise FileError(table.path, message)
    (own,) = options
    named = [*own, *["-"] * (width - len(own))]
    _refuse_two_blocks(table, named, leading, numbers)
    header = tuple(name if name != "-" else f"column {k}" for k, name in enumerate(named, start=1))
    note = f"the file names no columns; they are read as {' '.join(named)} (--columns states others)"
    return replace(table, header=header).noted(note)


def _may_begin_with_joints(table: Table, robot: Robot, first: int, count: int) -> bool:
    """Whether joints and a position may come first of more numbers: within the robot's limits, in degrees or radians."""
    width = len(robot.joints)
    if count <= width + 3:
        return False
    rows = [row[first : first + width] for row in table.rows]
    q = np.array([[float(cell) for cell in row] for row in rows if all(map(NUMBER.fullmatch, row))])
    in_degrees = q * np.where(robot.prismatic, LENGTHS["mm"], ANGLES["deg"])
    return len(q) > 0 and not robot.outside_limits(within_limits(robot, in_degrees)[0])


def _without_numbering(table: Table) -> Table:
    """Without a first row that only numbers the columns, as programs write that know no names."""
    width = len(table.header)
    numbering = [tuple(str(k + first) for k in range(width)) for first in (0, 1)]
    if width < 3 or len(table) < 2 or table.rows[0] not in numbering:
        return table
    note = f"line {table.lines[0]} numbers the columns, and is left out"
    return table.take(slice(1, None)).noted(note)


def _words_and_numbers(table: Table) -> tuple[int, int]:
    """Number of leading columns of words, with counts between them, and of the columns of numbers that follow.

    A first column with a word in it is one of words, any other where most of its cells are.
    """
    rows = table.rows
    sample = rows[:_SAMPLED]
    words = [
        2 * sum(not (NUMBER.fullmatch(row[k]) or is_lost(row[k])) for row in sample) > len(sample)
        for k in range(len(table.header))
    ]
    words[0] = not all(NUMBER.fullmatch(row[0]) for row in rows)
    leading = words.index(False) if False in words else len(words)
    block = next((k for k in range(len(words) - 2) if not any(words[k : k + 3])), leading)
    if all(words[k] or all(_COUNT.fullmatch(row[k]) for row in rows) for k in range(block)):
        leading = block
    rest = words[leading:]
    return leading, rest.index(True) if True in rest else len(rest)


def _names_of_words(columns: Sequence[Sequence[str]]) -> list[str]:
    """Names of the columns of words: ``-`` where one word stands throughout and another column tells rows apart."""
    told = [k for k, cells in enumerate(columns) if len(set(cells)) > 1] or [*range(len(columns))][-1:]
    if len(told) > len(_NAMES):
        return ["-"] * len(columns)
    names = dict(zip(told, _NAMES[len(_NAMES) - len(told) :], strict=True))
    return [names.get(k, "-") for k in range(len(columns))]


def _with_count(names: Sequence[str]) -> list[str]:
    """Names of columns of words with a count of points behind them."""
    outer = iter(_NAMES[len(_NAMES) - 1 - sum(name != "-" for name in names) :])
    return [*(name if name == "-" else next(outer) for name in names), "id"]


def _whole(table: Table, first: int) -> bool:
    """Whether three columns behind one hold whole numbers only, so that any of the four may be a count."""
    return all(_COUNT.fullmatch(cell) for row in table.rows[:_SAMPLED] for cell in row[first + 1 : first + 4])


def _refuse_two_blocks(table: Table, named: Sequence[str], first: int, count: int) -> None:
    """See that only one block of three columns can be the measured position."""
    step = max(1, len(table) // _COMPARED)
    rows = [row[first : first + min(count, _COMPARED_COLUMNS)] for row in table.rows[::step]]
    values = np.array([[float(cell) for cell in row] for row in rows if all(map(NUMBER.fullmatch, row))])
    # joints move in step with one another wherever a robot passes through its poses
    blocks = _two_blocks(values, positions=named[first] == "x") if len(values) and count > 5 else None
    if blocks is None:
        return
    one, other = (first + start + 1 for start in blocks)
    second = [f"{name}_mm" for name in "xyz"]
    example = [*["id"] * (first > 0), *["-"] * (other - 1 - (first > 0)), *second, *["-"] * (len(named) - other - 2)]
    message = (
        f"names no columns, and columns {one} to {one + 2} and columns {other} to {other + 2} "
        f"({shown(' '.join(table.rows[0]), 60)}) could both be the measured position; write a line of names above the table, "
        f'or state them: --columns "{" ".join(example)}" takes the second'
    )
    raise FileError(table.path, message, line=int(table.lines[0]))


def _two_blocks(values: Float[np.ndarray, "rows columns"], *, positions: bool) -> tuple[int, int] | None:
    """First columns of two blocks of three that may both be the measured position; None where there are none.

    They hold the same points, asked and measured, or two targets of one tool; or a later block scatters more than the first.

    Args:
        values: the numbers.
        positions: whether the first three are read as positions. Joints may move in step with one another, and only blocks that
            are the same points in one frame are then two.
    """
    starts = range(values.shape[1] - 2)
    blocks = [values[:, start : start + 3] for start in starts]
    scatter = [_size(block) for block in blocks]
    first, second = np.triu_indices(len(values), 1)
    apart = [np.linalg.norm(block[first] - block[second], axis=1) for block in blocks]
    for one in starts:
        alike: dict[int, float] = {}
        for other in starts[one + 3 :]:
            if scatter[one] > 0.0 and scatter[other] > 0.0:
                distance = float(np.sqrt(np.mean(np.sum((blocks[other] - blocks[one]) ** 2, axis=1))))
                near = distance < _NEAR * scatter[one]
                alike[other] = 1.0 if near else _correlation(apart[one], apart[other]) if positions else 0.0
        if alike and max(alike.values()) > _ALIKE:
            return one, max(alike, key=alike.__getitem__)
    wider = [start for start in starts[3::3] if scatter[start] > scatter[0]]
    return (0, wider[0]) if positions and wider else None


def _size(block: Float[np.ndarray, "rows 3"]) -> float:
    """Scatter of points; of a single one its distance from zero."""
    return float(np.linalg.norm(block.std(axis=0) if len(block) > 1 else block))


def _correlation(first: Float[np.ndarray, " pairs"], second: Float[np.ndarray, " pairs"]) -> float:
    """Correlation of distances; 0 for too few."""
    if len(first) < 6 or first.std() == 0.0 or second.std() == 0.0:
        return 0.0
    return float(np.corrcoef(first, second)[0, 1])
