"""A run of a command: its files are seen to be free, it gives a value, and that is written and shown, in one place for all.

An option says whether it names what is written (`taskcal_groundwork.options.Option.writes`); every other value that is an
existing file or folder is an input, whichever option has it. So no command can forget one.
"""

import os
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from taskcal.cli.output import (
    error,
    forget_edits,
    keep_note,
    read_note,
    show_sections,
    tell_edits,
    write_json,
)
from taskcal.cli.progress import bar_over
from taskcal.errors import FileError
from taskcal.io.files import Laid, finish_writing, to_bytes, write_all
from taskcal.report.content import Facts, Section
from taskcal_groundwork.files import elsewhere_on_windows
from taskcal_groundwork.options import Option, StatedOption

if TYPE_CHECKING:
    from taskcal.report.page import Report

# What a command gives.


@dataclass(frozen=True)
class File:
    """A file that a command writes."""

    label: str
    """For people; empty for one of many that are not listed."""
    path: Path | None
    """None where it was not asked for."""
    content: str | bytes | Callable[[], Laid]
    """Or what lays it beside its place, where it is more than a file."""
    remark: str = ""
    """Behind its path, for people."""


@dataclass(frozen=True, kw_only=True)
class Result:
    """What a command gives: its files are written, all or none, and then it is printed."""

    summary: Mapping[str, Any]
    """What ``--json`` prints; files of the page are added."""
    sections: Callable[[], Sequence[Section]] = list[Section]
    """What people read, before what was written; made where it is printed, for the libraries of figures take a while."""
    files: Sequence[File] = ()
    page: "Callable[[], Report] | None" = None
    """Makes the page, where one is asked for."""
    failed: bool | str = False
    """Whether the exit status is 1, or the error that is why."""


JsonOption = Annotated[bool, Option(help="Print the result as JSON, alone on standard output.", named="json")]
ForceOption = Annotated[bool, Option(help="Replace files that this command did not write, or that were edited since.")]


@dataclass(frozen=True, kw_only=True)
class OutputOptions:
    """Options of the output files and of the result."""

    force: ForceOption = False
    as_json: JsonOption = False

    @property
    def asked(self) -> bool:
        """Whether a page is to be made."""
        return False

    def check(self) -> None:
        """Check what a page needs beside its files."""

    def compose(self, page: "Report") -> dict[Path, str | bytes]:
        """The files of a page."""
        return {}

    def in_words(self, files: Iterable[Path]) -> str:
        """Files that were written."""
        return ", ".join(map(str, files))

    def give(self, result: Mapping[str, Any], show: Callable[[], object]) -> None:
        """Print a result: as JSON, or for people."""
        if self.as_json:
            write_json(result)
        else:
            tell_edits()
            show()


# The run. What it is to write and has written is kept for the line that lists it where it is interrupted.


@dataclass
class _Account:
    planned: list[Path] = field(default_factory=list[Path])
    written: list[Path] = field(default_factory=list[Path])


_account = _Account()


@dataclass(kw_only=True)
class Run:
    """A run of a command, for what it cannot state before it has begun: files named on the way, and the steps of its bar."""

    command: str
    """As the user calls it."""
    out: OutputOptions
    read: Sequence[Any] = ()
    """Values of all options that name nothing that is written."""
    named: list[tuple[str, Path]] = field(default_factory=list[tuple[str, Path]])
    """Options, and files seen to be free that they name."""
    opened: ExitStack = field(default_factory=ExitStack)
    """What ends with the run, such as its bar."""
    _begin: Callable[[str], None] = field(default=lambda _: None)

    @classmethod
    def begin(cls, command: str, options: Iterable[tuple[StatedOption, Any]], given: Iterable[Any]) -> "Run":
        """Begin a run, before anything is computed.

        Args:
            command: as the user calls it.
            options: with the values that they were given.
            given: what the command is called with: options alone and in groups.

        Raises:
            FileError: a file cannot be written, or would be lost.
            typer.BadParameter: two outputs are one file.
        """
        options = list(options)
        as_json = any(one.field == "as_json" and value for one, value in options)
        out = next((group for group in given if isinstance(group, OutputOptions)), OutputOptions(as_json=as_json))
        run = cls(command=command, out=out, read=[value for one, value in options if not one.option.writes])
        for one, value in options:
            if one.option.writes in ("new", "updated"):
                run.free(f"--{one.name}", *listed(value), updated=one.option.writes == "updated")
        out.check()
        return run

    @cached_property
    def inputs(self) -> tuple[Path, ...]:
        """Files and folders that the command was given to read."""
        return tuple(file for value in self.read for one in listed(value) for file in _existing(one))

    def free(self, option: str, *paths: Path | None, updated: bool = False) -> None:
        """See that files can be written and that nothing is lost by it.

        Args:
            option: that names them.
            paths: those that are asked for.
            updated: whether the command reads them first and goes on with them; only a clash with others is looked for.

        Raises:
            FileError: a folder is missing or closed to us, a file is a folder or one of the inputs, or it exists and is not
                as this command wrote it.
            typer.BadParameter: two outputs are one file.
        """
        for path in filter(None, paths):
            _check_place(path)
            for other, earlier in self.named:
                if _are_one(path, earlier):
                    message = f"both name '{path}' and cannot be one file; name different ones"
                    raise typer.BadParameter(message, param_hint=f"{option} / {other}")
            self._check_kept(path)
            if not updated:
                _check_own(path, self.command, force=self.out.force)
                _account.planned.append(path)
            self.named.append((option, path))

    def _check_kept(self, path: Path) -> None:
        """Check that a file to be written is none that the command was given to read.

        Raises:
            FileError: it is one of them, or lies in a folder of them and is not as the command left it.
        """
        if any(_are_one(path, file) for file in self.inputs):
            raise FileError(
                path, "would overwrite an input file, which --force does not allow either; name another file"
            )
        if any(file.is_dir() and _are_one(path.parent, file) for file in self.inputs):
            _check_own(path, self.command, force=False)

    def bar(self, steps: Sequence[str], count: int | None = None) -> Callable[[str], None]:
        """A bar over steps, and over that of the page where one is asked for; full once the files are written.

        Args:
            steps: as `bar_over` has them, without the page's.
            count: likewise.
        """
        asked = self.out.asked
        steps, count = [*steps, *(["page"] if asked and count is None else [])], count and count + asked
        if steps:
            self._begin = self.opened.enter_context(bar_over(steps, count))
        return self._begin

    def write(self, contents: Mapping[Path, str | bytes], lay: Callable[[], Laid] | None = None) -> None:
        """Write files that belong together, all or none, and remember them as this command's.

        Args:
            contents: of each file. Files whose names were not known before are each in a folder that may still have to be made.
            lay: lays what else belongs to them beside its place.

        Raises:
            FileError: one of them cannot be written, is an input, or exists and is not as this command wrote it.
        """
        free = {path for _, path in self.named}
        for path in contents:
            if path not in free:
                self._check_kept(path)
                _check_own(path, self.command, force=self.out.force)
                path.parent.mkdir(exist_ok=True)
        for path, content in contents.items():
            _remember(path, self.command, content)
        if contents or lay is not None:
            write_all(contents, lay)
            _account.written.extend(contents)

    def finish(self, result: Result) -> None:
        """Write the files of a result, all or none, and print it.

        Raises:
            FileError: a file cannot be written.
            typer.Exit: it failed; the exit status is 1.
        """
        contents = {one.path: one.content for one in result.files if one.path is not None and not callable(one.content)}
        lay = next((one.content for one in result.files if callable(one.content)), None)
        made: dict[Path, str | bytes] = {}
        if result.page is not None and self.out.asked:
            self._begin("page")
            made = self.out.compose(result.page())
        self.write({**contents, **made}, lay)
        self.opened.close()
        self.out.give(result.summary, lambda: self._show(result, made))
        if isinstance(result.failed, str):
            error(result.failed)
        if result.failed:
            raise typer.Exit(1)

    def _show(self, result: Result, made: Mapping[Path, object]) -> None:
        """Print a result for people, what was written behind its last labelled lines."""
        wrote = [
            (one.label, f"wrote {one.path}{one.remark}") for one in result.files if one.label and one.path is not None
        ]
        if made:
            wrote.append(("report", f"wrote {self.out.in_words(list(made))}"))
        *first, last = result.sections() or [Section("")]
        *blocks, end = last.blocks or (Facts(),)
        facts = [Facts(*end.items, *wrote)] if isinstance(end, Facts) else [end, Facts(*wrote)]
        show_sections([*first, Section(last.title, *blocks, *facts)])


def listed(value: Any) -> Sequence[Any]:
    """Values of an option that may be given several times, or has several."""
    return value if isinstance(value, list | tuple) else [value]


def _existing(value: Any) -> list[Path]:
    """What the value of an option names, before its ``#`` too, if it exists: a file, with those that a task names, or a folder."""
    for text in (str(value), str(value).rpartition("#")[0]) if isinstance(value, str | Path) else ():
        with suppress(OSError, ValueError):  # a text that no file can be called
            if text and (path := Path(text)).exists():
                return [path, *_files_of_task(path)]
    return []


def _files_of_task(path: Path) -> list[Path]:
    """The list or path that a file names which may be a task; its reader reports what is wrong with it."""
    if path.suffix.lower() != ".toml" or not path.is_file():
        return []
    from taskcal.io.toml_file import tables_of_task

    return [path.parent / name for name in tables_of_task(path)]


def begin_account() -> None:
    """Forget an earlier command of this process."""
    _account.planned.clear()
    _account.written.clear()
    forget_edits()


def count_as_written(path: Path) -> None:
    """Note a file that a command keeps up to date by itself."""
    if path not in _account.written:
        _account.written.append(path)


def interrupted() -> str:
    """The message of an interrupted command, with its files."""
    missing = [str(path) for path in _account.planned if path not in _account.written]
    written = f"wrote {', '.join(map(str, _account.written))}" if _account.written else "nothing was written"
    return f"interrupted: {written}" + (f"; not written: {', '.join(missing)}" if missing else "")


# A file is a command's own while it is, byte for byte, what that command last wrote there. Digests of what was
# written are kept as notes, so that no mark has to be in a file, and a file that was edited since is noticed.


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
