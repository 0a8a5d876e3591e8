"""Writing files so that an interrupted write leaves the old one: beside, then renamed."""

import os
import tempfile
from pathlib import Path

from taskcal.errors import FileError


def write_whole(path: str | Path, content: str | bytes) -> None:
    """Write a file all at once or not at all.

    Raises:
        FileError: the folder is missing or not writable.
    """
    path = Path(path)
    data = content.encode("utf-8") if isinstance(content, str) else content
    try:
        handle, beside = tempfile.mkstemp(prefix=f".{path.name}.", dir=path.parent)
    except OSError as error:
        raise FileError(path, f"cannot be written: {error.strerror or error}; name a folder that exists") from error
    try:
        with os.fdopen(handle, "wb") as stream:
            stream.write(data)
        mode = path.stat().st_mode if path.exists() else 0o666 & ~_umask()
        os.chmod(beside, mode)
        os.replace(beside, path)
    except OSError as error:
        Path(beside).unlink(missing_ok=True)
        raise FileError(path, f"cannot be written: {error.strerror or error}") from error
    except BaseException:
        Path(beside).unlink(missing_ok=True)
        raise


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
