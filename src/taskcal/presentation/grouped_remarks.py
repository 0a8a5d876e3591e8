"""Remarks on many places of a program, as few lines: each reason once, with how often and where first."""

import re
from collections.abc import Iterable

from taskcal.programs.source import Place

SHOWN = 3
"""Places that are named of each reason beside the first."""

_DIFFERENT = re.compile(r"'[^']*'|[-+]?\d+(?:\.\d+)?")
"""What differs between remarks of one reason: names in quotes, and numbers."""


def group_remarks(remarks: Iterable[tuple[Place, str]]) -> list[str]:
    """A line for each reason, in the order in which the reasons come up.

    Remarks that differ in names and numbers only have one reason; the line gives the first of them.

    Args:
        remarks: places and texts.
    """
    groups: dict[str, list[tuple[Place, str]]] = {}
    for place, text in remarks:
        groups.setdefault(_DIFFERENT.sub("#", text), []).append((place, text))
    return [_line(group) for group in groups.values()]


def _line(group: list[tuple[Place, str]]) -> str:
    (first, text), *others = group
    if not others:
        return f"{first}: {text}"
    places = [f"{place.line}" if place.path == first.path else f"{place}" for place, _ in others[:SHOWN]]
    more = f"and {len(others) - SHOWN} more" if len(others) > SHOWN else ""
    at = ", ".join([*places, *([more] if more else [])])
    return f"{first}: {text} ({len(group)} times; also in {'line' if others[0][0].path == first.path else 'file'} {at})"
