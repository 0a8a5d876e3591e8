"""Which characters the bytes of a text file stand for."""

import codecs
from pathlib import Path

from taskcal.errors import FileError

_MARKS = (
    (codecs.BOM_UTF32_LE, "utf-32-le"),
    (codecs.BOM_UTF32_BE, "utf-32-be"),
    (codecs.BOM_UTF8, "utf-8"),
    (codecs.BOM_UTF16_LE, "utf-16-le"),
    (codecs.BOM_UTF16_BE, "utf-16-be"),
)
"""Byte order marks; the longer come first, since that of UTF-32 begins with that of UTF-16."""

_FORMS = {
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
    for start, message in _FORMS.items():
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
