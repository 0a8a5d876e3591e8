"""Writing files so that an interrupted write leaves the old one: beside, then renamed."""

import os
import stat
import tempfile
from pathlib import Path

from taskcal.errors import FileError


def write_whole(path: str | Path, content: str | bytes) -> None:
    """Write a file all at once or not at all; a link keeps pointing to the file it names.

    Raises:
        FileError: the folder is missing or not writable, or the file may not be written or is no ordinary file.
    """
    named, path = path, Path(path).resolve()
    data = content.encode("utf-8") if isinstance(content, str) else content
    if path.exists() and not path.is_file():
        raise FileError(named, "cannot be written: it is a folder or a device; name a file")
    if path.exists() and not path.stat().st_mode & stat.S_IWUSR:
        raise FileError(named, "is write-protected; name another file, or allow writing to it")
    try:
        handle, beside = tempfile.mkstemp(prefix=f".{path.name}.", dir=path.parent)
    except OSError as error:
        raise FileError(named, f"cannot be written: {error.strerror or error}; name a folder that exists") from error
    try:
        with os.fdopen(handle, "wb") as stream:
            stream.write(data)
        mode = path.stat().st_mode if path.exists() else 0o666 & ~_umask()
        os.chmod(beside, mode)
        os.replace(beside, path)
    except OSError as error:
        Path(beside).unlink(missing_ok=True)
        raise FileError(named, f"cannot be written: {error.strerror or error}") from error
    except BaseException:
        Path(beside).unlink(missing_ok=True)
        raise


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
