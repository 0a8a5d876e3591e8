"""Where the cells of a CSV table stand in its text, so that single ones can be rewritten."""

from dataclasses import dataclass

from taskcal.errors import FileError
from taskcal.programs.source import Source
from taskcal.tabular.delimited import delimiter_of
from taskcal.tabular.table import Table


@dataclass(frozen=True, kw_only=True)
class Row:
    """A row of a table in its text."""

    start: int
    """First character of its line."""
    end: int
    """Behind the last character of its line, before the line end."""
    next: int
    """First character of the line that follows."""
    cells: tuple[tuple[int, int], ...]
    """First character of each cell, and behind its last one, without quotes and blanks around it."""


def locate_rows(source: Source, table: Table) -> tuple[Row, ...]:
    """The rows of a table in its source, without the header.

    Raises:
        FileError: quotes stand inside a cell, so that its text is not what it means, or one does not end.
    """
    text = source.text
    rows = [row for row in _scan(text, delimiter_of(text.removeprefix("\ufeff"))) if _counts(text, row)][1:]
    if [_texts(text, row) for row in rows] != [list(cells) for cells in table.rows]:
        raise FileError(source.path, "has quotes inside cells; write numbers and names without them")
    for row in rows:
        if text.count('"', row.start, row.end) % 2:
            raise FileError(
                source.path, "has a quote that does not end; write the cell without it", line=source.line(row.start)
            )
    return tuple(rows)


def _texts(text: str, row: Row) -> list[str]:
    return [text[start:end] for start, end in row.cells]


def _counts(text: str, row: Row) -> bool:
    """Whether a row belongs to the table: it is neither blank, nor a comment, nor the line that names the separator."""
    texts = _texts(text, row)
    return any(texts) and not texts[0].startswith("#") and not (row.start <= 1 and texts[0].lower().startswith("sep="))


def _scan(text: str, delimiter: str) -> list[Row]:
    rows: list[Row] = []
    position = 1 if text.startswith("\ufeff") else 0
    while position < len(text):
        start, cells = position, list[tuple[int, int]]()
        while True:
            cell, position = _cell(text, position, delimiter)
            cells.append(cell)
            if position < len(text) and text[position] == delimiter:
                position += 1
            else:
                break
        end = position
        position += 2 if text.startswith("\r\n", position) else 1
        rows.append(Row(start=start, end=end, next=min(position, len(text)), cells=tuple(cells)))
    return rows


def _cell(text: str, position: int, delimiter: str) -> tuple[tuple[int, int], int]:
    """A cell from its first character on, and the position behind it."""
    if text.startswith('"', position):
        start = end = position + 1
        while end < len(text) and text[end] != '"':
            end += 1
        position = end + 1
        while position < len(text) and text[position] not in (delimiter, "\r", "\n"):
            position += 1
    else:
        start = position
        while position < len(text) and text[position] not in (delimiter, "\r", "\n"):
            position += 1
        end = position
    while start < end and text[start].isspace():
        start += 1
    while start < end and text[end - 1].isspace():
        end -= 1
    return (start, end), min(position, len(text))
