"""A form of table: the listing of an instrument, in columns of a fixed width under a ruler of hyphens."""

import re
from pathlib import Path

from taskcal import FileError
from taskcal.tables import Sheet, TextForm

RULER = re.compile(r" *-+( +-+)+ *")


def read_lst(path: Path, text: str, form) -> Sheet:
    """Cells below and above the ruler, cut where its hyphens end."""
    rows, lines = [], text.split("\n")
    ruler = next(k for k, line in enumerate(lines) if RULER.fullmatch(line))
    cuts = [match.span() for match in re.finditer("-+", lines[ruler])]
    if not ruler:
        raise FileError(path, "has no line with the names of its columns above the hyphens", line=1)
    numbered = [(ruler, lines[ruler - 1]), *enumerate(lines[ruler + 1 :], start=ruler + 2)]
    for number, line in numbered:
        if len(line.rstrip()) > cuts[-1][1]:
            raise FileError(
                path, f"goes on beyond the last column, which ends with character {cuts[-1][1]}", line=number
            )
        if line.strip():
            rows.append((number, tuple(line[start:end].strip() for start, end in cuts)))
    return Sheet(path=path, rows=[row for _, row in rows], lines=[number for number, _ in rows])


def is_lst(path: Path, text: str) -> bool:
    """Whether a file ends in .lst and has a ruler."""
    return path.suffix.lower() == ".lst" and any(RULER.fullmatch(line) for line in text.split("\n"))


LST = TextForm(name="listing", suffixes=(".lst",), holds=is_lst, read=read_lst)
