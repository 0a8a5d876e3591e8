"""Files of text, read whole."""

from pathlib import Path

from taskcal.errors import FileError
from taskcal_groundwork.files import MAX_FILE_MB as MAX_FILE_MB
from taskcal_groundwork.files import VARIABLE as VARIABLE
from taskcal_groundwork.files import open_ordinary as open_ordinary
from taskcal_groundwork.files import read_bytes as read_bytes


def read_text(
    path: str | Path, largest_mb: float = MAX_FILE_MB, *, encoding: str = "utf-8", otherwise: str = "is not UTF-8 text"
) -> str:
    """The text of a file, line ends as Python has them.

    Args:
        path: the file.
        largest_mb: as of `read_bytes`.
        encoding: of the text; ``utf-8-sig`` for UTF-8 with or without a byte order mark.
        otherwise: what to say of a file in another encoding.

    Raises:
        FileError: as of `read_bytes`, or it is not in this encoding.
    """
    try:
        text = read_bytes(path, largest_mb).decode(encoding)
    except UnicodeDecodeError as error:
        raise FileError(path, otherwise) from error
    return text.replace("\r\n", "\n").replace("\r", "\n")
