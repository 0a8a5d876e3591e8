"""Command output: tables or JSON on standard output, messages on standard error, files written all together."""

import json
import math
import os
import re
import shlex
import shutil
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

import typer

from robot_programs.core.files import elsewhere_on_windows
from taskcal.cli.progress import clear_line
from taskcal.errors import FileError, printable, shortened
from taskcal.io.files import Laid, finish_writing, to_bytes, write_all, write_whole
from taskcal.io.json_file import parse_json
from taskcal.report.content import Table, fold, lay_out_facts, lay_out_table

if TYPE_CHECKING:
    import numpy as np


# Messages and sentences.

MESSAGE_CHARACTERS = 4000
"""Of one message; whatever it repeats of its input is cut."""


def error(message: str) -> None:
    """Write an error on standard error."""
    info(f"error: {message}")


def info(message: str) -> None:
    """Write a message beside the result, on standard error."""
    clear_line()
    with suppress(OSError):  # where that is full or closed, the exit status has to do
        print(_folded(for_terminal(shortened(message, MESSAGE_CHARACTERS)), sys.stderr), file=sys.stderr, flush=True)


def tell(line: str = "") -> None:
    """Write a line of the result on standard output."""
    clear_line()
    print(_folded(for_terminal(line), sys.stdout))


def say(text: str) -> None:
    """Write a sentence of the result, folded between words whatever reads it."""
    clear_line()
    for line in fold(for_terminal(text), line_width()):
        print(line)


def _folded(text: str, stream: TextIO) -> str:
    """A message cut between words for a terminal, which would cut within them; whole where programs read it."""
    if not stream.isatty():
        return text
    width = line_width()
    return "\n".join(part for line in text.split("\n") for part in (fold(line, width) if len(line) > width else [line]))


def for_terminal(text: str) -> str:
    """Text in which a name or a value from a file cannot command the terminal: only line feeds and tabs act."""
    return printable(text, keep="\n\t")


def line_width() -> int:
    """Characters in a line: the terminal's, the value of COLUMNS, or 80."""
    return max(shutil.get_terminal_size((80, 24)).columns, 20)


def started_as() -> str:
    """Name the command line as it was called, or by its bare name where the shell finds it."""
    name = Path(sys.argv[0]).stem if sys.argv and sys.argv[0] else ""
    if name != "taskcal":
        return "taskcal"
    program = shutil.which("taskcal")
    if program and Path(program).exists() and Path(sys.argv[0]).exists() and Path(program).samefile(sys.argv[0]):
        return "taskcal"
    return shlex.quote(sys.argv[0])


@cache
def show_log() -> None:
    """Write on standard error, from now on, what the library reports, such as that it compiles kernels."""
    from logging import INFO, Handler, LogRecord, getLogger

    class Shown(Handler):
        """Each record as a message."""

        def emit(self, record: LogRecord) -> None:
            info(record.getMessage())

    log = getLogger("taskcal")
    log.setLevel(INFO)
    log.addHandler(Shown())


# Tables and labelled lines for people.


def show(table: Table, *, spare: Sequence[str] = (), note: bool = False) -> None:
    """Print a table, the same that a page shows.

    Args:
        table: with its columns of words set flush left.
        spare: headers of columns that are left out where it is too wide, those that go first at the front.
        note: whether to print its note below it.
    """
    clear_line()
    width = line_width()
    for line in fold(for_terminal(table.title), width) if table.title else ():
        print(f"\x1b[1m{line}\x1b[0m" if sys.stdout.isatty() and "NO_COLOR" not in os.environ else line)
    groups = [(heading, [[_in_a_cell(cell) for cell in row] for row in rows]) for heading, rows in table.groups]
    without = [table.header.index(name) for name in spare if name in table.header]
    for line in lay_out_table([*map(_in_a_cell, table.header)], groups, set(table.text_columns), width, without):
        print(line)
    for line in fold(for_terminal(table.note), width) if note and table.note else ():
        print(line)
    print()


def _in_a_cell(text: str) -> str:
    """A cell's text, without line feeds, which would break the table; a header's stand where it folds."""
    return " ".join(for_terminal(text).split("\n"))


def show_facts(facts: Iterable[tuple[str, str]]) -> None:
    """Print labelled lines."""
    clear_line()
    for line in lay_out_facts([(for_terminal(label), for_terminal(text)) for label, text in facts], line_width()):
        print(line)


# JSON for programs.


def write_json(result: Mapping[str, Any]) -> None:
    """Print the machine-readable result, alone on standard output."""
    clear_line()
    content = plain(with_edits(result))
    text = _in_lines(content, ensure_ascii=False)
    try:
        text.encode(getattr(sys.stdout, "encoding", None) or "utf-8")
    except UnicodeEncodeError:  # another locale, or a file's name that is not text
        text = _in_lines(content, ensure_ascii=True)
    print(re.sub("[\x7f-\x9f]", lambda control: f"\\u{ord(control[0]):04x}", text))  # JSON escapes those below 0x20


def _in_lines(content: Mapping[str, Any], *, ensure_ascii: bool) -> str:
    """JSON with a line for each key, and for each row of a table; `indent` takes five times as long."""
    encode = json.JSONEncoder(ensure_ascii=ensure_ascii, allow_nan=False).encode

    def written(value: Any) -> str:
        if not isinstance(value, list) or not any(isinstance(row, dict) for row in value):
            return encode(value)
        return "[\n  " + ",\n  ".join(map(encode, value)) + "\n ]"

    return "{\n " + ",\n ".join(f"{encode(key)}: {written(value)}" for key, value in content.items()) + "\n}"


def plain(value: Any) -> Any:
    """Lists, dictionaries and numbers that JSON knows; null for what is not finite."""
    if value is None or isinstance(value, str | int):
        return value
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple | set | frozenset):
        return [plain(item) for item in value]
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, Path):
        return str(value)
    return value


def placement(T: "np.ndarray") -> dict[str, Any]:
    """A pose for people: position in millimetres, orientation as a quaternion ``qx qy qz qw``."""
    from taskcal.geometry import se3

    position = [round(float(value) * 1e3, 9) for value in T[:3, 3]]
    return {"position_mm": position, "quaternion": se3.to_quaternion(T[None, :3, :3])[0].tolist()}


# Notes that are kept from one run to the next, in the user's state folder.

MAX_NOTES = 5000
"""Of one kind, the last ones written; each has some hundred bytes."""


def _note(kind: str, key: bytes) -> Path:
    import hashlib

    import platformdirs

    folder = Path(os.environ.get("TASKCAL_STATE_DIR") or platformdirs.user_state_path("taskcal"))
    return folder / kind / f"{hashlib.sha256(key).hexdigest()[:32]}.json"


def read_note(kind: str, key: bytes) -> dict[str, Any]:
    """The note of a kind and key; empty where there is none."""
    with suppress(OSError, ValueError, RecursionError, FileError):
        path = _note(kind, key)
        content = parse_json(path.read_text(encoding="utf-8"), path)
        if isinstance(content, dict):
            return content
    return {}


def keep_note(kind: str, key: bytes, content: Mapping[str, Any]) -> None:
    """Write a note, where that can be done, and drop the oldest of its kind where there are too many."""
    path = _note(kind, key)
    with suppress(OSError, FileError):
        path.parent.mkdir(parents=True, exist_ok=True)
        write_whole(path, json.dumps(content))
        notes = list(path.parent.glob("*.json"))
        for old in sorted(notes, key=lambda note: note.stat().st_mtime)[:-MAX_NOTES] if len(notes) > MAX_NOTES else ():
            old.unlink(missing_ok=True)


# The files of a command: checked before anything is computed, written all together, and known again as its own.
#
# A file is a command's own while it is, byte for byte, what that command last wrote there. Digests of what was
# written are kept as notes, so that no mark has to be in a file, and a file that was edited since is noticed.


@dataclass
class _Account:
    """Files that this run is to write and has written, for the line that lists them where it is interrupted, and edited ones."""

    planned: list[Path] = field(default_factory=list[Path])
    written: list[Path] = field(default_factory=list[Path])
    warnings: list[str] = field(default_factory=list[str])
    """Files that were read although they were edited, in words."""


_account = _Account()


@dataclass(frozen=True)
class Outputs:
    """The files of one command, seen to be free."""

    command: str
    paths: tuple[Path, ...]
    force: bool = False

    def write(
        self,
        contents: Mapping[Path, str | bytes] | Mapping[Path | None, str | bytes],
        lay: Callable[[], Laid] | None = None,
    ) -> None:
        """Write files that belong together, all or none, and remember them as this command's.

        Args:
            contents: of each file; that of an option that was not given, None, is not written. Files whose names were not known
                before are each in a folder that may still have to be made.
            lay: lays what else belongs to them beside its place.

        Raises:
            FileError: one of them cannot be written, or exists and is not as this command wrote it.
        """
        named = {path: content for path, content in contents.items() if path is not None}
        for path in named:
            if path not in self.paths:
                _check_own(path, self.command, force=self.force)
                path.parent.mkdir(exist_ok=True)
        for path, content in named.items():
            _remember(path, self.command, content)
        if named or lay is not None:
            write_all(named, lay)
            _account.written.extend(named)


def check_outputs(
    command: str,
    outputs: Iterable[tuple[str, Path | None]],
    inputs: Iterable[str | Path | None] = (),
    *,
    force: bool = False,
    updated: Sequence[str] = (),
) -> Outputs:
    """Check, before anything is computed, that every file can be written and that nothing is lost by it.

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
            raise FileError(
                path, "would overwrite an input file, which --force does not allow either; name another file"
            )
        if option not in updated:
            _check_own(path, command, force=force)
    _account.planned.extend(path for option, path in named if option not in updated)
    return Outputs(command, tuple(path for _, path in named), force)


def begin_account() -> None:
    """Forget the files of an earlier command of this process."""
    _account.planned.clear()
    _account.written.clear()
    _account.warnings.clear()


def warn_of_edits(warning: str) -> None:
    """Note that a file which this run reads was edited: every result and page says so. Nothing where the warning is empty."""
    if warning:
        _account.warnings.append(warning)


def edit_warnings() -> tuple[str, ...]:
    """Which files of this run were edited, in words."""
    return tuple(dict.fromkeys(_account.warnings))


def with_edits(result: Mapping[str, Any]) -> Mapping[str, Any]:
    """A result for programs, with ``edited`` where a file was."""
    return {**result, "edited": edit_warnings()} if edit_warnings() else result


def tell_edits() -> None:
    """Write above a result for people which files were edited."""
    for warning in edit_warnings():
        say(f"warning: {warning}")


def count_as_written(path: Path) -> None:
    """Note a file that a command keeps up to date by itself."""
    if path not in _account.written:
        _account.written.append(path)


def interrupted() -> str:
    """The message of an interrupted command, with its files."""
    missing = [str(path) for path in _account.planned if path not in _account.written]
    written = f"wrote {', '.join(map(str, _account.written))}" if _account.written else "nothing was written"
    return f"interrupted: {written}" + (f"; not written: {', '.join(missing)}" if missing else "")


def files_of_task(task: Path | None) -> list[Path]:
    """The task file and the list or path that it names; its reader reports what is wrong with it."""
    if task is None:
        return []
    import tomllib

    named: list[Any] = []
    with suppress(OSError, ValueError, RecursionError):
        content = tomllib.loads(task.read_text(encoding="utf-8"))
        named = [content.get(key) for key in ("poses", "path")]
    return [task, *(task.parent / name for name in named if isinstance(name, str) and "\0" not in name)]


def _check_place(path: Path) -> None:
    """Check that a file can be made here.

    Raises:
        FileError: its folder is missing or closed to us, it is a folder itself, or Windows has no file of this name.
    """
    folder = path.parent
    if not folder.is_dir():
        raise FileError(path, f"cannot be written: there is no folder '{folder}'; make it, or name one that exists")
    finish_writing(path.resolve().parent)
    if path.is_dir():
        raise FileError(path, "cannot be written: it is a folder; name a file in it")
    if sys.platform == "win32" and (reason := elsewhere_on_windows(path.name)):
        raise FileError(path, f"cannot be written: {reason}; name another file")
    if not os.access(folder, os.W_OK):
        raise FileError(path, f"cannot be written: no permission to write in folder '{folder}'; name another")


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


def _check_own(path: Path, command: str, *, force: bool) -> None:
    """Check that a file is not there, is as the command left it, or may be replaced.

    Raises:
        FileError: none of these.
    """
    if force or not path.is_file():
        return
    note = read_note("written", _key(path))
    with suppress(OSError, KeyError, TypeError):
        if note.get("command") == command and _digest(path.read_bytes()) in note["sha256"]:
            return
    message = f"exists and was not written by taskcal {command}, or was edited since; name another file, or replace it with --force"
    raise FileError(path, message)


def _remember(path: Path, command: str, content: str | bytes) -> None:
    """Note the digest of a file about to be written, beside that of its present content: a kill in between leaves one of them.

    Where no note can be kept, the next run asks for --force.
    """
    note = read_note("written", _key(path))
    earlier = note.get("sha256") if note.get("command") == command else None
    digests = [*(earlier[-1:] if isinstance(earlier, list) else []), _digest(content)]
    keep_note("written", _key(path), {"path": str(path.resolve()), "command": command, "sha256": digests})


def _key(path: Path) -> bytes:
    return os.fsencode(path.resolve())


def _digest(content: str | bytes) -> str:
    import hashlib

    return hashlib.sha256(to_bytes(content)).hexdigest()
