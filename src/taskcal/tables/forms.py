"""Tables in files, whatever form they have: text in columns or a workbook."""

import codecs
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Generic, TypeVar

from taskcal.errors import FaultyFile, FileError, shown
from taskcal.io.text_file import read_bytes
from taskcal.plugins import load_plugins
from taskcal.tables.layout import lay_out
from taskcal.tables.motion_capture import is_motion_capture, parse_motion_capture
from taskcal.tables.parquet import is_parquet, read_parquet
from taskcal.tables.table import Sheet, Table, refuse_wide
from taskcal.tables.text import (
    DecimalMark,
    has_labelled_values,
    in_plain_digits,
    parse_delimited,
    parse_labelled_values,
    with_decimal_points,
)

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
    except UnicodeDecodeError:
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


@dataclass(frozen=True, kw_only=True)
class TableForm:
    """What a user may state of a table that the file does not say; nothing by default."""

    columns: tuple[str, ...] | None = None
    """Names of the columns, for a file that has none, or others."""
    decimal: DecimalMark | None = None
    """The decimal mark."""
    sheet: str | None = None
    """Of a workbook."""


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


def _is_workbook(path: Path, content: bytes) -> bool:
    from taskcal.tables.spreadsheet import is_workbook

    return is_workbook(content)


def _read_workbook(path: Path, content: bytes, form: TableForm) -> Sheet:
    from taskcal.tables.spreadsheet import read_workbook

    return with_decimal_points(read_workbook(path, content, form.sheet), form.decimal)


GROUP = "taskcal.table_forms"
"""Entry points of other packages: a `BinaryForm` or a `TextForm` each."""

_FORMS: dict[str, FileForm] = {
    form.name: form
    for form in (
        BinaryForm(
            name="parquet",
            suffixes=(".parquet",),
            holds=lambda path, content: is_parquet(content),
            read=lambda path, content, form: read_parquet(path, content),
        ),
        BinaryForm(name="workbook", suffixes=(".xlsx",), holds=_is_workbook, read=_read_workbook),
        TextForm(
            name="motion capture",
            suffixes=(".csv",),
            holds=lambda path, text: is_motion_capture(text),
            read=lambda path, text, form: parse_motion_capture(path, text),
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
            read=lambda path, text, form: parse_delimited(path, text, form.decimal),
        ),
    )
}
"""By name, in the order in which a file is tried."""

_OWN = frozenset(_FORMS)


def forms() -> tuple[FileForm, ...]:
    """Those of other packages, which were installed for their files, then Taskcal's own."""
    load_plugins(GROUP, FileForm, _FORMS)
    return tuple(sorted(_FORMS.values(), key=lambda form: form.name in _OWN))


def table_suffixes() -> tuple[str, ...]:
    """How files of tables end, in small letters."""
    return tuple(dict.fromkeys(suffix for form in forms() for suffix in form.suffixes))


def _form_of(kind: type[FileForm[T]], path: Path, content: T) -> FileForm[T] | None:
    """The form that holds a file.

    Raises:
        FileError: forms of other packages hold it that do not know of each other.
    """
    found = [form for form in forms() if isinstance(form, kind) and form.holds(path, content)]
    added = [form.name for form in found if form.name not in _OWN]
    if len(added) > 1:
        names = " and ".join(f"'{name}'" for name in added)
        raise FileError(path, f"is held by {names}, forms of installed packages; uninstall one of them")
    return found[0] if found else None


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
        sheet = found.read(path, content, replace(form, sheet=named or form.sheet))
    else:
        text = decode(path, content)
        # the bytes of a large file are no longer needed while its text is parted
        del content
        sheet = parse_sheet(path, text, form)
    return lay_out(sheet, form.columns)


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
