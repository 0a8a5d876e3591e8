"""Units that a file states above its table, as in ``// Units: Millimeters``."""

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from taskcal.measurement.units import ANGLES, LENGTHS, UNITS

_LONGEST_LINE = 300
_MOST_LINES = 200
"""Above a table, that may state units."""

_UNITS_LINE = re.compile(r"\b(?:units?|einheit(?:en)?)\b(?P<rest>.*)", re.IGNORECASE)
_VALUES_IN = re.compile(
    r"\b(?:values?|coordinates?|positions?|lengths?|distances?|points?|dimensions?|joints?|angles?|axes|x,? ?y,? ?z"
    r"|[ajq]\d|werte|koordinaten|winkel|längen|maße)\b\W*"
    r"(?:(?:(?:are|all|alle|sind)\W+)*(?:in\s+|[(\[])\s*|(?:(?:are|all|alle|sind)\W+)+)(?P<unit>[a-zµ°]+)",
    re.IGNORECASE,
)
_WORD = re.compile(r"[a-zµ°]+", re.IGNORECASE)


@dataclass(frozen=True, kw_only=True)
class StatedUnits:
    """Units that hold for all columns without one."""

    length: str | None
    angle: str | None
    where: str
    """The lines that say so."""


def stated_units(preamble: Sequence[str]) -> StatedUnits:
    """The unit of length and that of angle that the lines above a table state; None where none does, or two differ."""
    named: set[str] = set()
    said: list[str] = []
    for line in preamble[:_MOST_LINES]:
        units = set(_units_of(line)) if len(line) <= _LONGEST_LINE else set()
        if units:
            named |= units
            said.append(line.strip())
    lengths, angles = named & LENGTHS.keys(), named & ANGLES.keys()
    return StatedUnits(
        length=min(lengths) if len(lengths) == 1 else None,
        angle=min(angles) if len(angles) == 1 else None,
        where="; ".join(said[:2]),
    )


def _units_of(line: str) -> Iterable[str]:
    """Units of length and of angle that a line states."""
    match = _UNITS_LINE.search(line)
    if match:
        rest = re.sub(r"^.*?[:=]", "", match["rest"])
        words = _WORD.findall(re.sub(r"^\s*(?:are\s+)?in\s+(?=\S)", "", rest).casefold())
        # between other units it is a word of the sentence
        words = words if len(words) == 1 else [word for word in words if word != "in"]
    else:
        words = [found["unit"].casefold() for found in _VALUES_IN.finditer(line)]
    return [UNITS[word] for word in words if UNITS.get(word) in {*LENGTHS, *ANGLES}]
