"""A folder that one process at a time may write in."""

import json
import os
import sys
from pathlib import Path
from typing import IO

from taskcal.errors import FileError

NAME = ".studio.lock"


class FolderLock:
    """A lock that the system gives back when its process ends, however it ends."""

    def __init__(self, folder: Path) -> None:
        """Take the lock.

        Raises:
            FileError: another process has it, or the folder is not ours to write in.
        """
        self._path = folder / NAME
        try:
            self._stream: IO[str] = open(self._path, "a+", encoding="utf-8")  # noqa: SIM115  # held open as long as the lock
        except OSError as error:
            raise FileError(folder, f"cannot be opened for writing: {error.strerror or error}") from error
        if not _take(self._stream):
            holder = self._holder()
            self._stream.close()
            raise FileError(
                folder, f"is open in another studio already{holder}; close that one first, or open another folder"
            )
        self.tell("")

    def tell(self, address: str) -> None:
        """Say in the lock who has it, for whoever comes second."""
        self._stream.seek(0)
        self._stream.truncate()
        json.dump({"process": os.getpid(), "address": address}, self._stream)
        self._stream.flush()

    def release(self) -> None:
        """Give the lock back. The file stays: taking it away could take away the lock of the next."""
        self._stream.close()

    def _holder(self) -> str:
        try:
            self._stream.seek(0)
            said = json.load(self._stream)
            address = f", {said['address']}" if said["address"] else ""
            return f" (process {int(said['process'])}{address})"
        except (OSError, ValueError, KeyError, TypeError):
            return ""


if sys.platform == "win32":
    import msvcrt

    def _take(stream: IO[str]) -> bool:
        """Lock a byte far behind the text, so that others can read who has it."""
        stream.seek(1 << 30)
        try:
            msvcrt.locking(stream.fileno(), msvcrt.LK_NBLCK, 1)
        except OSError:
            return False
        return True
else:
    import fcntl

    def _take(stream: IO[str]) -> bool:
        try:
            fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            return False
        return True
