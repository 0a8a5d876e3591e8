"""Writing files so that an interrupted write leaves the old one: beside, then renamed."""

import os
import stat
import tempfile
from collections.abc import Mapping
from pathlib import Path

from taskcal.errors import FileError


def write_whole(path: str | Path, content: str | bytes) -> None:
    """Write a file all at once or not at all; a link keeps pointing to the file it names.

    Raises:
        FileError: the folder is missing or not writable, or the file may not be written or is no ordinary file.
    """
    write_all({path: content})


def write_all(contents: Mapping[str | Path, str | bytes] | Mapping[Path, bytes]) -> None:
    """Write files that belong together: each all at once, and none before all lie ready beside their places.

    Raises:
        FileError: as `write_whole`.
    """
    ready: list[tuple[str | Path, Path, Path]] = []
    try:
        for named, content in contents.items():
            path = Path(named).resolve()
            ready.append((named, _lay_beside(named, path, content), path))
        while ready:
            named, beside, path = ready[0]
            try:
                os.replace(beside, path)
            except OSError as error:
                raise FileError(named, f"cannot be written: {error.strerror or error}") from error
            ready.pop(0)
    finally:
        for _, beside, _ in ready:
            beside.unlink(missing_ok=True)


def _lay_beside(named: str | Path, path: Path, content: str | bytes) -> Path:
    """Write what a file is to hold beside it; returns where."""
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
        os.chmod(beside, path.stat().st_mode if path.exists() else 0o666 & ~_umask())
    except OSError as error:
        Path(beside).unlink(missing_ok=True)
        raise FileError(named, f"cannot be written: {error.strerror or error}") from error
    except BaseException:
        Path(beside).unlink(missing_ok=True)
        raise
    return Path(beside)


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
