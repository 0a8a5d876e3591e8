"""Writing files so that an interrupted write leaves the old one: beside, then renamed."""

import os
import stat
import tempfile
from collections.abc import Mapping
from pathlib import Path

from robot_programs.core.files import PART as PART
from robot_programs.core.files import beside as beside
from robot_programs.core.files import remove_strays
from taskcal.errors import FileError


def write_whole(path: str | Path, content: str | bytes) -> None:
    """Write a file all at once or not at all; a link keeps pointing to the file it names.

    Raises:
        FileError: the folder is missing or not writable, or the file may not be written or is not an ordinary file.
    """
    write_all({path: content})


def write_all(contents: Mapping[str | Path, str | bytes] | Mapping[Path, str | bytes] | Mapping[Path, bytes]) -> None:
    """Write files that belong together: each all at once, and none before all lie ready beside their places.

    Raises:
        FileError: as `write_whole`.
    """
    ready: list[tuple[str | Path, Path, Path]] = []
    begun = False
    try:
        for named, content in contents.items():
            path = Path(named).resolve()
            remove_strays(path)
            ready.append((named, _lay_beside(named, path, content), path))
        begun = True
        _put_in_place(ready)
    except KeyboardInterrupt:
        if begun:  # half of them may be in place already: old and new are not left side by side
            _put_in_place(ready)
        raise
    finally:
        for _, part, _ in ready:
            part.unlink(missing_ok=True)


def to_bytes(content: str | bytes) -> bytes:
    """The bytes of a file's content: text in UTF-8, where a file's name that is not text stands as JSON escapes it."""
    return content.encode("utf-8", "backslashreplace") if isinstance(content, str) else content


def _put_in_place(ready: list[tuple[str | Path, Path, Path]]) -> None:
    """Rename what lies beside, and take it from the list as it is done.

    Raises:
        FileError: a file is held by another program, or the like.
    """
    while ready:
        named, part, path = ready[0]
        if part.exists():  # else it was renamed as the interrupt came
            try:
                os.replace(part, path)
            except OSError as error:
                raise FileError(named, f"cannot be written: {error.strerror or error}") from error
        ready.pop(0)


def _lay_beside(named: str | Path, path: Path, content: str | bytes) -> Path:
    """Write what a file is to hold beside it; returns where."""
    data = to_bytes(content)
    try:
        mode = path.stat().st_mode if path.exists() else None
        if mode is not None and not stat.S_ISREG(mode):
            raise FileError(named, "cannot be written: it is a folder or a device; name a file")
        if mode is not None and not mode & stat.S_IWUSR:
            raise FileError(named, "is write-protected; name another file, or allow writing to it")
        handle, part = tempfile.mkstemp(prefix=beside(path), suffix=PART, dir=path.parent)
    except OSError as error:
        raise FileError(named, f"cannot be written: {error.strerror or error}; name a folder that exists") from error
    try:
        with os.fdopen(handle, "wb") as stream:
            stream.write(data)
        os.chmod(part, 0o666 & ~_umask() if mode is None else mode)
    except OSError as error:
        Path(part).unlink(missing_ok=True)
        raise FileError(named, f"cannot be written: {error.strerror or error}") from error
    except BaseException:
        Path(part).unlink(missing_ok=True)
        raise
    return Path(part)


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
