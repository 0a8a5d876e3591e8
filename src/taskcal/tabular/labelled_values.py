"""Logs that write every number behind its name: ``Cnt=1  X=-5907.204 Y=-4051.459 RotX= 1.530``."""

import re
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

from taskcal.tabular.lines import lines_of
from taskcal.tabular.packed_rows import pack, pack_numbered
from taskcal.tabular.sheet import Sheet

_PAIR = re.compile(
    r"(?<![\w.\[\]°/])([A-Za-z_][\w.\[\]°/]*+)\s*+[=:]\s*([+-]?(?:\d+(?:[.,]\d*)?|[.,]\d+)(?:[eE][+-]?\d+)?)(?=[\s,;]|$)",
    re.ASCII,
)

_SECTION = re.compile(r"\s*(?P<what>[^\W\d_]+)[ _.#:-]*(?P<number>\d+)\s*:?\s*$")
"""A line such as ``Pos 3`` that names what follows."""

_SAMPLED = 200
MIN_LABELS = 3
"""Of one line; a preamble has one or two."""


def has_labelled_values(text: str) -> bool:
    """Whether most lines write at least three numbers, each behind its name."""
    lines = [line for line in text.split("\n", _SAMPLED)[:_SAMPLED] if line.strip()]
    labelled = sum(len(_PAIR.findall(line[:2000])) >= MIN_LABELS for line in lines)
    return labelled > 0 and 2 * labelled >= len(lines)


def parse_labelled_values(path: Path, text: str) -> Sheet:
    """A row for every line with the names that most lines have, and a first column for the section it stands in.

    Lines without these names are left out, and counted in a note; they are kept as comments, which may state units.
    """
    usual = Counter(
        tuple(name for name, _ in pairs) for line in lines_of(text) if len(pairs := _PAIR.findall(line)) >= MIN_LABELS
    ).most_common(1)[0][0]
    section, sectioned, count = "", False, 0
    strays: list[str] = []

    def numbered() -> Iterator[tuple[int, tuple[str, ...]]]:
        nonlocal section, sectioned, count
        yield 0, ("id", *usual)
        for number, line in enumerate(lines_of(text), start=1):
            pairs = _PAIR.findall(line)
            titled = _SECTION.match(line)
            if tuple(name for name, _ in pairs) == usual:
                yield number, (section, *(value for _, value in pairs))
            elif titled:
                section, sectioned = titled["number"], True
            elif line.strip():
                count += 1
                if count <= _SAMPLED:
                    strays.append(line.strip())

    rows, lines = pack_numbered(numbered())
    if not sectioned:
        rows = pack(row[1:] for row in rows)
    notes = (f"{count} line{'s' if count > 1 else ''} without {', '.join(usual[:3])} … are left out",) if count else ()
    return Sheet(path=path, rows=rows, lines=(lines[1], *lines[1:]), separator="=", comments=tuple(strays), notes=notes)
