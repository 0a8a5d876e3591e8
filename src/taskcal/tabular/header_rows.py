"""Column names over two rows: groups, as of a reflector or of what was asked and what was measured, above the names in them."""

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from itertools import compress

from taskcal.tabular.packed_rows import pack_numbered
from taskcal.tabular.sheet import Sheet

_RULE = re.compile(
    r"[-=_+*~|:]{3,}|str|string|text|char|object|float(?:32|64)?|double|real|int(?:32|64)?|integer|number",
    re.IGNORECASE,
)
"""A line drawn below names, or the kinds of their values."""

LONGEST_GROUP = 200
"""Letters of a group's name that may end with its unit; longer ones are text."""

_BRACKETED = re.compile(r".*[\[(]\s*([^\[\]()]{1,12}?)\s*[\])]")


def without_rules(sheet: Sheet) -> Sheet:
    """A sheet without lines drawn between its rows, and without rows that say the kinds of values."""
    drawn = [bool(row) and all(not cell or _RULE.fullmatch(cell) for cell in row) for row in sheet.rows]
    if not any(drawn):
        return sheet
    kept = [not rule for rule in drawn]
    rows, lines = pack_numbered(compress(zip(sheet.lines, sheet.rows, strict=True), kept))
    return replace(sheet, rows=rows, lines=lines)


def group_units(above: Sequence[str], names: Sequence[str]) -> tuple[str, ...]:
    """The units that the groups of columns state in brackets, as in ``Position [mm]``; empty where a group states none."""
    return tuple(
        match[1] if len(group) <= LONGEST_GROUP and (match := _BRACKETED.fullmatch(group)) else ""
        for group in _groups(above, len(names))
    )


def _groups(above: Sequence[str], count: int) -> list[str]:
    """The group of every column: its own, or the one before it."""
    groups: list[str] = []
    for k in range(count):
        own = above[k] if k < len(above) else ""
        groups.append(own or (groups[-1] if groups else ""))
    return groups


def joined_names(above: Sequence[str], names: Sequence[str]) -> tuple[str, ...] | None:
    """Names of columns with those of their groups before them, where they need them; None where the row above has no part.

    A group's name stands over its first column and holds for the empty ones behind, as merged cells are written. It goes
    before names that stand several times, and takes the place of those that are empty.

    Args:
        above: the row above the names.
        names: of the columns.
    """
    times = Counter(name.casefold() for name in names if name)
    repeated = {k for k, name in enumerate(names) if times[name.casefold()] > 1}
    lacking = {k for k, name in enumerate(names) if not name and k < len(above) and above[k]}
    if not repeated and not lacking:
        return None
    groups = _groups(above, len(names))
    if any(not groups[k] for k in repeated):
        return None
    joined = tuple(
        f"{groups[k]} {name}" if k in repeated else name or (groups[k] if k in lacking else "")
        for k, name in enumerate(names)
    )
    return joined if len(set(filter(None, joined))) == sum(map(bool, joined)) else None
