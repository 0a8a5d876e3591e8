"""Files of text and JSON, read whole."""

import json
from pathlib import Path
from typing import Any

from robot_programs.core.files import MAX_FILE_MB as MAX_FILE_MB
from robot_programs.core.files import VARIABLE as VARIABLE
from robot_programs.core.files import open_ordinary as open_ordinary
from robot_programs.core.files import read_bytes as read_bytes
from taskcal.errors import FileError, shown


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


def read_versioned(
    path: str | Path, what: str, marker: str, version: int, command: str, *, cut_off: str | None = None
) -> dict[str, Any]:
    """The content of a JSON file that states its format and the version of it; only these are looked at.

    Args:
        path: the file.
        what: it should be, for messages, such as ``calibration``.
        marker: that it has as ``format``.
        version: of the format, the only one that is read.
        command: of taskcal that writes one.
        cut_off: what to do about a file that is not whole; to repeat the command by default.

    Raises:
        FileError: it cannot be read, is not JSON, or is of another format or version.
    """
    text = read_text(path, otherwise=f"is not a {what}: it is not UTF-8 text")
    try:
        data = json.loads(text)
    except RecursionError as error:
        raise FileError(path, f"is not a {what}: its JSON is nested too deeply") from error
    except json.JSONDecodeError as error:
        message = f"is not a whole JSON file; it may have been cut off: {cut_off or f'{command} again'}"
        raise FileError(path, message, line=error.lineno) from error
    except ValueError as error:
        raise FileError(path, f"is not a {what}: a number has too many digits") from error
    if not isinstance(data, dict) or data.get("format") != marker:
        raise FileError(
            path, f"is JSON, but not a {what}: 'format' is not '{marker}'; write one with taskcal {command}"
        )
    stated = data.get("format_version")
    if type(stated) is not int or stated != version:
        raise FileError(
            path,
            f"has format version {shown(repr(stated))}, this Taskcal reads {version}; {command} again, or use the Taskcal that "
            "wrote it",
        )
    return data
