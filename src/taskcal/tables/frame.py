"""Rows of results as CSV, or as a frame of pandas."""

import csv
import io
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from taskcal.errors import TaskcalError

if TYPE_CHECKING:
    import pandas as pd


def csv_of(rows: Iterable[Mapping[str, Any]], digits: int | None = None) -> str:
    """Text of a CSV file: a column for each key, in the order in which the rows name them; None and NaN are empty.

    Args:
        rows: values by the names of their columns; a row may lack some.
        digits: of numbers that are not whole, after the point; by default all that they have.
    """
    rows = list(rows)
    header = list(dict.fromkeys(name for row in rows for name in row))
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(header)
    writer.writerows([_cell(row.get(name), digits) for name in header] for row in rows)
    return out.getvalue()


def _cell(value: Any, digits: int | None) -> Any:
    if isinstance(value, float):
        if value != value:
            return ""
        return value if digits is None else f"{value:.{digits}f}"
    return value


def frame_of(table: Mapping[str, Sequence[Any]] | Sequence[Mapping[str, Any]]) -> "pd.DataFrame":
    """A frame of columns by name, or of rows.

    Raises:
        TaskcalError: pandas is not installed.
    """
    try:
        import pandas as pd
    except ImportError as error:
        raise TaskcalError("frames need pandas; install Taskcal with its extra: pandas") from error
    return pd.DataFrame(table)
