"""The instrument ``folder``: a file or a folder to which any tracker software appends a line for each measurement."""

import time
from collections import deque
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import numpy as np

from taskcal.errors import TaskcalError
from taskcal.live.devices import DeviceError, Instrument, Shot
from taskcal.live.lines import Columns, is_header

SUFFIXES = frozenset({".asc", ".csv", ".dat", ".log", ".pts", ".txt", ".xyz"})
"""Of the files of a folder that are read."""

POLL_S = 0.05
"""Between two looks at the files, seconds. A convention: far below the time that a measurement takes."""


@dataclass
class _Followed:
    """A file, and how far it was read."""

    read: int
    """Bytes."""
    columns: Columns | None
    begun: bool = False
    """Whether its first line was read, which may be a header."""


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
        out._look()
        out._shots.clear()
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

    def _look(self) -> None:
        """Take up the lines that were added since the look before, up to the last that is whole.

        Raises:
            DeviceError: the place is gone, a file has become shorter, or a line has no point.
        """
        try:
            within = sorted(self._path.iterdir()) if self._path.is_dir() else [self._path]
            for path in within:
                if path == self._path or (path.suffix.lower() in SUFFIXES and path.is_file()):
                    self._follow(path)
        except OSError as error:
            raise DeviceError(
                f"{self._path} cannot be read any more: {error.strerror or error}; see that it is there, and resume"
            ) from error

    def _follow(self, path: Path) -> None:
        followed = self._files.setdefault(path, _Followed(read=0, columns=self._columns))
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
            if line.strip() and not line.lstrip().startswith(("#", "//")):
                self._take(path, followed, line.strip())
        followed.read += len(whole)

    def _take(self, path: Path, followed: _Followed, line: str) -> None:
        first, followed.begun = not followed.begun, True
        try:
            if followed.columns is None:
                followed.columns = Columns.of(line)
                return
            if first and is_header(line):
                return
            point = followed.columns.point(line)
        except TaskcalError as error:
            raise DeviceError(f"{path}: {error}") from None
        lost = "" if np.isfinite(point).all() else "beam lost"
        self._shots.append(Shot(time_s=time.monotonic(), point=point, reason=lost))
