"""From a file to a table: which form the file has, what its bytes stand for, and where names, units and values stand."""

import codecs
import re
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import islice, tee
from pathlib import Path
from typing import Generic, TypeVar

import numpy as np

from taskcal.errors import MAX_MET, FaultyFile, FileError, shown
from taskcal.io.text_file import read_bytes
from taskcal.tables.options import TableForm
from taskcal.tables.parquet import MARK, read_parquet
from taskcal.tables.reports import (
    is_coordinate_report,
    is_qtm_export,
    parse_coordinate_report,
    parse_qtm_export,
    program_named,
    refuse_coordinate_lines,
)
from taskcal.tables.spreadsheet import read_workbook
from taskcal.tables.table import MAX_COLUMNS, NUMBER, UNITS, Cells, Row, Sheet, Table, refuse_wide, too_wide
from taskcal.tables.text import (
    MAX_REMARKS,
    expect_whole_end,
    footer_note,
    has_labelled_values,
    in_plain_digits,
    is_footer,
    is_motion_capture,
    parse_delimited,
    parse_labelled_values,
    parse_motion_capture,
    separator_of,
    split_line,
)
from taskcal_groundwork.plugins import load_plugins

# Which characters the bytes of a text file stand for.

_MARKS = (
    (codecs.BOM_UTF32_LE, "utf-32-le"),
    (codecs.BOM_UTF32_BE, "utf-32-be"),
    (codecs.BOM_UTF8, "utf-8"),
    (codecs.BOM_UTF16_LE, "utf-16-le"),
    (codecs.BOM_UTF16_BE, "utf-16-be"),
)
"""Byte order marks; the longer come first, since that of UTF-32 begins with that of UTF-16."""

_NO_TABLES = {
    b"\xd0\xcf\x11\xe0": "is a workbook of an old kind (.xls); save it as .xlsx or CSV",
    b"%PDF": "is a PDF; export the table as CSV",
    b"PK\x03\x04": "is a packed file; a table in it must be a workbook (.xlsx)",
    b"\x1f\x8b": "is compressed; unpack it first",
    b"{\\rtf": "is a rich text document; save it as plain text",
}
"""What is no text, by its first bytes."""

_SAMPLE = 4096
"""Bytes that tell whether every second one is zero, as in UTF-16 without a mark."""


def decode(path: str | Path, content: bytes) -> str:
    r"""The text that bytes stand for, line ends as Python has them.

    UTF-8 or UTF-16 and UTF-32 with their marks, UTF-16 without one where every second byte is zero, and otherwise
    Windows-1252, in which European instruments write ``°``, ``µ`` and umlauts.

    Raises:
        FileError: it is no text, or not in the encoding that its first bytes state.
    """
    for start, message in _NO_TABLES.items():
        if content.startswith(start):
            raise FileError(path, message)
    for mark, encoding in _MARKS:
        if content.startswith(mark):
            return _strict(path, content[len(mark) :], encoding)
    head = content[:_SAMPLE]
    if b"\0" in head:
        encoding = _unmarked(head)
        if encoding is None:
            raise FileError(path, "is a binary file; export it as CSV")
        return _strict(path, content, encoding)
    # a single character may make the text four times as large as the bytes
    content = content.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    try:
        return content.decode("utf-8")
    except UnicodeDecodeError as error:
        if error.reason == "unexpected end of data" and not content[: error.start].isascii():
            raise FileError(path, "is cut off in its last character; take it from where it came") from error
        return _western(path, content)


def _strict(path: str | Path, content: bytes, encoding: str) -> str:
    try:
        text = content.decode(encoding)
    except UnicodeDecodeError as error:
        named = encoding.upper().removesuffix("-LE").removesuffix("-BE")
        raise FileError(path, f"is not the {named} text that it says it is; save it as CSV in UTF-8") from error
    if "\0" in text:
        raise FileError(path, "is a binary file; export it as CSV")
    return text.replace("\r\n", "\n").replace("\r", "\n")


def _unmarked(head: bytes) -> str | None:
    """UTF-16 without a mark: one byte of nearly every pair is zero, and the other hardly ever."""
    first, second = head[0::2].count(0), head[1::2].count(0)
    pairs = len(head) // 2
    if second > 0.8 * pairs and first == 0:
        return "utf-16-le"
    if first > 0.8 * pairs and second == 0:
        return "utf-16-be"
    return None


def _western(path: str | Path, content: bytes) -> str:
    text = content.decode("cp1252", errors="replace")
    if "\ufffd" in text or any(ord(c) < 32 and c not in "\t\n\r\f\v\x1a" for c in text):
        raise FileError(path, "is neither UTF-8 nor Windows-1252 text; save it as CSV in UTF-8")
    return text


MANY_LINES, SHORTEST_LINE = 30_000, 12
"""So many lines have so many characters at least, by the mean: three numbers of four digits, and what parts them. Lines cost time
and memory however short they are."""


T = TypeVar("T", bytes, str)
"""What a file holds, as a form wants it."""


@dataclass(frozen=True, kw_only=True)
class FileForm(Generic[T]):
    """A form of file that holds a table."""

    name: str
    """No other form has it."""
    suffixes: tuple[str, ...]
    """How its files end, in small letters: by these a folder's campaigns are known."""
    holds: Callable[[Path, T], bool]
    """Whether a file, by its name and its content, is of this form."""
    read: Callable[[Path, T, TableForm], Sheet]
    """Its rows.

    Raises:
        FileError: they cannot be read, with line and value.
    """


@dataclass(frozen=True, kw_only=True)
class BinaryForm(FileForm[bytes]):
    """A form whose content is bytes."""


@dataclass(frozen=True, kw_only=True)
class TextForm(FileForm[str]):
    """A form whose content is text, decoded, with decimal digits of any script as plain ones."""


GROUP = "taskcal.table_forms"
"""Entry points of other packages: a `BinaryForm` or a `TextForm` each."""


def _parse_columns(path: Path, text: str, form: TableForm) -> Sheet:
    refuse_coordinate_lines(path, text)
    if re.match(r'\s*\{\s*"', text):
        raise FileError(path, "is JSON, not a table; give a table with a row for each measured pose")
    return parse_delimited(path, text, form.decimal)


_FORMS: dict[str, FileForm] = {
    form.name: form
    for form in (
        BinaryForm(
            name="parquet",
            suffixes=(".parquet",),
            holds=lambda path, content: content.startswith(MARK),
            read=lambda path, content, form: read_parquet(path, content),
        ),
        BinaryForm(
            name="workbook",
            suffixes=(".xlsx",),
            # whole or damaged: names of parts stand unpacked before their contents, so that one that was cut off is known too
            holds=lambda path, content: content.startswith(b"PK\x03\x04") and b"xl/workbook.xml" in content,
            read=lambda path, content, form: read_workbook(path, content, form.sheet, form.hidden_rows, form.decimal),
        ),
        TextForm(
            name="motion capture",
            suffixes=(".csv",),
            holds=lambda path, text: is_motion_capture(text),
            read=lambda path, text, form: parse_motion_capture(path, text),
        ),
        TextForm(
            name="QTM export",
            suffixes=(".tsv",),
            holds=lambda path, text: is_qtm_export(text),
            read=lambda path, text, form: parse_qtm_export(path, text),
        ),
        TextForm(
            name="coordinate report",
            suffixes=(".txt",),
            holds=lambda path, text: is_coordinate_report(text),
            read=lambda path, text, form: parse_coordinate_report(path, text),
        ),
        TextForm(
            name="labelled values",
            suffixes=(".log", ".txt"),
            holds=lambda path, text: has_labelled_values(text),
            read=lambda path, text, form: parse_labelled_values(path, text),
        ),
        TextForm(
            name="columns",
            suffixes=(".csv", ".tsv", ".txt", ".dat", ".log"),
            holds=lambda path, text: True,
            read=_parse_columns,
        ),
    )
}
"""By name, in the order in which a file is tried."""

_OWN = frozenset(_FORMS)


def forms() -> tuple[FileForm, ...]:
    """Forms of other packages, which were installed for their files, then Taskcal's own."""
    load_plugins(GROUP, FileForm, _FORMS)
    return tuple(sorted(_FORMS.values(), key=lambda form: form.name in _OWN))


def table_suffixes() -> tuple[str, ...]:
    """Endings of the names of files that hold tables, in small letters."""
    return tuple(dict.fromkeys(suffix for form in forms() for suffix in form.suffixes))


def _form_of(kind: type[FileForm[T]], path: Path, content: T) -> FileForm[T] | None:
    """The form that holds a file."""
    found = [form for form in forms() if isinstance(form, kind) and form.holds(path, content)]
    added = [form.name for form in found if form.name not in _OWN]
    if len(added) > 1:
        names = " and ".join(f"'{name}'" for name in added)
        raise FileError(path, f"is held by {names}, forms of installed packages; uninstall one of them")
    return found[0] if found else None


MIN_COLUMNS = 3
"""Of a table of measurements; text in fewer may be a robot program."""


def read_table(path: str | Path, form: TableForm | None = None) -> Table:
    """The table of a file, with what stands around it.

    Text in UTF-8, UTF-16 or Windows-1252 in columns parted by commas, semicolons, tabs, bars or blanks, with decimal
    points or commas; logs of labelled values (``X=1.0 Y=2.0``); motion capture as Motive exports it; workbooks (.xlsx),
    with a sheet's name behind a ``#`` where one is meant (``measured.xlsx#Points``).

    Raises:
        FileError: the file is missing, is not a table, or has no rows.
        UnknownName: a workbook has no such sheet.
    """
    path, named = _sheet_behind(Path(path))
    form = form or TableForm()
    content = read_bytes(path)
    if (found := _form_of(BinaryForm, path, content)) is not None:
        return lay_out(found.read(path, content, replace(form, sheet=named or form.sheet)), form.columns)
    text = decode(path, content)
    # the bytes of a large file are no longer needed while its text is parted
    del content
    try:
        table = expect_whole_end(lay_out(parse_sheet(path, text, form), form.columns), text)
    except FileError as error:
        raise program_named(path, text) or error from error
    if (table.faults or len(table.header) < MIN_COLUMNS) and (other := program_named(path, text)) is not None:
        raise other
    return table


def _sheet_behind(path: Path) -> tuple[Path, str | None]:
    """A workbook and the sheet that its name states, as in ``measured.xlsx#Points``; a file of that name comes first."""
    text, mark, sheet = str(path).rpartition("#")
    if not mark or path.exists() or not Path(text).is_file():
        return path, None
    return Path(text), sheet


def parse_sheet(path: Path, text: str, form: TableForm | None = None) -> Sheet:
    """The rows that a file's text holds, in whatever form.

    Raises:
        FileError: it is a form whose rows cannot be told, has far more lines than such short ones can be rows, or a line of far
            more cells than a table has.
    """
    lines = text.count("\n")
    if lines > MANY_LINES and len(text) < SHORTEST_LINE * lines:
        mean = len(text) / lines - 1.0
        raise FileError(path, f"has {lines} lines of {mean:.0f} characters by the mean; is it a table of measurements?")
    refuse_wide(path, text)
    text, form = in_plain_digits(text), form or TableForm()
    found = _form_of(TextForm, path, text)
    assert found is not None, "text in columns holds any"
    return found.read(path, text, form)


def read_csv(path: str | Path, form: TableForm | None = None) -> Table:
    """Read a table whose header names its columns, each once.

    Raises:
        FileError: the file is missing, is not a table, names no columns, or two alike, or a line has more or fewer fields than
            the header.
    """
    table = read_table(path, form)
    if not any(table.header):
        raise FileError(table.path, "names no columns; its first line must name them", line=1)
    if any(table.units):
        units = " ".join(filter(None, table.units))
        raise FileError(table.path, f"has a row of units ({shown(units)}); state them in the names, as in x_mm")
    table.refuse_repeated()
    if len(table.faults) == 1:
        raise table.faults[0]
    if table.faults:
        raise FaultyFile(table.faults)
    return table


# Where a sheet's column names, units and values stand.
#
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


_UNDER_NAMES = frozenset({*UNITS, "k", "-", "1"})
"""What may stand under a column's name in a row of units: a unit, also one that no campaign has, or that there is none."""

_NUMBER_OR_NOT_FINITE = re.compile(rf"{NUMBER.pattern}|[+-]?(?:nan|inf)", re.ASCII | re.IGNORECASE)

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
        # no row holds numbers: the first names the columns, as far as anything does
        return _table(sheet, sheet.rows[0], 1, header_row=0)
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
    """Note on rows of numbers above the names of the columns: another table, or settings."""
    lines = [sheet.lines[row] for row in range(before) if len(sheet.rows[row]) > 2 and _is_numbers(sheet.rows[row])]
    if not lines:
        return ()
    where = f"line {lines[0]} holds" if len(lines) == 1 else f"lines {lines[0]} to {lines[-1]} hold"
    return (
        f"{where} numbers above the table that is read, which begins in line {sheet.lines[before]}, and are left out",
    )


def _first_row_of_numbers(rows: Sequence[tuple[str, ...]]) -> tuple[int, int | None]:
    """Width of most rows of numbers, and the first of these; None without rows of numbers."""
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
        if cell and _NUMBER_OR_NOT_FINITE.fullmatch(cell):
            numbers += 1
            if numbers > 2:
                return True
    return numbers > 0 and numbers >= min(2, len(row)) and 2 * numbers >= sum(map(bool, row))


def _is_text(row: Sequence[str]) -> bool:
    """Whether a row has a filled cell, and no number in it."""
    filled = [cell for cell in row if cell]
    return bool(filled) and not any(_NUMBER_OR_NOT_FINITE.fullmatch(cell) and cell != "1" for cell in filled)


def _is_statement(row: Sequence[str], width: int) -> bool:
    """Whether a row of text is a setting or a labelled remark, and names no columns of a table so wide."""
    text = " ".join(filter(None, row))
    return bool(_SETTING.match(text)) or (bool(_LABEL.match(text)) and (len(row) != width or ":" in row))


def _is_units(row: Sequence[str]) -> bool:
    filled = [bare_unit(cell) for cell in row if cell]
    return bool(filled) and all(cell in _UNDER_NAMES for cell in filled)


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
        acted=sheet.acted,
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
    first, second, third = tee(rows, 3)
    for k, (before, row, after) in enumerate(
        zip(first, islice(second, 1, None), islice(third, 2, None), strict=False), 1
    ):
        if _names_anew(before, row, after):
            message = f"names columns again ('{shown(' '.join(row), 40)}'): a second table begins here; give each a file of its own"
            return rows[:k], lines[:k], (FileError(sheet.path, message, line=int(lines[k])),)
    return rows, lines, ()


def _names_anew(before: Sequence[str], row: Sequence[str], after: Sequence[str]) -> bool:
    """Whether texts stand where the row before has numbers, and numbers follow."""
    if any(map(_NUMBER_OR_NOT_FINITE.fullmatch, row)):
        return False
    under = [row[j] for j in range(min(len(before), len(row))) if _NUMBER_OR_NOT_FINITE.fullmatch(before[j])]
    return len(under) > 1 and all(under) and len(after) == len(row) and _is_numbers(after)


def _filled(row: Sequence[str]) -> int:
    """Number of cells of a row up to its last filled one."""
    return next((k for k in range(len(row), 0, -1) if row[k - 1]), 0)


def _fitted(row: Row, width: int, separator: str) -> Row:
    """A row without the empty cells beyond the last column, and in a workbook with those that it leaves out."""
    if len(row) > width and not any(row[width:]):
        return row[:width]
    return row + ("",) * (width - len(row)) if not separator and len(row) < width else row


def _no_table(sheet: Sheet, width: int, sound: int) -> FileError:
    """Error for text that happens to have some lines of numbers."""
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
    hint = "; is it written with decimal commas?" if decimal else "; write one for each column, or leave the line out"
    if any(header):
        message = f"the line has {len(row)} fields, the header {len(header)}{hint}"
    else:
        message = f"the line has {len(row)} fields, most others {len(header)}{hint}"
    return FileError(sheet.path, message, line=line)
