"""Writing files: all or none, also if the process is killed in between; and by one process at a time."""

import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import IO

from taskcal_groundwork.writing import Laid as Laid
from taskcal_groundwork.writing import finish_writing as finish_writing
from taskcal_groundwork.writing import write_together


def write_whole(path: str | Path, content: str | bytes) -> None:
    """Write a file all at once or not at all; a link keeps pointing to the file it names.

    Raises:
        FileError: the folder is missing or not writable, or the file may not be written or is not an ordinary file.
    """
    write_all({path: content})


def write_all(
    contents: Mapping[str | Path, str | bytes] | Mapping[Path, str | bytes] | Mapping[Path, bytes],
    lay: Callable[[], Laid] | None = None,
) -> None:
    """Write files that belong together, all or none.

    Args:
        contents: of each file.
        lay: lays another file or folder beside its place, which is put there with them.

    Raises:
        FileError: as `write_whole`, and what `lay` raises.
    """
    write_together({named: to_bytes(content) for named, content in contents.items()}, lay)


def to_bytes(content: str | bytes) -> bytes:
    """The bytes of a file's content: text in UTF-8, where a file's name that is not text stands as JSON escapes it."""
    return content.encode("utf-8", "backslashreplace") if isinstance(content, str) else content


if sys.platform == "win32":
    import msvcrt

    def take_lock(stream: IO[str]) -> bool:
        """Lock an open file until it is closed, however its process ends; False where another has it.

        It is a byte far behind the text, so that others can read and append.
        """
        stream.seek(1 << 30)
        try:
            msvcrt.locking(stream.fileno(), msvcrt.LK_NBLCK, 1)
        except OSError:
            return False
        return True
else:
    import fcntl

    def take_lock(stream: IO[str]) -> bool:
        """Lock an open file until it is closed, however its process ends; False where another has it."""
        try:
            fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            return False
        return True
