"""Writing files that belong together: all or none, on the disk once it is done, also if the process is killed in between.

Each file is laid beside its place, and renamed when all are there. One rename is atomic; for several the folders get a journal:

1. New files (``.NAME.PROCESS-MACHINE.RANDOM.part``), and links to the old ones (``…-old.part``), are laid beside their places.
2. Each folder gets a journal (``.journal.….part``) that names all renames and the mark that decides.
3. The mark (``.mark.….part``, in the first folder) is made: from here on the new files count, before it the old ones.
4. Files are renamed; then journals are removed, then the mark, then the links.

Every step is on the disk before the next one begins. Whoever reads or writes in a folder with a journal first finishes it: forward
where the mark is there, else back. A rename that fails takes the mark away, and goes back.
"""

import errno
import json
import os
import platform
import re
import shutil
import stat
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from taskcal_groundwork.errors import FileError

# What is written beside its place before it is put there.

PART = ".part"
"""Ending of a file that lies beside its place."""
NAME_BYTES = 120
"""Of a file's name that its name beside begins with: file systems take 255, its process and machine come behind."""

HOUR = 3600.0
"""Seconds after which a file laid beside by another machine is taken for a stray."""


def beside(path: Path) -> str:
    """Beginning of the name of a file that this process lays beside a file or a folder; it ends in `PART`."""
    return f".{_short(path)}.{os.getpid()}-{_machine()}."


def remove_strays(path: Path) -> None:
    """Remove what processes that were killed left beside a file or a folder; those that still run keep theirs."""
    pattern = re.compile(rf"\.{re.escape(_short(path))}\.(\d+)-(.*)\.[^.]*\{PART}")
    with suppress(OSError):
        for stray in path.parent.iterdir():
            match = pattern.fullmatch(stray.name)
            if match and not _may_run(int(match[1]), match[2], stray):
                if stray.is_dir():
                    shutil.rmtree(stray, ignore_errors=True)
                else:
                    stray.unlink(missing_ok=True)


def _short(path: Path) -> str:
    return os.fsencode(path.name)[:NAME_BYTES].decode(sys.getfilesystemencoding(), "ignore")


def _may_run(process: int, machine: str, stray: Path) -> bool:
    """Whether the process that laid a file beside may still be at it."""
    if machine == _machine() and os.name == "posix":
        try:
            os.kill(process, 0)
        except ProcessLookupError:
            return False
        except OSError:
            return True
        return True
    return time.time() - stray.stat().st_mtime < HOUR


def _machine() -> str:
    return re.sub(r"[^\w-]", "-", platform.node())[:40]


def sync(path: Path) -> None:
    """See a file, or the names in a folder, onto the disk."""
    if path.is_dir() and os.name != "posix":
        return  # Windows opens no folder
    handle = os.open(path, os.O_RDONLY if path.is_dir() else os.O_RDWR)
    try:
        os.fsync(handle)
    except OSError as error:
        if error.errno not in (errno.EINVAL, errno.ENOTSUP):  # file systems that know no such thing
            raise
    finally:
        os.close(handle)


@dataclass(frozen=True)
class Laid:
    """A file or a folder that lies beside its place."""

    named: str | Path
    """The place as the caller names it, for messages."""
    part: Path
    path: Path
    """The place, through links."""


def lay_file(named: str | Path, content: bytes) -> Laid:
    """Write what a file is to hold beside it, and onto the disk.

    Raises:
        FileError: the folder is missing or not writable, or the file may not be written or is not an ordinary file.
    """
    path = Path(named).resolve()
    finish_writing(path.parent)
    remove_strays(path)
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
            stream.write(content)
            stream.flush()
            os.chmod(part, 0o666 & ~umask() if mode is None else mode)
            os.fsync(stream.fileno())
    except OSError as error:
        Path(part).unlink(missing_ok=True)
        raise FileError(named, f"cannot be written: {error.strerror or error}") from error
    except BaseException:
        Path(part).unlink(missing_ok=True)
        raise
    return Laid(named, Path(part), path)


def write_together(
    contents: Mapping[str | Path, bytes] | Mapping[Path, bytes], lay: Callable[[], Laid] | None = None
) -> None:
    """Write files that belong together, all or none.

    Args:
        contents: of each file.
        lay: lays another file or folder beside its place, which is put there with them.

    Raises:
        FileError: as `lay_file` and `put_in_place`, and what `lay` raises.
    """
    ready: list[Laid] = []
    try:
        for named, content in contents.items():
            ready.append(lay_file(named, content))
        if lay is not None:
            ready.append(lay())
    except BaseException:
        discard(ready)
        raise
    put_in_place(ready)


def umask() -> int:
    """Bits of a mode that this process takes from new files."""
    mask = os.umask(0)
    os.umask(mask)
    return mask


def discard(laid: Iterable[Laid]) -> None:
    """Remove what still lies beside its place."""
    for one in laid:
        _remove(one.part)


def _remove(path: Path) -> None:
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path, ignore_errors=True)
    else:
        path.unlink(missing_ok=True)


def put_in_place(laid: Sequence[Laid]) -> None:
    """Rename what lies beside, all or none.

    An interrupt from the keyboard is raised when all is done, or nothing.

    Raises:
        FileError: a file is held by another program, the disk is full, or the like; all are as they were then.
    """
    if not laid:
        return
    named = laid[0].named
    try:
        if len(laid) == 1:
            try:
                _forward(laid[0].part, laid[0].path)
            finally:
                discard(laid)
            sync(laid[0].path.parent)
            return
        journal = _Journal.of(laid)
        try:
            journal.begin()
            for one in laid:
                named = one.named
                _forward(one.part, one.path)
            journal.sync()
        except OSError:
            journal.mark.unlink(missing_ok=True)
            sync(journal.mark.parent)
            journal.finish()
            raise
        except BaseException:
            journal.finish()
            raise
        with suppress(OSError):  # all is in place; whoever comes next takes the journal away
            journal.finish()
    except OSError as error:
        raise FileError(named, f"cannot be written: {error.strerror or error}") from error


def _forward(part: Path, path: Path) -> None:
    """Put a file or a folder in its place, if that was not done yet."""
    if not os.path.lexists(part):
        return
    if part.is_dir() and path.is_dir():
        path.rmdir()  # an empty one, on which Windows puts none
    with suppress(FileNotFoundError):  # a reader did it meanwhile
        os.replace(part, path)


# The journal of several renames.

_JOURNAL = re.compile(rf"\.(journal|mark)\.(\d+)-(.*)\.([^.]*)\{PART}")


@dataclass(frozen=True)
class _Journal:
    """Renames that belong together."""

    mark: Path
    """File that decides: where it is there, the renames are done, else undone."""
    journals: tuple[Path, ...]
    """One in each folder, that of the mark's folder last."""
    renames: tuple[tuple[Path, Path, Path | None], ...]
    """What lies beside, its place, and a link to what is there before; None where nothing is, or an empty folder."""

    @classmethod
    def of(cls, laid: Sequence[Laid]) -> "_Journal":
        folders = list(dict.fromkeys(one.path.parent for one in laid))
        number = laid[0].part.name.split(".")[-2]
        name = f"{os.getpid()}-{_machine()}.{number}{PART}"
        renames = [(one.part, one.path, _old_of(one.part) if one.path.is_file() else None) for one in laid]
        journals = [folder / f".journal.{name}" for folder in reversed(folders)]
        return cls(folders[0] / f".mark.{name}", tuple(journals), tuple(renames))

    @classmethod
    def read(cls, path: Path) -> "_Journal":
        """The journal of a file.

        Raises:
            ValueError, KeyError: it is not whole.
        """
        content, folder = json.loads(path.read_bytes()), path.parent
        renames = [
            (folder / part, folder / place, None if old is None else folder / old)
            for part, place, old in content["renames"]
        ]
        return cls(folder / content["mark"], tuple(folder / name for name in content["journals"]), tuple(renames))

    def begin(self) -> None:
        """Keep what is there, write the journals, and set the mark."""
        for _, path, old in self.renames:
            if old is not None:
                try:
                    os.link(path, old)
                except OSError:  # file systems without links
                    shutil.copy2(path, old)
                    sync(old)
        for journal in self.journals:
            seen = partial(_seen_from, journal.parent)
            content = {
                "mark": seen(self.mark),
                "journals": [seen(other) for other in self.journals],
                "renames": [
                    (seen(part), seen(path), None if old is None else seen(old)) for part, path, old in self.renames
                ],
            }
            _write(journal, json.dumps(content).encode("ascii"))
        self.sync()
        _write(self.mark, b"")
        sync(self.mark.parent)

    def finish(self) -> None:
        """Do the renames, or undo them, and take the journals away."""
        if self.mark.exists():
            for part, path, _ in self.renames:
                _forward(part, path)
        else:
            for part, path, old in self.renames:
                _back(part, path, old)
        self.sync()
        for journal in self.journals:
            journal.unlink(missing_ok=True)
            sync(journal.parent)
        self.mark.unlink(missing_ok=True)
        for part, _, old in self.renames:
            _remove(part)
            if old is not None:
                old.unlink(missing_ok=True)

    def sync(self) -> None:
        """See the names in all folders onto the disk."""
        for journal in self.journals:
            sync(journal.parent)


def _old_of(part: Path) -> Path:
    return part.with_name(f"{part.name.removesuffix(PART)}-old{PART}")


def _seen_from(folder: Path, path: Path) -> str:
    """A place as a journal in a folder names it, which may be moved with others; whole on another drive."""
    return os.path.relpath(path, folder) if path.anchor == folder.anchor else str(path)


def _write(path: Path, content: bytes) -> None:
    with path.open("xb") as stream:
        stream.write(content)
        stream.flush()
        os.fsync(stream.fileno())


def _back(part: Path, path: Path, old: Path | None) -> None:
    """Put back what was there, if that was renamed."""
    if os.path.lexists(part):
        return
    if old is None:
        if os.path.lexists(path):
            os.replace(path, part)
    elif old.exists():
        os.replace(old, path)


_looked: dict[Path, int] = {}
"""Folders without a journal, and when they last changed, nanoseconds."""

_TICK_NS = 2_000_000_000
"""Time within which a folder may change without another date; FAT's is the coarsest, two seconds."""


def finish_writing(folder: Path) -> None:
    """Finish what a killed process began to rename in a folder, and in others with it.

    Raises:
        FileError: that cannot be done, so that new files and old ones may lie side by side.
    """
    try:
        changed = folder.stat().st_mtime_ns
        if _looked.get(folder) == changed:
            return
        found = [match for name in os.listdir(folder) if (match := _JOURNAL.fullmatch(name))]
    except (OSError, ValueError):
        return
    if not found and abs(time.time_ns() - changed) > _TICK_NS:
        _looked[folder] = changed
    for match in sorted(found, key=lambda match: match[1]):
        path = folder / match[0]
        try:
            _finish_one(path, match)
        except FileNotFoundError:
            continue  # others finished it meanwhile
        except OSError as error:
            message = (
                f"is left of an interrupted command, whose files cannot be put in place: {error.strerror or error}; "
                "allow writing to their folders"
            )
            raise FileError(path, message) from error


def _finish_one(path: Path, match: re.Match[str]) -> None:
    runs = _may_run(int(match[2]), match[3], path)
    if match[1] == "mark":
        if not runs and not path.with_name(f".journal{path.name.removeprefix('.mark')}").exists():
            path.unlink(missing_ok=True)
        return
    try:
        journal = _Journal.read(path)
    except (ValueError, KeyError, TypeError):
        if not runs:
            path.unlink(missing_ok=True)
        return
    if journal.mark.exists() or not runs:
        journal.finish()
