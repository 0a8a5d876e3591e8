"""Remarks on many places of a program, as few lines: each reason once, with how often and where first."""

import os
import re
from collections.abc import Iterable
from pathlib import Path

from taskcal.programs.source import Place

SHOWN = 3
"""Places that are named of each reason beside the first."""

_DIFFERENT = re.compile(
    r"\w+(?= stays as it is)"
    r"|'[^']*'"
    r"|[^\s:']+\.\w+:\d+"
    r"|[$A-Z][$A-Z0-9_]+(?:\[[^\]]*\])?(?!\w)"
    r"|[-+]?\d+(?:\.\d+)?"
)
"""What differs between remarks of one reason: motions, names in quotes, places, names in capitals as KRL has them, and numbers."""


def group_remarks(remarks: Iterable[tuple[Place, str]]) -> list[str]:
    """A line for each reason, in the order in which the reasons come up.

    Remarks that differ in names, places and numbers only have one reason; the line gives the first of them. Places in the texts are
    named from the folder that all files have in common.

    Args:
        remarks: places and texts.
    """
    remarks = list(remarks)
    among = _common_folder(place.path for place, _ in remarks) if remarks else None
    groups: dict[str, list[tuple[Place, str]]] = {}
    for place, text in remarks:
        short = text if among in (None, Path()) else text.replace(f"{among}{os.sep}", "")
        groups.setdefault(_DIFFERENT.sub("#", short), []).append((place, short))
    return [_line(group) for group in groups.values()]


def _line(group: list[tuple[Place, str]]) -> str:
    (first, text), *_ = group
    _, *others = dict.fromkeys(place for place, _ in group)
    if len(group) == 1:
        return f"{first}: {text}"
    if not others:
        return f"{first}: {text} ({len(group)} times)"
    among = _common_folder(place.path for place, _ in group)
    places = [
        f"{place.line}" if place.path == first.path else f"{_from(among, place.path)}:{place.line}"
        for place in others[:SHOWN]
    ]
    more = f"and {len(others) - SHOWN} more" if len(others) > SHOWN else ""
    at = ", ".join([*places, *([more] if more else [])])
    return f"{first}: {text} ({len(group)} times; also in {'line' if others[0].path == first.path else 'file'} {at})"


def _common_folder(paths: Iterable[Path]) -> Path | None:
    """The folder that holds all of some files; None where there is none."""
    folders = [path.parent for path in paths]
    above = (folders[0], *folders[0].parents)
    return next((folder for folder in above if all(other.is_relative_to(folder) for other in folders)), None)


def _from(folder: Path | None, path: Path) -> Path:
    return path if folder is None else path.relative_to(folder)
