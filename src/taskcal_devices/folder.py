"""The instrument ``folder``: a file or a folder to which any software appends a line for each measurement, or writes images."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from threading import Event
from time import monotonic
from typing import ClassVar

import numpy as np

from taskcal.errors import FileError
from taskcal.live.devices import DeviceError, Instrument, Shot
from taskcal.live.lines import KindColumns, Lines, PointColumns, columns_of
from taskcal.observations.camera import determines_pose
from taskcal.observations.instrument import Instrument as CellInstrument
from taskcal.observations.instrument import LookedFor
from taskcal.reading import detection
from taskcal.reading.pictures import Corners, stem_of
from taskcal_devices.network import Feed
from taskcal_groundwork.said import Said

SUFFIXES = frozenset({".asc", ".csv", ".dat", ".log", ".pts", ".txt", ".xyz"})
"""Of the files of a folder that are read."""

POLL_S = 0.05
"""Between two looks at the files, seconds. A convention: far below the time that a measurement takes."""


WRITTEN_S = 0.3
"""For which an image has to keep its size before it is read, seconds: six looks. A convention."""


@dataclass(kw_only=True)
class _Image:
    """A file of an image, as it was at the last look."""

    stamp: tuple[int, int]
    """Size, and when it was written."""
    since_s: float
    """When it was first so."""
    begun_s: float
    """When it came."""
    done: bool = False


@dataclass
class _Followed:
    """A file, and how far it was read."""

    read: int
    """Bytes."""
    lines: Lines


class Folder(Instrument):
    """Waits for whole lines, or images; what was there when it was opened was measured before, and does not count."""

    name: ClassVar[str] = "folder"
    reached: ClassVar[str] = "PATH"
    streams: ClassVar[bool] = False

    def __init__(self, path: Path, columns: PointColumns | KindColumns | None):
        self._path, self._columns = path, columns
        self._files: dict[Path, _Followed] = {}
        self._images: _Images | None = None
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
        """Lines of any kind, or images.

        Raises:
            DeviceError: images are looked for in a file, or by columns.
            TaskcalError: OpenCV is not installed.
        """
        if (looked_for := observed.looked_for) is None:
            return
        if not self._path.is_dir() or self._columns is not None:
            raise DeviceError(
                f"the instrument 'folder' watches a folder for images, without columns, and {self._path} is given"
                f"{'' if self._path.is_dir() else ', which is a file'}; name the folder into which the camera's software writes"
            )
        self.unbidden = True
        self._images = _Images(self._path, looked_for, observed.kind.key)

    def knows(self, images: Sequence[str]) -> None:
        """An image of such a name is refused."""
        if self._images is not None:
            self._images.names.update(map(stem_of, images))

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
            if self._images is not None:
                yield from self._images.look()
                return
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


class _Images:
    """Looks for boards in the images that come into a folder."""

    def __init__(self, folder: Path, looked_for: LookedFor, kind: str):
        self._folder, self._looked_for, self._kind = folder, looked_for, kind
        self._detect = detection.detector(looked_for.boards)
        (board,) = looked_for.boards
        self._places = dict(zip(board.ids().tolist(), board.corners()[:, :2], strict=True))
        self._files: dict[Path, _Image] = {}
        self.names, self._edges = set[str](), list[float]()
        for path, stamp in self._there():
            self._files[path] = _Image(stamp=stamp, since_s=0.0, begun_s=0.0, done=True)
            self.names.add(stem_of(path.name))

    def look(self) -> Iterator[Shot]:
        """The images that have become whole since the look before."""
        for path, stamp in self._there():
            now, file = monotonic(), self._files.get(path)
            if file is None or file.stamp != stamp:
                begun = now if file is None or file.done else file.begun_s
                self._files[path] = _Image(stamp=stamp, since_s=now, begun_s=begun)
            elif not file.done and now - file.since_s >= WRITTEN_S:
                file.done = True
                yield self._shot(path, file.begun_s)

    def _there(self) -> Iterator[tuple[Path, tuple[int, int]]]:
        """Images, and when they were written how large."""
        for path in sorted(self._folder.iterdir()):
            if path.suffix.lower() not in detection.SUFFIXES:
                continue
            try:
                stat = path.stat()
            except FileNotFoundError:
                continue  # renamed, as software does with a file that was not whole
            yield path, (stat.st_size, stat.st_mtime_ns)

    def _shot(self, path: Path, begun_s: float) -> Shot:
        """What an image shows, or why another one is needed."""
        corners = None
        try:
            corners, edge = self._detect(path)
            wrong = self._fault(corners, edge)
        except FileError:
            wrong = Said("{image} is not an image that can be read; take another one", image=path.name)
        if wrong is None:
            self.names.add(stem_of(path.name))
        reason = "" if wrong is None else wrong
        return Shot(time_s=begun_s, point=np.zeros(3), kind=self._kind, reason=reason, corners=corners, wrong=wrong)

    def _fault(self, corners: Corners, edge: float) -> Said | None:
        """What is wrong with an image."""
        (image,), lens = corners.images, self._looked_for.lens
        if stem_of(image) in self.names:
            return Said(
                "{image} was there before under this name; let the camera's software number its images, and take another one",
                image=image,
            )
        if (corners.width, corners.height) != (lens.width, lens.height):
            return Said(
                "{image} has {width} × {height} pixels, and the camera's file {own} × {high}; take another one of that size",
                image=image,
                width=str(corners.width),
                height=str(corners.height),
                own=str(lens.width),
                high=str(lens.height),
            )
        if not all(k in self._places for k in corners.id.tolist()) or not determines_pose(
            np.array([self._places[k] for k in corners.id.tolist()]).reshape(-1, 2)
        ):
            return Said(
                "{image} does not show enough of the board; see that it is lit and in the picture, and take another one",
                image=image,
            )
        if detection.is_blurred(edge, float(np.median(self._edges)) if self._edges else 0.0):
            return Said(
                "{image} is blurred, its edges are {edge:.1f} pixels wide; see that robot, board and focus stand still, and take "
                "another one",
                image=image,
                edge=edge,
            )
        self._edges.append(edge)
        return None
