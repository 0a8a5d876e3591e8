"""Parquet files: columns of numbers with names, packed in groups of rows, so that a part can be read without the others."""

import io
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType
from typing import Any

from taskcal.errors import FileError, TaskcalError, shown
from taskcal.tabular.sheet import Sheet
from taskcal.text_file import open_ordinary

MARK = b"PAR1"
"""Begins and ends each of them."""

MAX_CELLS = 20_000_000
"""Of a file that is read whole: a million poses of six joints, a point and some more; each cell becomes text on the way."""

GROUP_ROWS = 65_536
"""Rows that are packed together."""

NOTE = "columns as in a campaign's CSV, units in their names: mm, deg, s, C; empty cells are lost beams"
"""What a file of ours says of itself."""


def is_parquet(content: bytes) -> bool:
    """Whether bytes are a Parquet file, whole or cut off."""
    return content.startswith(MARK)


def read_parquet(path: Path, content: bytes) -> Sheet:
    """The cells of a file, numbers to their last digit; its rows are counted as the lines of a CSV with a header would be.

    Args:
        path: of the file, for errors.
        content: its bytes.

    Raises:
        FileError: it is damaged, or holds too much.
        TaskcalError: pyarrow is not installed.
    """
    pyarrow, parquet = _pyarrow()
    try:
        file: Any = parquet.ParquetFile(io.BytesIO(content))
        rows, names = file.metadata.num_rows, list(file.schema_arrow.names)
        if rows * len(names) > MAX_CELLS:
            raise FileError(
                path,
                f"has {rows} rows of {len(names)} columns, more than {MAX_CELLS} cells; divide it, or thin out its rows",
            )
        table = file.read()
    except (pyarrow.ArrowException, OSError, ValueError) as error:
        raise FileError(path, f"is a damaged Parquet file ({shown(error)}); save it again, or as CSV") from error
    cells = zip(*(_texts(column.to_pylist()) for column in table.columns), strict=True)
    header = tuple(str(name).strip() for name in names)
    return Sheet(path=path, rows=(header, *cells), lines=tuple(range(1, rows + 2)))


def _texts(values: list[Any]) -> list[str]:
    """Empty for what is lacking; NaN, which other programs write for that, too."""
    return ["" if value is None or value != value else str(value).strip() for value in values]


def count_rows(path: Path) -> int | None:
    """Rows of a Parquet file, of which only the end is read; None of any other.

    Raises:
        FileError: it is missing, or damaged.
        TaskcalError: it is one, and pyarrow is not installed.
    """
    with open_ordinary(path) as stream:
        if not is_parquet(stream.read(len(MARK))):
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
def _opened(path: Path) -> Generator[Any, None, None]:
    pyarrow, parquet = _pyarrow()
    try:
        # read ahead, it would come to hold the whole file
        with parquet.ParquetFile(path, pre_buffer=False) as file:
            yield file
    except (pyarrow.ArrowException, OSError) as error:
        raise FileError(path, f"is a damaged Parquet file ({shown(error)}); save it again") from error


def _packed(table: Any) -> bytes:
    out = io.BytesIO()
    _pyarrow()[1].write_table(table, out, row_group_size=GROUP_ROWS, compression="zstd")
    return out.getvalue()


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
