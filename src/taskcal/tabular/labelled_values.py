"""Logs that write every number behind its name: ``Cnt=1  X=-5907.204 Y=-4051.459 RotX= 1.530``."""

import re
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

from taskcal.tabular.footer import footer_note
from taskcal.tabular.lines import lines_of
from taskcal.tabular.packed_rows import pack, pack_numbered
from taskcal.tabular.sheet import Sheet

_PAIR = re.compile(
    r"(?<![\w.\[\]°/])([A-Za-z_][\w.\[\]°/]*+)\s*+[=:]\s*([+-]?(?:\d+(?:[.,]\d*)?|[.,]\d+)(?:[eE][+-]?\d+)?)(?=[\s,;]|$)",
    re.ASCII,
)

_SECTION = re.compile(
    r"\s*(?P<what>[^\W\d_]+)[ _.#:-]*(?P<number>\d+(?:[.-]\d+)*+\w*+)\s*+(?!=)[:.,;]?\s*(?P<remark>.*)$"
)
"""A line such as ``Pos 3`` that names what follows, and a remark behind the number."""

_LONGEST_TITLE = 300
"""Letters of a line that may name what follows; longer ones are text."""

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

    Sections begin with a line such as ``Pos 3``. Text behind the number is a remark where other lines begin with the same word.
    Other lines and remarks are left out, and listed in notes; the first lines are kept as comments, which may state units.
    """
    usual = Counter(
        tuple(name for name, _ in pairs) for line in lines_of(text) if len(pairs := _PAIR.findall(line)) >= MIN_LABELS
    ).most_common(1)[0][0]
    titles = _section_words(text)
    section, sectioned = "", False
    strays: list[tuple[int, str]] = []
    remarks: list[tuple[int, str]] = []

    def numbered() -> Iterator[tuple[int, tuple[str, ...]]]:
        nonlocal section, sectioned
        yield 0, ("id", *usual)
        for number, line in enumerate(lines_of(text), start=1):
            pairs = _PAIR.findall(line)
            titled = _titled(line)
            if tuple(name for name, _ in pairs) == usual:
                yield number, (section, *(value for _, value in pairs))
            elif titled and titled["what"].casefold() in titles:
                section, sectioned = titled["number"], True
                if titled["remark"]:
                    remarks.append((number, line.strip()))
            elif line.strip():
                strays.append((number, line.strip()))

    rows, lines = pack_numbered(numbered())
    if not sectioned:
        rows = pack(row[1:] for row in rows)
    notes: list[str] = []
    for found, said in (
        (strays, f"{len(strays)} line{'s' if len(strays) > 1 else ''} without {', '.join(usual[:3])} … are left out"),
        (remarks, "text behind the number of a header is left out"),
    ):
        if found:
            notes.append(f"{said}: {footer_note([line for line, _ in found], [(words,) for _, words in found])}")
    return Sheet(
        path=path,
        rows=rows,
        lines=(lines[1], *lines[1:]),
        separator="=",
        comments=tuple(line for _, line in strays[:_SAMPLED]),
        notes=tuple(notes),
    )


def _section_words(text: str) -> set[str]:
    """Words in small letters that begin the lines which name sections.

    With a number alone behind it a word is one; without such lines, the word that most lines with different numbers begin with.
    """
    titled = [match for line in lines_of(text) if (match := _titled(line))]
    plain = {match["what"].casefold() for match in titled if not match["remark"]}
    if plain:
        return plain
    numbers: dict[str, list[str]] = {}
    for match in titled:
        numbers.setdefault(match["what"].casefold(), []).append(match["number"])
    return {word for word, stood in numbers.items() if len(stood) > 1 and len(set(stood)) == len(stood)}


def _titled(line: str) -> re.Match[str] | None:
    """What a line says as a name of those below; None where it cannot be one."""
    if len(line) > _LONGEST_TITLE or len(_PAIR.findall(line)) >= MIN_LABELS:
        return None
    return _SECTION.match(line)
