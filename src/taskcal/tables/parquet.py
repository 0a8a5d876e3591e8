"""Parquet files: columns of numbers with names, packed in groups of rows, so that a part can be read without the others."""

import hashlib
import io
import os
import re
from collections.abc import Generator
from contextlib import contextmanager
from itertools import chain
from pathlib import Path
from types import ModuleType
from typing import Any

from taskcal.errors import FileError, TaskcalError, shown
from taskcal.io.text_file import open_ordinary
from taskcal.tables.table import CELLS_AT_ONCE, MAX_COLUMNS, Cells, Sheet, too_wide

MARK = b"PAR1"
"""Begins and ends each of them."""

MAX_CELLS = 20_000_000
"""Of a file that is read whole: a million poses of six joints, a point and some more; each cell becomes text on the way."""

FEW_CELLS, CELLS_A_BYTE = 500_000, 0.5
"""That any file may have, and beyond them for each byte: measured numbers pack to two bytes and more, and what packs to less costs
the same time."""

MAX_TEXT_MB = 200.0
"""Of all columns as they are unpacked, and of the texts of one, 10⁶ bytes."""

MAX_STATED_TEXT_MB = 40.0
"""Of the texts that are no numbers, as they are unpacked: names of a million rows. Each passes through several hands."""

MAX_DIRECTORY_MB = 8.0
"""Of what says where the columns are, which is read before anything can be counted: 300 bytes a column and group of rows."""

GROUP_ROWS = 65_536
"""Rows that are packed together."""

SEAL = b"taskcal seal"
"""Begins the digest of all other bytes of a file of ours, between its columns and its directory, where nobody reads: the checksums
of Parquet itself leave out the directory, with the names of columns, their kinds and places."""

SEAL_BYTES = len(SEAL) + hashlib.sha256().digest_size

_WITH_CHECKSUM = re.compile(MARK + rb"(?:\x15[\x80-\xff]{0,4}[\x00-\x7f]){3}\x15", re.DOTALL)
"""How a file begins whose pages have checksums: kind of the first page, its size unpacked and packed, and a fourth number.
Source: PageHeader in parquet.thrift, by Thrift's compact protocol."""

UNCHECKED = "the Parquet file has no checksums of its pages: damage to its numbers would not be noticed"
"""Note on files of others."""

NOTE = "columns as in a campaign's CSV, units in their names: mm, deg, s, C; empty cells are lost beams"
"""What a file of ours says of itself."""


def read_parquet(path: Path, content: bytes) -> Sheet:
    """The cells of a file, numbers to their last digit; its rows are counted as the lines of a CSV with a header would be.

    Args:
        path: of the file, for errors.
        content: its bytes.

    Raises:
        FileError: it is damaged, or holds too much.
        TaskcalError: pyarrow is not installed.
    """
    with _opened(path, content) as file:
        names = _checked_names(path, file)
        columns = file.read().columns
        for name, column in zip(names, columns, strict=True):
            _refuse_long(path, name, column)
        header = tuple(str(name).strip() for name in names)
        # no more texts of their own at once than an array takes in
        at_once = max(64, CELLS_AT_ONCE // max(1, len(columns)))
        firsts = range(0, max(map(len, columns), default=0), at_once)
        parts = ([_texts(column.slice(first, at_once)) for column in columns] for first in firsts)
        rows = Cells.of(chain([header], chain.from_iterable(zip(*part, strict=True) for part in parts)))
    notes = () if _WITH_CHECKSUM.match(content) else (UNCHECKED,)
    return Sheet(path=path, rows=rows, lines=range(1, len(rows) + 1), notes=notes)


def _checked_names(path: Path, file: Any) -> list[str]:
    """Names of the columns of a file that can be read whole."""
    names = list(file.schema_arrow.names)
    _check_cells(path, file.metadata, MAX_CELLS)
    groups = [file.metadata.row_group(k) for k in range(file.metadata.num_row_groups)]
    unpacked = sum(group.total_byte_size for group in groups) / 1e6
    if unpacked > MAX_TEXT_MB:
        raise FileError(path, f"unpacks to {unpacked:.0f} MB, more than {MAX_TEXT_MB:.0f} MB; divide it")
    return names


def _check_cells(path: Path, metadata: Any, most: float) -> None:
    """See that a file has no more cells than some."""
    groups = [metadata.row_group(k) for k in range(metadata.num_row_groups)]
    rows, columns = max(metadata.num_rows, sum(group.num_rows for group in groups)), metadata.num_columns
    if rows * columns > most:
        raise FileError(
            path, f"has {rows} rows of {columns} columns, more than {most:.0f} cells; divide it, or thin out its rows"
        )


def _check_size(path: Path, metadata: Any, size: int) -> None:
    """See that what a file of so many bytes says of itself is what measured numbers may be."""
    if metadata.num_columns > MAX_COLUMNS:
        raise too_wide(path, 1)
    _check_cells(path, metadata, FEW_CELLS + CELLS_A_BYTE * size)
    texts = 0
    for group in map(metadata.row_group, range(metadata.num_row_groups)):
        # a directory whose sizes contradict each other ends the process where a column is asked for them (pyarrow 26)
        if group.total_byte_size <= 1e6 * MAX_STATED_TEXT_MB / metadata.num_row_groups:
            continue
        columns = map(group.column, range(metadata.num_columns))
        texts += sum(c.total_uncompressed_size for c in columns if c.physical_type == "BYTE_ARRAY")
    if texts > MAX_STATED_TEXT_MB * 1e6:
        message = f"has texts of {texts / 1e6:.0f} MB, more than {MAX_STATED_TEXT_MB:.0f} MB; leave out their columns"
        raise FileError(path, message)


def _check_directory(path: Path, content: bytes | None) -> int:
    """The size of a file whose directory is not too large, bytes, and which is as it was sealed."""
    with open_ordinary(path) if content is None else io.BytesIO(content) as stream:
        size = stream.seek(0, os.SEEK_END)
        stream.seek(max(size - 8, 0))
        directory = int.from_bytes(stream.read(4), "little")
        if MAX_DIRECTORY_MB * 1e6 < directory <= size:
            raise FileError(
                path,
                f"has a directory of {directory / 1e6:.0f} MB; save it with fewer columns, or larger groups of rows",
            )
        if not _is_as_sealed(stream, size - 8 - directory):
            raise FileError(path, "is damaged: its bytes are not those that were written; take it from where it came")
    return size


def _is_as_sealed(stream: io.BufferedIOBase, directory: int) -> bool:
    """Whether a file whose directory begins there has no seal, or the one of its bytes."""
    left = directory - SEAL_BYTES
    if left < len(MARK):
        return True
    stream.seek(left)
    seal = stream.read(SEAL_BYTES)
    if not seal.startswith(SEAL):
        return True
    end = stream.read()
    stream.seek(0)
    digest = hashlib.sha256()
    while left and (block := stream.read(min(left, 1 << 20))):
        digest.update(block)
        left -= len(block)
    digest.update(end)
    return seal == SEAL + digest.digest()


def _refuse_long(path: Path, name: str, column: Any) -> None:
    """See that a column has no long texts again and again, each of which the file holds once."""
    kept = [chunk.dictionary for chunk in column.chunks if hasattr(chunk, "dictionary")]
    longest = max((len(str(text)) for texts in kept for text in texts.to_pylist()), default=0)
    if longest * len(column) > MAX_TEXT_MB * 1e6:
        raise FileError(
            path,
            f"text column too long ({longest} characters in {len(column)} rows); drop it or store it as numbers",
            column=shown(name),
        )


def _texts(column: Any) -> list[str]:
    """Cells of a column: empty for what is lacking; NaN, which other programs write for that, too."""
    values: list[Any] = column.to_pylist()
    return ["" if value is None or value != value else str(value).strip() for value in values]


def count_rows(path: Path) -> int | None:
    """Rows of a Parquet file, of which only the end is read; None of any other.

    Raises:
        FileError: it is missing, or damaged.
        TaskcalError: it is one, and pyarrow is not installed.
    """
    with open_ordinary(path) as stream:
        if stream.read(len(MARK)) != MARK:
            return None
    with _opened(path) as file:
        return int(file.metadata.num_rows)


def parts_of(path: Path, rows: int) -> Generator[tuple[int, bytes], None, None]:
    """A file divided: the number of each part's first row, and a Parquet file of so many rows; one part is held at a time.

    Raises:
        FileError: it is damaged.
    """
    with _opened(path) as file:
        first = 0
        for batch in file.iter_batches(batch_size=rows):
            yield first, _packed(_pyarrow()[0].Table.from_batches([batch]))
            first += batch.num_rows


def every_row(path: Path, step: int, rows: int) -> bytes:
    """A Parquet file of rows 0, step, 2·step …, of which so many are looked at at a time.

    Raises:
        FileError: it is damaged.
    """
    pyarrow, _ = _pyarrow()
    with _opened(path) as file:
        first, chosen = 0, []
        for batch in file.iter_batches(batch_size=rows):
            chosen.append(batch.take(pyarrow.array(range(-first % step, batch.num_rows, step), type=pyarrow.int64())))
            first += batch.num_rows
        return _packed(pyarrow.Table.from_batches(chosen))


@contextmanager
def _opened(path: Path, content: bytes | None = None) -> Generator[Any, None, None]:
    """A file whose columns are numbers, texts and the like, not lists; of texts each is held once.

    Raises:
        FileError: it is damaged, says of itself what no measured numbers are, or has columns of lists or records, of which a few
            bytes may become any number.
    """
    pyarrow, parquet = _pyarrow()
    size = _check_directory(path, content)
    try:
        with parquet.ParquetFile(path if content is None else io.BytesIO(content)) as file:
            metadata, schema = file.metadata, file.schema_arrow
        _check_size(path, metadata, size)
        for field in schema:
            if pyarrow.types.is_nested(field.type):
                message = "holds lists or records; write each number to a column of its own"
                raise FileError(path, message, column=shown(field.name))
        texts = [field.name for field in schema if field.type in (pyarrow.string(), pyarrow.binary())]
        # read ahead, it would come to hold the whole file
        source = path if content is None else io.BytesIO(content)
        how: dict[str, Any] = {"pre_buffer": False, "page_checksum_verification": True, "read_dictionary": texts}
        with parquet.ParquetFile(source, metadata=metadata, **how) as file:
            yield file
    except TaskcalError:
        raise
    except Exception as error:
        # pyarrow raises what damage happens to lead to: its own errors, an OSError, an OverflowError, a UnicodeDecodeError …
        raise FileError(path, f"is a damaged Parquet file ({shown(error)}); save it again, or as CSV") from error


def _packed(table: Any) -> bytes:
    """The bytes of a file, sealed."""
    out = io.BytesIO()
    _pyarrow()[1].write_table(table, out, row_group_size=GROUP_ROWS, compression="zstd", write_page_checksum=True)
    content = out.getvalue()
    directory = len(content) - 8 - int.from_bytes(content[-8:-4], "little")
    return content[:directory] + SEAL + hashlib.sha256(content).digest() + content[directory:]


def parquet_of(header: list[str], rows: list[list[str]]) -> bytes:
    """A file of a table whose cells are given as text: columns of numbers as such, all others as text.

    Args:
        header: names of the columns.
        rows: their cells; an empty one is lacking.

    Raises:
        TaskcalError: pyarrow is not installed.
    """
    pyarrow, _ = _pyarrow()
    columns = list(zip(*rows, strict=True)) or [()] * len(header)
    arrays = [_array(pyarrow, name, column) for name, column in zip(header, columns, strict=True)]
    table = pyarrow.table(dict(zip(header, arrays, strict=True))).replace_schema_metadata({"taskcal": NOTE})
    return _packed(table)


def _array(pyarrow: Any, name: str, cells: tuple[str, ...]) -> Any:
    """A column; names of rows stay text, as 007 is not 7."""
    if name != "id":
        try:
            return pyarrow.array([float(cell) if cell else None for cell in cells], type=pyarrow.float64())
        except ValueError:
            pass
    return pyarrow.array(cells, type=pyarrow.string())


def _pyarrow() -> tuple[Any, ModuleType]:
    try:
        import pyarrow  # pyright: ignore
        import pyarrow.parquet as parquet  # pyright: ignore
    except ImportError as error:
        raise TaskcalError("Parquet files need pyarrow; install Taskcal with its extra: parquet") from error
    return pyarrow, parquet
