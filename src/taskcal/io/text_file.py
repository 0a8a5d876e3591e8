"""Reading a file whole: an ordinary one, and no larger than a bound that its reader can lift."""

import io
import json
import os
import stat
from pathlib import Path
from typing import Any

from taskcal.errors import FileError, shown

MAX_FILE_MB = 50.0
"""A campaign of 100 000 rows and 30 columns, or a milling program of a million points, is smaller."""

VARIABLE = "TASKCAL_MAX_FILE_MB"
"""Environment variable that takes the place of every bound."""

_PIECE = 1 << 20


def read_bytes(path: str | Path, largest_mb: float = MAX_FILE_MB) -> bytes:
    """The bytes of a file.

    Args:
        path: the file.
        largest_mb: how large it may be, 10⁶ bytes, unless the environment says otherwise.

    Raises:
        FileError: it is missing, cannot be read, is a folder, a pipe or a device, or is too large.
    """
    bound = _bound(path, largest_mb)
    # one byte more than allowed tells that there is more, even of a file that grows
    most = int(bound * 1e6) + 1
    with open_ordinary(path) as stream:
        try:
            # as much memory is taken as is asked for, however large the bound is
            content = stream.read(min(most, os.fstat(stream.fileno()).st_size + 1))
            while len(content) < most and (more := stream.read(min(_PIECE, most - len(content)))):
                content += more
        except OSError as error:
            raise FileError(path, f"cannot be read: {error.strerror or error}") from error
    if len(content) > bound * 1e6:
        message = f"is larger than {bound:g} MB; is it the right file? If so, set {VARIABLE} to more megabytes"
        raise FileError(path, message)
    return content


def open_ordinary(path: str | Path) -> io.BufferedReader:
    """A file open for reading bytes.

    Raises:
        FileError: it is missing, cannot be read, is a folder, a pipe or a device.
    """
    try:
        # a pipe nobody writes to would hold up an ordinary open
        handle = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0))
    except OSError as error:
        raise FileError(path, f"cannot be read: {error.strerror or error}") from error
    except ValueError as error:
        raise FileError(repr(str(path)), f"cannot be read: {error}; name a file") from error
    mode = os.fstat(handle).st_mode
    if stat.S_ISREG(mode):
        return os.fdopen(handle, "rb")
    os.close(handle)
    what = "Is a directory" if stat.S_ISDIR(mode) else "it is a pipe or a device; write what it gives into a file first"
    raise FileError(path, f"cannot be read: {what}")


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


def _bound(path: str | Path, largest_mb: float) -> float:
    stated = os.environ.get(VARIABLE)
    if stated is None:
        return largest_mb
    try:
        bound = float(stated)
    except ValueError:
        bound = 0.0
    if not 0.0 < bound <= 1e6:
        raise FileError(path, f"{VARIABLE} is {stated[:40]!r}; give megabytes above 0 and up to 1e6, such as 200")
    return bound


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
