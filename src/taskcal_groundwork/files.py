"""Files on the way in: no larger than a bound that their reader can lift, and zip files."""

import io
import os
import re
import stat
import zipfile
import zlib
from collections.abc import Generator, Iterator
from contextlib import contextmanager
from copy import copy
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from taskcal_groundwork.errors import FileError, shown
from taskcal_groundwork.writing import finish_writing

# Ordinary files, no larger than a bound that their reader can lift.


MAX_FILE_MB = 50.0
"""A campaign of 100 000 rows and 30 columns, or a milling program of a million points, is smaller."""

VARIABLE = "TASKCAL_MAX_FILE_MB"
"""Environment variable that takes the place of every bound."""

_PIECE = 1 << 20

ZIP = ".zip"
"""Suffix of zip files."""

_DEVICE = re.compile(r"(con|prn|aux|nul|com[0-9¹²³]|lpt[0-9¹²³])(\.|$)", re.IGNORECASE)
"""Names of devices, whatever follows a dot (Microsoft, "Naming Files, Paths, and Namespaces")."""


def elsewhere_on_windows(name: str) -> str:
    """Why Windows would write elsewhere than to a file of this name, without an error; empty where it would not."""
    if _DEVICE.match(name):
        return "it is a device of Windows"
    if name != name.rstrip(" ."):
        return "Windows leaves out the dot or space at its end"
    if ":" in name:
        return "Windows takes what follows ':' for a hidden stream of another file"
    return ""


def is_backup(path: Path) -> bool:
    """Whether a path is a folder or a zip file."""
    return path.suffix.lower() == ZIP or path.is_dir()


def read_bytes(path: str | Path, largest_mb: float = MAX_FILE_MB) -> bytes:
    """The bytes of a file.

    Args:
        path: the file.
        largest_mb: how large it may be, 10⁶ bytes, unless the environment says otherwise.

    Raises:
        FileError: it is missing, cannot be read, is a folder, a pipe or a device, or is too large.
    """
    bound = _bound(path, largest_mb)
    # one byte more than allowed tells that there is more, even of a file that grows
    most = int(bound * 1e6) + 1
    with open_ordinary(path) as stream:
        try:
            # as much memory is taken as is asked for, however large the bound is
            content = stream.read(min(most, os.fstat(stream.fileno()).st_size + 1))
            while len(content) < most and (more := stream.read(min(_PIECE, most - len(content)))):
                content += more
        except OSError as error:
            raise FileError(path, f"cannot be read: {error.strerror or error}") from error
    if len(content) > bound * 1e6:
        message = f"is larger than {bound:g} MB; is it the right file? If so, set {VARIABLE} to more megabytes"
        raise FileError(path, message)
    return content


def open_ordinary(path: str | Path) -> io.BufferedReader:
    """A file open for reading bytes; what was written with it is in place, too, if whoever wrote it was killed.

    Raises:
        FileError: it is missing, cannot be read, is a folder, a pipe or a device.
    """
    finish_writing(Path(os.path.realpath(path)).parent if "\0" not in str(path) else Path())
    try:
        # a pipe nobody writes to would hold up an ordinary open
        handle = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0))
    except OSError as error:
        raise FileError(path, f"cannot be read: {error.strerror or error}") from error
    except ValueError as error:
        raise FileError(repr(str(path)), f"cannot be read: {error}; name a file") from error
    mode = os.fstat(handle).st_mode
    if stat.S_ISREG(mode):
        return os.fdopen(handle, "rb")
    os.close(handle)
    what = "Is a directory" if stat.S_ISDIR(mode) else "it is a pipe or a device; write what it gives into a file first"
    raise FileError(path, f"cannot be read: {what}")


def _bound(path: str | Path, largest_mb: float) -> float:
    stated = os.environ.get(VARIABLE)
    if stated is None:
        return largest_mb
    try:
        bound = float(stated)
    except ValueError:
        bound = 0.0
    if not 0.0 < bound <= 1e6:
        raise FileError(path, f"{VARIABLE} is {stated[:40]!r}; give megabytes above 0 and up to 1e6, such as 200")
    return bound


# Zip files that people hand in, read so that a hostile one costs neither time nor memory and names no place outside it.


METHODS = {zipfile.ZIP_STORED: "stored", zipfile.ZIP_DEFLATED: "Deflate"}
"""How an entry may be packed: the two methods of ISO/IEC 21320-1, "Document Container File". `zipfile` unpacks BZIP2 and LZMA too,
but not piece by piece: a kilobyte of them becomes gigabytes in memory before the first byte can be counted."""

OTHER_METHODS = {
    1: "Shrink", 6: "Implode", 9: "Deflate64", 12: "BZIP2", 14: "LZMA", 93: "Zstandard", 95: "XZ", 98: "PPMd", 99: "AES encryption",
}  # fmt: skip
"""Names of other methods in use, after PKWARE's APPNOTE 6.3.10, 4.4.5."""

ENCRYPTED = 0x1 | 0x40 | 0x2000
"""Flags of an entry that needs a password, is strongly encrypted, or whose directory is (APPNOTE 4.4.4)."""
PATCH = 0x20
"""Flag of an entry that is a patch to a file that is not in it."""

PACK_AGAIN = "pack the files again, as an ordinary zip file without a password"

_DIRECTORY_BYTES = 400
"""Of an entry in the directory, with a long name and all dates: more than one needs on average."""
_END, _END_BYTES = b"PK\x05\x06", 22
_END_64, _END_64_BYTES = b"PK\x06\x06", 56
_FAR = 0xFFFFFFFF
"""In place of a size that stands in the larger record."""


@dataclass(frozen=True, kw_only=True)
class ZipKind:
    """Kind of a zip file, and bounds on its size."""

    name: str = "zip file"
    """For messages."""
    remedy: str = PACK_AGAIN
    """For one that is damaged, packed unusually or too large."""
    most_entries: int
    largest_mb: float
    """All entries together, unpacked, 10⁶ bytes."""
    small_mb: float
    """What a file of any size may unpack to."""
    most_ratio: float
    """How many times its own size a file may unpack to beyond that."""
    largest_entry_mb: float
    """An entry that is read whole."""

    def unpacked_mb(self, size: int) -> float:
        """Bound on the unpacked size of a zip file of so many bytes, 10⁶ bytes."""
        return min(self.largest_mb, self.small_mb + self.most_ratio * size / 1e6)


@dataclass(frozen=True, eq=False)
class ZipEntry:
    """A file or a folder in a zip file."""

    name: str
    """Its place in the file, with forward slashes as some packers on Windows do not write them; a folder's ends with one."""
    info: zipfile.ZipInfo

    @property
    def is_folder(self) -> bool:
        """Whether it has no contents of its own."""
        return self.name.endswith("/")

    @property
    def is_link(self) -> bool:
        """Whether it names another place, as packers on Linux write it."""
        return stat.S_ISLNK(self.info.external_attr >> 16)


class OpenZip:
    """A zip file whose entries were all checked and can be read."""

    def __init__(self, path: Path, kind: ZipKind, packed: zipfile.ZipFile, size: int):
        self.path, self.kind, self._packed = path, kind, packed
        self.entries = _checked_entries(path, kind, packed, size)

    def read(self, entry: ZipEntry) -> bytes:
        """An entry whole.

        Raises:
            FileError: it is too large, or as `pieces`.
        """
        if entry.info.file_size > self.kind.largest_entry_mb * 1e6:
            most = f"{self.kind.largest_entry_mb:g} MB"
            raise FileError(self.path / shown(entry.name), f"has more than {most}; make it smaller, or leave it out")
        return b"".join(self.pieces(entry))

    def pieces(self, entry: ZipEntry, size: int = _PIECE) -> Iterator[bytes]:
        """An entry piece by piece, no more of it than it says it has.

        Raises:
            FileError: it is a link, damaged, or has more or fewer bytes than it says.
        """
        place = self.path / shown(entry.name)
        if entry.is_link:
            raise FileError(place, "is a link, which is not followed; put the file in its place")
        stated, count = entry.info.file_size, 0
        further = copy(entry.info)
        further.file_size += _PIECE  # zipfile ends in silence where the stated size does, whatever follows
        try:
            with self._packed.open(further) as stream:
                while piece := stream.read(size):
                    count += len(piece)
                    if count > stated:
                        raise FileError(place, f"unpacks to more than the {stated} bytes it states; {self.kind.remedy}")
                    yield piece
        except _DAMAGED as error:
            raise FileError(
                place, f"is damaged in the {self.kind.name} ({shown(error)}); {self.kind.remedy}"
            ) from error
        if count < stated:
            raise FileError(place, f"unpacks to {count} bytes and states {stated}; {self.kind.remedy}")


_DAMAGED = (zipfile.BadZipFile, zlib.error, EOFError, UnicodeDecodeError, OSError)
"""What reading an entry raises: for a header that does not agree with the directory or a sum that does not with the contents; for
contents that do not unpack; for those that end too soon; for a name that is not in the encoding that it states; for a disk."""

_INCONSISTENT = (zipfile.BadZipFile, ValueError, OSError)
"""What reading the directory raises: where it does not agree with itself; for names that are not in the encoding they state and,
in early releases of Python 3.11, for places before the file; for a disk."""


@contextmanager
def open_zip(path: Path, kind: ZipKind, content: bytes | None = None) -> Generator[OpenZip]:
    """Open a zip file and check all that it lists; nothing is unpacked yet.

    Args:
        path: of the file; where the content is given, for messages alone.
        kind: what it should be.
        content: its bytes, if they are known already.

    Raises:
        FileError: it cannot be read or is damaged; it lists too many entries, two of one name, or names that lead out of it; one is
            encrypted or packed in another way than `METHODS`; or it would unpack to too much.
    """
    with open_ordinary(path) if content is None else io.BytesIO(content) as stream:
        size = stream.seek(0, os.SEEK_END)
        _check_directory(path, kind, stream, size)
        try:
            packed = zipfile.ZipFile(stream)
        except NotImplementedError as error:
            raise FileError(path, f"is a {kind.name} of a later version ({shown(error)}); {kind.remedy}") from error
        except _INCONSISTENT as error:
            raise FileError(path, f"is a damaged {kind.name} ({shown(error)}); {kind.remedy}") from error
        with packed:
            yield OpenZip(path, kind, packed, size)


def _check_directory(path: Path, kind: ZipKind, stream: io.BufferedIOBase, size: int) -> None:
    """See that the directory, which is read whole before its entries can be counted, is not too large.

    Raises:
        FileError: it is.
    """
    stream.seek(max(size - 0xFFFF - _END_BYTES - _END_64_BYTES - 20, 0))
    tail = stream.read()
    end = tail.rfind(_END)
    directory = int.from_bytes(tail[end + 12 : end + 16], "little") if end >= 0 else 0
    if directory == _FAR and (far := tail.rfind(_END_64, 0, end)) >= 0:
        directory = int.from_bytes(tail[far + 40 : far + 48], "little")
    if directory > _DIRECTORY_BYTES * kind.most_entries:
        raise FileError(path, f"holds more than {kind.most_entries} files, too many for a {kind.name}; {kind.remedy}")


def _checked_entries(path: Path, kind: ZipKind, packed: zipfile.ZipFile, size: int) -> tuple[ZipEntry, ...]:
    """Entries of a zip file.

    Raises:
        FileError: as `open_zip`.
    """
    infos = packed.infolist()
    if len(infos) > kind.most_entries:
        raise FileError(path, f"holds more than {kind.most_entries} files, too many for a {kind.name}; {kind.remedy}")
    unpacked, most = sum(info.file_size for info in infos) / 1e6, kind.unpacked_mb(size)
    if unpacked > most:
        raise FileError(path, f"unpacks to {unpacked:.0f} MB, more than {most:.0f} MB; {kind.remedy}")
    entries: dict[str, ZipEntry] = {}
    for info in infos:
        name = _checked_name(path, info)
        _check_packing(path, kind, name, info, size)
        if name.casefold() in entries:
            raise FileError(path, f"holds two files of the name '{shown(name)}'; {kind.remedy}")
        entries[name.casefold()] = ZipEntry(name, info)
    return tuple(entries.values())


def _checked_name(path: Path, info: zipfile.ZipInfo) -> str:
    """An entry's name with forward slashes.

    Raises:
        FileError: it is not a place in the file.
    """
    # `filename` ends at a NUL; what follows it is what another program may go by
    name = info.orig_filename.replace("\\", "/")
    place = PurePosixPath(name)
    if not name or "\0" in name or name[1:2] == ":" or place.is_absolute() or ".." in place.parts:
        raise FileError(path, f"holds a file of the name '{shown(name)}', which leads out of it; take it out")
    return f"{place}/" if name.endswith("/") else str(place)


def _check_packing(path: Path, kind: ZipKind, name: str, info: zipfile.ZipInfo, size: int) -> None:
    """See that an entry can be read.

    Raises:
        FileError: it is encrypted, packed in another way, or lies elsewhere than in the file.
    """
    place = path / shown(name)
    if info.flag_bits & ENCRYPTED:
        raise FileError(place, f"is encrypted; {PACK_AGAIN}")
    if info.flag_bits & PATCH:
        raise FileError(place, f"is a patch to another file (flag 5); {PACK_AGAIN}")
    if info.compress_type not in METHODS:
        method = OTHER_METHODS.get(info.compress_type, "unknown")
        known = " or ".join(METHODS.values())
        raise FileError(
            place,
            f"is packed by method {info.compress_type} ({method}); pack the files again, {known}, as an ordinary zip file is",
        )
    if info.compress_type == zipfile.ZIP_STORED and info.compress_size != info.file_size:
        stated = f"it states {info.file_size} bytes and has {info.compress_size}"
        raise FileError(place, f"is damaged in the {kind.name} ({stated}); {kind.remedy}")
    if not 0 <= info.header_offset <= size - info.compress_size:
        raise FileError(place, f"is damaged in the {kind.name} (it lies outside the file); {kind.remedy}")
