"""The instrument ``folder``: a file or a folder to which any tracker software appends a line for each measurement."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from threading import Event
from time import monotonic
from typing import ClassVar

from taskcal.live.devices import DeviceError, Instrument, Shot
from taskcal.live.lines import Columns, KindColumns, Lines, columns_of
from taskcal.live.network import Feed
from taskcal.observations.instrument import Instrument as CellInstrument

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

    def __init__(self, path: Path, columns: Columns | KindColumns | None):
        self._path, self._columns = path, columns
        self._files: dict[Path, _Followed] = {}
        self._closed = Event()
        for _ in self._look(old=True):
            pass
        self._feed = Feed(self._added(), self._closed.set)

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
        return cls(path, columns_of(columns) if columns else None)

    def observes(self, observed: CellInstrument) -> None:
        """Lines of any kind."""

    def read(self, timeout_s: float) -> Shot | None:
        """The next line that was added, stamped when it was."""
        return self._feed.next(timeout_s)

    def close(self) -> None:
        """Watch no longer."""
        self._feed.close()

    def _added(self) -> Iterator[Shot]:
        while not self._closed.wait(POLL_S):
            yield from self._look()

    def _look(self, *, old: bool = False) -> Iterator[Shot]:
        """Take up the lines that were added since the look before, up to the last that is whole.

        Raises:
            DeviceError: the place is gone, a file has become shorter, or a line has no point.
        """
        try:
            within = sorted(self._path.iterdir()) if self._path.is_dir() else [self._path]
            for path in within:
                if path == self._path or (path.suffix.lower() in SUFFIXES and path.is_file()):
                    yield from self._follow(path, old=old)
        except OSError as error:
            raise DeviceError(
                f"{self._path} cannot be read any more: {error.strerror or error}; see that it is there, and resume"
            ) from error

    def _follow(self, path: Path, *, old: bool) -> Iterator[Shot]:
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
        followed.read += len(whole)
        for line in whole.decode("utf-8-sig", "replace").splitlines():
            if shot := followed.lines.shot(line, monotonic(), old=old):
                yield shot
