"""What a command writes: checked before anything is computed, written all together, and known again as its own.

A file is a command's own while it is, byte for byte, what that command last wrote there. Digests of what was written
lie in the user's state folder, so that no mark has to stand in a file, and a file that was edited since is noticed.
"""

import json
import os
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import typer

from taskcal.errors import FileError
from taskcal.io.files import write_all, write_whole

# Where the commands keep what they remember from one run to the next.


def state_folder() -> Path:
    """The folder that ``TASKCAL_STATE_DIR`` names, or the system's own for a user's programs."""
    import platformdirs

    return Path(os.environ.get("TASKCAL_STATE_DIR") or platformdirs.user_state_path("taskcal"))


RECORDS = 2000
"""Files that are remembered; beyond it, those that are no longer there are forgotten."""


@dataclass
class _Account:
    """What this run is to write and what it has written, for the line that says so where it is interrupted."""

    planned: list[Path] = field(default_factory=list[Path])
    written: list[Path] = field(default_factory=list[Path])


_account = _Account()


@dataclass(frozen=True)
class Outputs:
    """The files of one command, seen to be free."""

    command: str
    paths: tuple[Path, ...]

    def write(self, contents: Mapping[Path, str | bytes]) -> None:
        """Write files that belong together, all or none, and remember them as this command's.

        Raises:
            FileError: one of them cannot be written.
        """
        for path, content in contents.items():
            _remember(path, self.command, content)
        write_all(contents)
        _account.written.extend(contents)

    def write_beside(self, contents: Mapping[Path, str | bytes], *, force: bool = False) -> None:
        """Write files whose names were not known before, each in a folder that may still have to be made.

        Raises:
            FileError: one of them cannot be written, or exists and is not as this command wrote it.
        """
        for path in contents:
            if path.is_file() and not force and path not in self.paths and not _is_own(path, self.command):
                raise FileError(path, _not_own(self.command))
            path.parent.mkdir(exist_ok=True)
        if contents:
            self.write(contents)


def check_outputs(
    command: str,
    outputs: Iterable[tuple[str, Path | None]],
    inputs: Iterable[str | Path | None] = (),
    *,
    force: bool = False,
    updated: Sequence[str] = (),
) -> Outputs:
    """See, before anything is computed, that every file can be written and that nothing is lost by it.

    Args:
        command: as the user calls it.
        outputs: option and file.
        inputs: files that the command reads.
        force: replace files that the command did not write.
        updated: options whose file the command reads first and goes on with; only a clash with others is looked for.

    Raises:
        FileError: a folder is missing or closed to us, a file is a folder or one of the inputs, or it exists and is not
            as this command wrote it.
        typer.BadParameter: two outputs are one file.
    """
    named = [(option, path) for option, path in outputs if path is not None]
    read = [Path(given) for given in inputs if given is not None]
    for number, (option, path) in enumerate(named):
        _check_place(path)
        for other, earlier in named[:number]:
            if _are_one(path, earlier):
                raise typer.BadParameter(
                    f"both name '{path}' and cannot be one file; name different ones", param_hint=f"{option} / {other}"
                )
        if any(_are_one(path, given) for given in read):
            raise FileError(path, "would overwrite what is read, and that is never overwritten; name another file")
        if path.is_file() and not force and option not in updated and not _is_own(path, command):
            raise FileError(path, _not_own(command))
    _account.planned.extend(path for option, path in named if option not in updated)
    return Outputs(command, tuple(path for _, path in named))


def _not_own(command: str) -> str:
    return f"exists already, and is not as taskcal {command} wrote it; name another file, or replace it with --force"


def begin_account() -> None:
    """Forget what an earlier command of this process wrote."""
    _account.planned.clear()
    _account.written.clear()


def count_as_written(path: Path) -> None:
    """Note a file that a command keeps up to date by itself."""
    if path not in _account.written:
        _account.written.append(path)


def interrupted() -> str:
    """What an interrupted command says of its files."""
    missing = [str(path) for path in _account.planned if path not in _account.written]
    said = "interrupted: " + (
        f"wrote {', '.join(map(str, _account.written))}" if _account.written else "nothing was written"
    )
    return f"{said}; not written: {', '.join(missing)}" if missing else said


def files_of_task(task: Path | None) -> list[Path]:
    """The task file and the list or path that it names; what is wrong with it is said by its reader."""
    if task is None:
        return []
    import tomllib

    named: list[Any] = []
    with suppress(OSError, ValueError, RecursionError):
        content = tomllib.loads(task.read_text(encoding="utf-8"))
        named = [content.get(key) for key in ("poses", "path")]
    return [task, *(task.parent / name for name in named if isinstance(name, str) and "\0" not in name)]


def _check_place(path: Path) -> None:
    """See that a file can be made here.

    Raises:
        FileError: its folder is missing or closed to us, or it is a folder itself.
    """
    folder = path.parent
    if not folder.is_dir():
        raise FileError(path, f"cannot be written: there is no folder '{folder}'; make it, or name one that exists")
    if path.is_dir():
        raise FileError(path, "cannot be written: it is a folder; name a file in it")
    if not os.access(folder, os.W_OK):
        raise FileError(path, f"cannot be written: folder '{folder}' is not yours to write in; name another")


def _are_one(path: Path, other: Path) -> bool:
    """Whether two names are one file, through links and other spellings, whether it exists yet or not."""
    path, other = path.resolve(), other.resolve()
    if path == other:
        return True
    if path.exists() and other.exists():
        return path.samefile(other)
    if path.name.casefold() != other.name.casefold() or path.exists() != other.exists():
        return False
    folder, beside = path.parent, other.parent
    if not (folder.is_dir() and beside.is_dir() and folder.samefile(beside)):
        return False
    return path.name == other.name or _folds_case(folder)


def _folds_case(folder: Path) -> bool:
    """Whether names that differ in case alone are one file here; seen by trying, for each folder may differ."""
    import tempfile

    with suppress(OSError), tempfile.NamedTemporaryFile(prefix=".case-", dir=folder) as probe:
        path = Path(probe.name)
        return path.with_name(path.name.swapcase()).exists()
    return False


def _record_of(path: Path) -> Path:
    """Where the digests of a file are kept."""
    import hashlib

    name = hashlib.sha256(os.fsencode(path.resolve())).hexdigest()[:32]
    return state_folder() / "written" / f"{name}.json"


def _is_own(path: Path, command: str) -> bool:
    """Whether a file is as the command left it."""
    record = _read_record(path)
    try:
        return record.get("command") == command and _digest(path.read_bytes()) in record["sha256"]
    except (OSError, KeyError, TypeError):
        return False


def _remember(path: Path, command: str, content: str | bytes) -> None:
    """Note what is about to be written, beside what lies there: a kill in between leaves one of them.

    Where no note can be kept, the next run asks for --force.
    """
    record, place = _read_record(path), _record_of(path)
    earlier = record.get("sha256") if record.get("command") == command else None
    digests = [*(earlier[-1:] if isinstance(earlier, list) else []), _digest(content)]
    with suppress(OSError, FileError):
        place.parent.mkdir(parents=True, exist_ok=True)
        _forget_the_gone(place.parent)
        write_whole(place, json.dumps({"path": str(path.resolve()), "command": command, "sha256": digests}))


def _read_record(path: Path) -> dict[str, Any]:
    return _parsed(_record_of(path))


def _parsed(record: Path) -> dict[str, Any]:
    try:
        content = json.loads(record.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return {}
    return content if isinstance(content, dict) else {}


def _forget_the_gone(folder: Path) -> None:
    """Drop notes of files that are no longer there, where there are many."""
    records = list(folder.glob("*.json"))
    if len(records) <= RECORDS:
        return
    for record in records:
        if not os.path.exists(str(_parsed(record).get("path", ""))):
            record.unlink(missing_ok=True)


def _digest(content: str | bytes) -> str:
    import hashlib

    return hashlib.sha256(content.encode("utf-8") if isinstance(content, str) else content).hexdigest()
