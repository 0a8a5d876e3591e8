"""How many columns a table may have, seen before its lines are parted into cells: of one line there may be millions."""

import re
from itertools import islice
from pathlib import Path

from taskcal.errors import FileError

MAX_COLUMNS = 20_000
"""A spreadsheet holds 16 384, motion capture of many bodies writes some thousand."""

MAX_MARKS = 3 * MAX_COLUMNS
"""Of one kind in a line: a number may have one before its thousands and one before its decimals, beside that behind it."""

_MARKS = ",;\t|"

_WORD = re.compile(r"\S+")


def too_wide(path: Path, line: int) -> FileError:
    """What is said of a line that no table has."""
    return FileError(path, f"has more than {MAX_COLUMNS} columns; is it a table?", line=line)


def refuse_wide(path: Path, text: str) -> None:
    """See that no line would be parted into far more cells than a table has.

    Raises:
        FileError: one would.
    """
    begin, number = 0, 1
    while begin < len(text):
        # most lines are far shorter: as many characters at once as have too few marks, up to the end of a line
        end = text.rfind("\n", begin, begin + MAX_MARKS)
        if end < 0:
            end = text.find("\n", begin)
            end = len(text) if end < 0 else end
            marks = max(text.count(mark, begin, end) for mark in _MARKS)
            if marks > MAX_MARKS or _words(text, begin, end) > MAX_COLUMNS:
                raise too_wide(path, number)
        number += text.count("\n", begin, end + 1)
        begin = end + 1


def _words(text: str, begin: int, end: int) -> int:
    """Between blanks; no more are counted than are needed."""
    return sum(1 for _ in islice(_WORD.finditer(text, begin, end), MAX_COLUMNS + 1))
