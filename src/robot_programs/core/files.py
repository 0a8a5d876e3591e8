"""Files on the way in and out: ordinary ones, no larger than a bound that their reader can lift; and what lies beside a place."""

import io
import os
import platform
import re
import shutil
import stat
import time
from contextlib import suppress
from pathlib import Path

from robot_programs.core.errors import FileError

MAX_FILE_MB = 50.0
"""A campaign of 100 000 rows and 30 columns, or a milling program of a million points, is smaller."""

VARIABLE = "TASKCAL_MAX_FILE_MB"
"""Environment variable that takes the place of every bound."""

_PIECE = 1 << 20

ZIP = ".zip"
"""Suffix of zip files."""


def is_backup(path: Path) -> bool:
    """Whether a path is a folder or a zip file."""
    return path.suffix.lower() == ZIP or path.is_dir()


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


# What is written beside its place before it is put there, so that an interrupted write leaves the old one.

PART = ".part"
"""Ending of a file that lies beside its place."""
NAME_BYTES = 120
"""Of a file's name that its name beside begins with: file systems take 255, its process and machine come behind."""

HOUR = 3600.0
"""Seconds after which a file laid beside by another machine is taken for a stray."""


def beside(path: Path) -> str:
    """How the name begins of what this process lays beside a file or a folder; it ends in `PART`."""
    return f".{_short(path)}.{os.getpid()}-{_machine()}."


def remove_strays(path: Path) -> None:
    """Remove what processes that were killed left beside a file or a folder; those that still run keep theirs."""
    pattern = re.compile(rf"\.{re.escape(_short(path))}\.(\d+)-(.*)\.[^.]*\{PART}")
    with suppress(OSError):
        for stray in path.parent.iterdir():
            match = pattern.fullmatch(stray.name)
            if match and not _may_run(int(match[1]), match[2], stray):
                if stray.is_dir():
                    shutil.rmtree(stray, ignore_errors=True)
                else:
                    stray.unlink(missing_ok=True)


def _short(path: Path) -> str:
    return os.fsencode(path.name)[:NAME_BYTES].decode("utf-8", "ignore")


def _may_run(process: int, machine: str, stray: Path) -> bool:
    """Whether the process that laid a file beside may still be at it."""
    if machine == _machine() and os.name == "posix":
        try:
            os.kill(process, 0)
        except ProcessLookupError:
            return False
        except OSError:
            return True
        return True
    return time.time() - stray.stat().st_mtime < HOUR


def _machine() -> str:
    return re.sub(r"[^\w-]", "-", platform.node())[:40]
