"""A controller's backup, or any folder or zip file of programs: what in it is a program, and the same again with that corrected."""

import os
import re
import shutil
import tempfile
import zipfile
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path

from robot_programs.core.source import Backup, Source
from robot_programs.languages import LANGUAGES, Language
from taskcal_groundwork.errors import FileError, shown
from taskcal_groundwork.files import ZIP, ZipKind, open_zip, read_bytes
from taskcal_groundwork.writing import PART, Laid, beside, discard, finish_writing, remove_strays, sync, umask

# What is taken for a backup: a folder, or a zip file.

MAX_FILES = 50_000
"""No backup has more."""

MAX_PROGRAM_MB = 50.0
"""A program file that is larger is refused, 10⁶ bytes."""

MAX_TEXT_MB = 256.0
"""All program files of a backup together."""

ZIPPED = ZipKind(
    most_entries=MAX_FILES,
    largest_mb=4000.0, small_mb=500.0, most_ratio=100.0, largest_entry_mb=MAX_PROGRAM_MB,
)  # fmt: skip
"""Programs of computed points pack thirty times; what is no program is copied, and may be any file."""

_NO_PROGRAMS = (".csv",)
"""Suffixes of programs that in a backup are of anything else."""

_LINK = "is a link, which a backup has none of; take it out, or put the file in its place"

_TASKS = "RAPID"
"""Folder of an ABB controller's backup with a folder for each task."""
_OF_A_TASK = ("PROGMOD", "SYSMOD")
"""Folders of a task; they lie in `_TASKS` itself where somebody took them out of theirs."""

_MODULE = re.compile(r"^\s*MODULE\s+(\w+)", re.MULTILINE | re.IGNORECASE)


def lay_backup(backup: Backup, out: str | Path, sources: Sequence[Source]) -> Laid:
    """Lay beside its place the same folder or zip file with other texts of the program; `put_in_place` puts it there.

    Args:
        backup: what was read.
        out: a zip file where the backup is one, else a folder; it must not exist yet, but for an empty folder.
        sources: the program's files.

    Raises:
        FileError: it exists already, lies in the backup, is of the other kind, or cannot be written.
    """
    out = Path(out)
    check_place(backup, out)
    place = out.resolve()
    contents = {source.path.relative_to(backup.path).as_posix(): source.encode() for source in sources}
    remove_strays(place)
    prefix, folder = beside(place), place.parent
    try:
        if backup.path.is_dir():
            laid = Laid(out, Path(tempfile.mkdtemp(prefix=prefix, suffix=PART, dir=folder)), place)
            write = _write_folder
        else:
            handle, part = tempfile.mkstemp(prefix=prefix, suffix=PART, dir=folder)
            os.close(handle)
            laid, write = Laid(out, Path(part), place), _write_zip
        try:
            write(backup.path, laid.part, contents)
        except BaseException:
            discard([laid])
            raise
    except OSError as error:
        raise FileError(out, f"cannot be written: {error.strerror or error}") from error
    return laid


def check_place(backup: Backup, out: Path) -> None:
    """See that a corrected backup can go to a place.

    Raises:
        FileError: it cannot.
    """
    folder = backup.path.is_dir()
    finish_writing(out.resolve().parent)
    if folder == (out.suffix.lower() == ZIP):
        what = f"{backup.path} is {'a folder' if folder else 'a zip file'}, and the corrected one is one too"
        raise FileError(out, f"is of another kind than what is read: {what}")
    if out.exists() and not (folder and out.is_dir() and not any(out.iterdir())):
        raise FileError(out, "exists already; name a folder or a zip file that does not")
    if folder and backup.path.resolve() in (out.resolve(), *out.resolve().parents):
        raise FileError(out, f"lies in {backup.path}, which is read; name a folder beside it")
    if not out.resolve().parent.is_dir():
        raise FileError(out, f"cannot be written: there is no folder '{out.parent}'; make it, or name one that exists")


def _write_folder(path: Path, made: Path, contents: Mapping[str, bytes]) -> None:
    left = set(contents)
    for name, own in _files_of(path):
        target = made / name
        target.parent.mkdir(parents=True, exist_ok=True)
        if name in contents:
            target.write_bytes(contents[name])
            left.discard(name)
        else:
            shutil.copyfile(own, target)
        sync(target)
    _refuse_changed(path, left)
    made.chmod(0o777 & ~umask())
    for folder, _, _ in os.walk(made):
        sync(Path(folder))


def _write_zip(path: Path, part: Path, contents: Mapping[str, bytes]) -> None:
    left = set(contents)
    with open_zip(path, ZIPPED) as packed, zipfile.ZipFile(part, "w", zipfile.ZIP_DEFLATED) as made:
        for entry in packed.entries:
            again = zipfile.ZipInfo(entry.name, entry.info.date_time)
            again.compress_type = zipfile.ZIP_DEFLATED
            again.external_attr = entry.info.external_attr
            with made.open(again, "w", force_zip64=True) as target:
                if entry.name in contents:
                    target.write(contents[entry.name])
                    left.discard(entry.name)
                elif not entry.is_folder:
                    for piece in packed.pieces(entry):
                        target.write(piece)
    _refuse_changed(path, left)
    part.chmod(0o666 & ~umask())
    sync(part)


def _refuse_changed(path: Path, left: set[str]) -> None:
    """See that every file of the program was still there.

    Raises:
        FileError: it was not, and what is written would lack it.
    """
    if left:
        raise FileError(path, f"was replaced while it was read: {shown(min(left))} is not in it any more; run it again")


def open_backup(path: str | Path) -> tuple[Backup, tuple[Source, ...]]:
    """Find the program in a folder or a zip file: all files of one language, whose paths begin with that of the backup.

    Raises:
        FileError: it holds no program, or programs of several languages; a link, or a name that leads out of it; it is
            damaged, encrypted, or larger than any backup.
    """
    path = Path(path)
    files = list(_sources(path))
    found: dict[str, list[Source]] = {}
    for language, source in files:
        if source is not None and language is not None and language.holds(source):
            found.setdefault(language.name, []).append(source)
    if not found:
        known = [suffix for language in LANGUAGES for suffix in language.suffixes if suffix not in _NO_PROGRAMS]
        raise FileError(path, f"holds no robot program among its {len(files)} files; known are {' '.join(known)}")
    if len(found) > 1:
        counts = ", ".join(f"{len(sources)} of {name}" for name, sources in found.items())
        raise FileError(path, f"holds programs of several languages ({counts}); give the folder or the files of one")
    ((name, sources),) = found.items()
    if name == "RAPID":
        sources = _loaded(path, sources)
        _refuse_several_tasks(path, sources)
    return Backup(path=path, skipped=len(files) - len(sources)), tuple(sources)


def _loaded(path: Path, sources: Sequence[Source]) -> list[Source]:
    """Loaded files of an ABB controller's backup: modules in RAPID, and its configuration; HOME holds copies and drafts.

    Where there is no folder RAPID, all that is given.
    """
    places = [source.path.relative_to(path).parts for source in sources]
    backups = {parts[:i] for parts in places for i, part in enumerate(parts[:-1]) if part.upper() == _TASKS}
    drafts = {
        parts
        for parts in places
        for top in backups
        if parts[: len(top)] == top and len(parts) > len(top) + 1 and parts[len(top)].upper() not in (_TASKS, "SYSPAR")
    }
    return [source for source, parts in zip(sources, places, strict=True) if parts not in drafts]


def _refuse_several_tasks(path: Path, sources: Sequence[Source]) -> None:
    """See that a backup of an ABB controller has one task: those of several have programs of their own.

    Raises:
        FileError: it has several, or two modules of one name.
    """
    tasks: Counter[str] = Counter()
    modules: dict[str, Source] = {}
    for source in sources:
        parts = source.path.relative_to(path).parts
        above = [i for i, part in enumerate(parts[:-2]) if part.upper() == _TASKS]
        if above and parts[above[-1] + 1].upper() not in _OF_A_TASK:
            tasks[parts[above[-1] + 1]] += 1
    if len(tasks) > 1:
        names = ", ".join(f"{task} ({count} modules)" for task, count in sorted(tasks.items()))
        message = (
            f"holds {len(tasks)} tasks: {names}; each is a program of its own: give the folder of one, with MOC.cfg"
        )
        raise FileError(path, message)
    for source in sources:
        for match in _MODULE.finditer(source.text):
            other = modules.setdefault(match[1].lower(), source)
            if other is not source:
                message = f"has the module {match[1]}, as {other.path} has; give the folder or the files of one program"
                raise FileError(source.path, message)


def _files_of(folder: Path) -> Iterator[tuple[str, Path]]:
    """Names and paths of all files in a folder, in order.

    Raises:
        FileError: there is a link, or there are too many.
    """
    count = 0
    for root, folders, files in os.walk(folder):
        folders.sort()
        for name in sorted(folders + files):
            path = Path(root) / name
            if path.is_symlink():
                raise FileError(path, _LINK)
        for name in sorted(files):
            path = Path(root) / name
            count += 1
            if count > MAX_FILES:
                raise FileError(folder, f"holds more than {MAX_FILES} files; give the folder of the program alone")
            if path.is_file():
                yield path.relative_to(folder).as_posix(), path


def _sources(path: Path) -> Iterator[tuple[Language | None, Source | None]]:
    """Language and text of every file in a folder or a zip file; of what is no program neither."""
    total = 0
    for place, read in _readers(path):
        suffix = place.suffix.lower()
        language = next((one for one in LANGUAGES if suffix in one.suffixes and suffix not in _NO_PROGRAMS), None)
        if language is None:
            yield None, None
            continue
        data = read()
        total += len(data)
        if total > MAX_TEXT_MB * 1e6:
            most = f"{MAX_TEXT_MB:g} MB of program files"
            raise FileError(path, f"holds more than {most}; give the folder of one program")
        yield language, Source.of(place, data)


def _readers(path: Path) -> Iterator[tuple[Path, Callable[[], bytes]]]:
    """Path of every file in a folder or a zip file, and what reads it."""
    if path.is_dir():
        yield from ((own, partial(read_bytes, own, MAX_PROGRAM_MB)) for _, own in _files_of(path))
        return
    with open_zip(path, ZIPPED) as packed:
        for entry in packed.entries:
            if entry.is_link:
                raise FileError(path / shown(entry.name), _LINK)
        for entry in packed.entries:
            if not entry.is_folder:
                yield path / entry.name, partial(packed.read, entry)
