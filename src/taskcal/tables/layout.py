"""Where a sheet's column names, units and values stand."""

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from itertools import islice

import numpy as np

from taskcal.errors import MAX_MET, FileError, shown
from taskcal.tables.table import MAX_COLUMNS, Cells, Row, Sheet, Table, too_wide
from taskcal.tables.text import MAX_REMARKS, footer_note, is_footer, separator_of, split_line

# Column names over two rows: groups, as of a reflector or of what was asked and what was measured, above the names
# in them.

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
    drawn = np.array([bool(row) and all(not cell or _RULE.fullmatch(cell) for cell in row) for row in sheet.rows], bool)
    if not drawn.any():
        return sheet
    return replace(sheet, rows=Cells.of(sheet.rows)[~drawn], lines=np.asarray(sheet.lines)[~drawn])


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


UNITS = frozenset({
    "mm", "m", "um", "µm", "μm", "cm", "in", "inch", "inches", "ft", "deg", "degree", "degrees", "grad", "gon", "°", "rad",
    "radian", "radians", "mrad",
    "s", "sec", "ms", "h", "min", "c", "°c", "degc", "k", "celsius", "-", "1",
})  # fmt: skip
"""What may stand under a column's name in a row of units."""

_NUMBER = re.compile(r"[+-]?(?:\d+(?:\.\d*)?|\.\d+)(?:e[+-]?\d+)?|[+-]?(?:nan|inf)", re.ASCII | re.IGNORECASE)

_COMMENTS = 200
"""Comments from the beginning, and as many from the end, that may name columns."""

_LABEL = re.compile(r"[^\W\d_][^:]*:\s*\S")

_SETTING = re.compile(r"\W*[^\W\d_][\w ]{0,60}=\s*[^\W\d_]")
"""A line such as ``AXES = CARTESIAN: X, Y, Z (mm)``, which names no columns by itself."""

_LISTED = re.compile(
    r"\W*(?:columns?|fields?|spalten|header|format|order|reihenfolge|data)\b[^:=]{0,40}[:=]\s*", re.IGNORECASE
)
"""What stands before a list of names."""

_BRACKETS = re.compile(r"[\[({<].*[\])}>]$", re.DOTALL)


def lay_out(sheet: Sheet, names: Sequence[str] | None = None) -> Table:
    """Find the names of the columns, their units, and the rows below.

    The rows begin at the first one that is mostly numbers and as wide as most that are. The names are the nearest row
    above with a text in it, or a comment with as many words as there are columns; a row of units may stand between.

    Args:
        sheet: rows of cells.
        names: the names of the columns, where the file has none or others; one for each column.

    Raises:
        FileError: there is nothing in it, too many columns, or the given names are too many or too few.
    """
    path = sheet.path
    sheet = without_rules(replace(sheet, rows=Cells.of(sheet.rows), lines=np.asarray(sheet.lines, dtype=np.int64)))
    if not len(sheet.rows):
        raise FileError(path, "is empty; its first line must name the columns")
    width, first = _first_row_of_numbers(sheet.rows)
    if width > MAX_COLUMNS:
        raise too_wide(path, sheet.lines[0])
    if names is not None:
        return _named(sheet, names, first if first is not None else len(sheet.rows))
    if first is None:
        return _only_names(sheet)
    above = [row for row in range(first) if _is_text(sheet.rows[row]) and not _is_statement(sheet.rows[row], width)]
    units_row = above.pop() if above and _is_units(sheet.rows[above[-1]]) and len(above) > 1 else None
    header_row = above[-1] if above else None
    if header_row is not None and len(sheet.rows[header_row]) == 1 < width:
        header_row = None
    if header_row is None:
        return _from_comments(sheet, first, width)
    header = sheet.rows[header_row]
    begin = header_row + 1 if units_row is None else units_row + 1
    begin = max([begin, *(row + 1 for row in range(begin, first) if _is_statement(sheet.rows[row], width))])
    units = () if units_row is None else sheet.rows[units_row]
    if header_row and header_row - 1 in above:
        units = units or group_units(sheet.rows[header_row - 1], header)
        header = joined_names(sheet.rows[header_row - 1], header) or header
    sheet = sheet.noted(*_numbers_above(sheet, header_row))
    return _table(sheet, header, begin, units, header_row)


def _numbers_above(sheet: Sheet, before: int) -> tuple[str, ...]:
    """What is said of rows of numbers before the names of the columns: another table, or settings."""
    lines = [sheet.lines[row] for row in range(before) if len(sheet.rows[row]) > 2 and _is_numbers(sheet.rows[row])]
    if not lines:
        return ()
    where = f"line {lines[0]} holds" if len(lines) == 1 else f"lines {lines[0]} to {lines[-1]} hold"
    return (
        f"{where} numbers above the table that is read, which begins in line {sheet.lines[before]}, and are left out",
    )


def _first_row_of_numbers(rows: Sequence[tuple[str, ...]]) -> tuple[int, int | None]:
    """How many cells most rows of numbers have, and the first of these; None where no row is of numbers."""
    widths = Counter[int]()
    first: dict[int, int] = {}
    for number, row in enumerate(rows):
        if _is_numbers(row):
            widths[len(row)] += 1
            first.setdefault(len(row), number)
    if not widths:
        return len(rows[0]), None
    width = max(widths, key=lambda w: (widths[w], w))
    return width, first[width]


def _is_numbers(row: Sequence[str]) -> bool:
    """Whether three cells are numbers, or two and half of the filled ones."""
    numbers = 0
    for cell in row:
        if cell and _NUMBER.fullmatch(cell):
            numbers += 1
            if numbers > 2:
                return True
    return numbers > 0 and numbers >= min(2, len(row)) and 2 * numbers >= sum(map(bool, row))


def _is_text(row: Sequence[str]) -> bool:
    """Whether a row has a filled cell, and no number in it."""
    filled = [cell for cell in row if cell]
    return bool(filled) and not any(_NUMBER.fullmatch(cell) and cell != "1" for cell in filled)


def _is_statement(row: Sequence[str], width: int) -> bool:
    """Whether a row of text is a setting or a labelled remark, and names no columns of a table so wide."""
    text = " ".join(filter(None, row))
    return bool(_SETTING.match(text)) or (bool(_LABEL.match(text)) and (len(row) != width or ":" in row))


def _is_units(row: Sequence[str]) -> bool:
    filled = [bare_unit(cell) for cell in row if cell]
    return bool(filled) and all(cell in UNITS for cell in filled)


def bare_unit(text: str) -> str:
    """A unit in small letters, without brackets around it."""
    text = text.strip()
    return (text[1:-1].strip() if _BRACKETS.match(text) else text).casefold()


def _named(sheet: Sheet, names: Sequence[str], first: int) -> Table:
    sample = min(first, len(sheet.rows) - 1)
    width = len(sheet.rows[sample])
    if len(names) != width:
        message = f"has {width} columns, and {len(names)} names were given for them: {shown(' '.join(names))}"
        raise FileError(sheet.path, message, line=int(sheet.lines[sample]))
    return _table(sheet, tuple(names), first)


def _only_names(sheet: Sheet) -> Table:
    """A file whose rows hold no numbers: its first row names the columns, as far as anything does."""
    return _table(sheet, sheet.rows[0], 1, header_row=0)


def _from_comments(sheet: Sheet, first: int, width: int) -> Table:
    """Names from the last comment with as many words as columns, or none."""
    for comment in reversed((*sheet.comments[:_COMMENTS], *sheet.comments[_COMMENTS:][-_COMMENTS:])):
        for listed in filter(None, (comment, _LISTED.sub("", comment, count=1))):
            words = split_line(listed, separator_of([listed]))
            if len(words) == width and _is_text(words) and not _is_statement(words, width):
                return _table(sheet, words, first)
    return _table(sheet, ("",) * width, first)


def _table(sheet: Sheet, header: Row, begin: int, units: Sequence[str] = (), header_row: int | None = None) -> Table:
    """The rows of a sheet from one on, under their names.

    Args:
        sheet: whose rows they are.
        header: names of the columns.
        begin: first of the rows.
        units: from a row of units.
        header_row: in which the names stand; None where they are in no row.
    """
    above = sheet.rows[: begin if header_row is None else header_row]
    preamble = (*(" ".join(filter(None, row)) for row in above), *sheet.comments)
    header_line = None if header_row is None else int(sheet.lines[header_row])
    sheet = _without_footer(sheet, begin, len(header))
    rows, lines, second = _first_table(sheet, header, begin)
    if any(header) and not header[-1]:
        # every line ends with a separator
        header = header[: max(1, _filled(header), *map(_filled, rows))]
    width, wrong = len(header), list[FileError]()
    fitted = rows if (rows.widths == width).all() else Cells.of(_fitted(row, width, sheet.separator) for row in rows)
    sound = fitted.widths == width
    if len(rows) > 2 and 2 * sound.sum() < len(rows):
        raise _no_table(sheet, width, int(sound.sum()))
    if not sound.all():
        wrong = [_wrong_width(sheet, header, int(lines[k]), fitted[int(k)]) for k in np.flatnonzero(~sound)[:MAX_MET]]
        fitted, lines = fitted[sound], lines[sound]
    stated = (next((row[k] for row in (units, sheet.units) if k < len(row) and row[k]), "") for k in range(width))
    return Table(
        path=sheet.path,
        header=tuple(name or (f"column {k}" if any(header) else "") for k, name in enumerate(header, start=1)),
        rows=fitted,
        lines=lines,
        header_line=header_line,
        units=tuple(map(bare_unit, stated)),
        preamble=preamble,
        faults=(*wrong, *second),
        notes=sheet.notes,
    )


def _without_footer(sheet: Sheet, begin: int, width: int) -> Sheet:
    """A sheet without rows below the table that sum it up or remark on it; a note says which."""
    end = len(sheet.rows)
    while width > 2 and end > max(begin + 1, len(sheet.rows) - MAX_REMARKS) and is_footer(sheet.rows[end - 1]):
        end -= 1
    if end == len(sheet.rows):
        return sheet
    note = f"rows below the table are left out: {footer_note(np.asarray(sheet.lines)[end:].tolist(), sheet.rows[end:])}"
    return replace(sheet, rows=sheet.rows[:end], lines=sheet.lines[:end]).noted(note)


def _first_table(sheet: Sheet, header: Row, begin: int) -> tuple[Cells, np.ndarray, tuple[FileError, ...]]:
    """The rows before another row of names, their lines, and a fault where that begins a second table.

    Names that stand again, as at the head of each printed page, are left out.
    """
    rows, lines = Cells.of(sheet.rows)[begin:], np.asarray(sheet.lines)[begin:]
    others = np.array([row != header for row in rows], dtype=bool)
    if not others.all():
        rows, lines = rows[others], lines[others]
    for k, (before, row, after) in enumerate(zip(rows, islice(rows, 1, None), islice(rows, 2, None), strict=False), 1):
        if _names_anew(before, row, after):
            message = f"names columns again ('{shown(' '.join(row), 40)}'): a second table begins here; give each a file of its own"
            return rows[:k], lines[:k], (FileError(sheet.path, message, line=int(lines[k])),)
    return rows, lines, ()


def _names_anew(before: Sequence[str], row: Sequence[str], after: Sequence[str]) -> bool:
    """Whether texts stand where the row before has numbers, and numbers follow."""
    if any(map(_NUMBER.fullmatch, row)):
        return False
    under = [row[j] for j in range(min(len(before), len(row))) if _NUMBER.fullmatch(before[j])]
    return len(under) > 1 and all(under) and len(after) == len(row) and _is_numbers(after)


def _filled(row: Sequence[str]) -> int:
    """How many cells a row has up to its last filled one."""
    return next((k for k in range(len(row), 0, -1) if row[k - 1]), 0)


def _fitted(row: Row, width: int, separator: str) -> Row:
    """A row without the empty cells beyond the last column, and in a workbook with those that it leaves out."""
    if len(row) > width and not any(row[width:]):
        return row[:width]
    return row + ("",) * (width - len(row)) if not separator and len(row) < width else row


def _no_table(sheet: Sheet, width: int, sound: int) -> FileError:
    """What is said of text that happens to have some lines of numbers."""
    lines = [" ".join(row) for row in sheet.rows[:10]]
    at = next((k for k, line in enumerate(lines) if _LABEL.match(line)), None)
    kind, line = ("text", lines[0]) if at is None else ("labelled text", lines[at])
    message = (
        f"is {kind}, not a table: only {sound} of {len(sheet.rows)} lines have {width} cells "
        f"(line {sheet.lines[at or 0]}: '{shown(line, 40)}'); "
        "give a table with a row for each measured pose"
    )
    return FileError(sheet.path, message)


def _wrong_width(sheet: Sheet, header: tuple[str, ...], line: int, row: tuple[str, ...]) -> FileError:
    decimal = sheet.separator == "," and len(row) > len(header)
    hint = "; is it written with decimal commas?" if decimal else ""
    if any(header):
        message = f"the line has {len(row)} fields, the header {len(header)}{hint}"
    else:
        message = f"the line has {len(row)} fields, most others {len(header)}{hint}"
    return FileError(sheet.path, message, line=line)
