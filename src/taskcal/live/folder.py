"""The instrument ``folder``: a file or a folder to which any tracker software appends a line for each measurement."""

import time
from collections import deque
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

from taskcal.live.devices import DeviceError, Instrument, Shot
from taskcal.live.lines import Columns, Lines

SUFFIXES = frozenset({".asc", ".csv", ".dat", ".log", ".pts", ".txt", ".xyz"})
"""Of the files of a folder that are read."""

POLL_S = 0.05
"""Between two looks at the files, seconds. A convention: far below the time that a measurement takes."""


@dataclass
class _Followed:
    """A file, and how far it was read."""

    read: int
    """Bytes."""
    lines: Lines


class Folder(Instrument):
    """Waits for whole lines; what was there when it was opened was measured before, and does not count."""

    name: ClassVar[str] = "folder"
    reached: ClassVar[str] = "PATH"
    streams: ClassVar[bool] = False

    def __init__(self, path: Path, columns: Columns | None):
        self._path, self._columns = path, columns
        self._files: dict[Path, _Followed] = {}
        self._shots: deque[Shot] = deque()

    @classmethod
    def open(cls, address: str | None, timeout_s: float, columns: str = "") -> "Folder":
        """Begin to watch a file or a folder.

        Raises:
            DeviceError: there is none.
            TaskcalError: columns that name no point.
        """
        if not address or not (path := Path(address)).exists():
            raise DeviceError(
                f"the instrument 'folder' watches a file or a folder, and '{address or ''}' is none; state the one that the "
                "tracker's software writes to (--instrument-address)"
            )
        out = cls(path, Columns.of(columns) if columns else None)
        out._look(old=True)
        return out

    def read(self, timeout_s: float) -> Shot | None:
        """The next line that was added."""
        until = time.monotonic() + timeout_s
        while not self._shots:
            self._look()
            if not self._shots:
                if time.monotonic() >= until:
                    return None
                time.sleep(POLL_S)
        return self._shots.popleft()

    def close(self) -> None:
        """Nothing is open between two looks."""

    def _look(self, *, old: bool = False) -> None:
        """Take up the lines that were added since the look before, up to the last that is whole.

        Raises:
            DeviceError: the place is gone, a file has become shorter, or a line has no point.
        """
        try:
            within = sorted(self._path.iterdir()) if self._path.is_dir() else [self._path]
            for path in within:
                if path == self._path or (path.suffix.lower() in SUFFIXES and path.is_file()):
                    self._follow(path, old=old)
        except OSError as error:
            raise DeviceError(
                f"{self._path} cannot be read any more: {error.strerror or error}; see that it is there, and resume"
            ) from error

    def _follow(self, path: Path, *, old: bool) -> None:
        followed = self._files.setdefault(path, _Followed(read=0, lines=Lines(self._columns, str(path))))
        size = path.stat().st_size
        if size < followed.read:
            raise DeviceError(
                f"{path} has become shorter: its software does not append to it; let it append, or write new files"
            )
        if size == followed.read:
            return
        with path.open("rb") as file:
            file.seek(followed.read)
            added = file.read()
        whole = added[: added.rfind(b"\n") + 1]
        for line in whole.decode("utf-8-sig", "replace").splitlines():
            if shot := followed.lines.shot(line, time.monotonic(), old=old):
                self._shots.append(shot)
        followed.read += len(whole)
