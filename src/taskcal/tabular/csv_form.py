"""Tables in CSV: fields separated by commas, semicolons or tabs."""

import csv
import io
import re
from collections import Counter
from pathlib import Path

from taskcal.errors import FileError, shown
from taskcal.tabular.table import Table
from taskcal.text_file import read_text

_SEPARATOR_LINE = re.compile(r"\Asep=.[ \t]*(?=\r?\n)", re.IGNORECASE)
"""What a spreadsheet writes first to say how it separates; the header says the same."""


def read_csv(path: str | Path) -> Table:
    """Read a table with a header line; fields separated by commas, semicolons or tabs; lines after # are comments.

    Raises:
        FileError: the file is missing, is not text, has no rows, or a line has more or fewer fields than the header.
    """
    path = Path(path)
    text = read_text(path, encoding="utf-8-sig", otherwise="is not UTF-8 text; save it as CSV in UTF-8")
    return parse_csv(path, text)


def parse_csv(path: Path, text: str) -> Table:
    """The table that a file's text holds.

    Raises:
        FileError: as `read_csv`, for the file named.
    """
    text = _SEPARATOR_LINE.sub("", text, count=1)
    if "\0" in text:
        raise FileError(path, "is a binary file; export it as CSV")
    delimiter = delimiter_of(text)
    reader = csv.reader(io.StringIO(text), delimiter=delimiter)
    rows: list[tuple[str, ...]] = []
    lines: list[int] = []
    header: tuple[str, ...] | None = None
    try:
        for cells in reader:
            stripped = tuple(cell.strip() for cell in cells)
            if not any(stripped) or stripped[0].startswith("#"):
                continue
            if header is None:
                header = stripped
                continue
            if len(stripped) != len(header):
                hint = (
                    "; is it written with decimal commas?" if delimiter == "," and len(stripped) > len(header) else ""
                )
                message = f"the line has {len(stripped)} fields, the header {len(header)}{hint}"
                raise FileError(path, message, line=reader.line_num)
            rows.append(stripped)
            lines.append(reader.line_num)
    except csv.Error as error:
        raise FileError(path, f"is no CSV: {error}", line=reader.line_num) from error
    if header is None:
        raise FileError(path, "is empty; its first line must name the columns")
    twice = [name for name, times in Counter(header).items() if times > 1]
    if twice:
        raise FileError(path, f"two columns are named '{shown(min(twice))}'; column names must differ", line=1)
    return Table(path=path, header=header, rows=tuple(rows), lines=tuple(lines))


def delimiter_of(text: str) -> str:
    """What separates the fields of a file's text, by its header."""
    lines = _SEPARATOR_LINE.sub("", text, count=1).splitlines()
    header = next((line for line in lines if line.strip() and not line.startswith("#")), "")
    return max(",;\t", key=header.count)
