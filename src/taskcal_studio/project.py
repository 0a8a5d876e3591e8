"""A project: a folder of plain files, and which of them are being worked with."""

import json
import os
import re
import time
import unicodedata
from collections.abc import Callable, Collection, Generator, Iterable, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass, replace
from functools import partial
from hashlib import sha256
from importlib import resources
from pathlib import Path
from threading import RLock
from typing import IO, Annotated, Any, Literal

import tomli_w
from pydantic import AfterValidator, Field, TypeAdapter, model_validator

from robot_programs.languages import languages
from taskcal.errors import FileError, TaskcalError, shown
from taskcal.io.files import take_lock, write_all, write_whole
from taskcal.io.toml_file import FileSection, read_toml
from taskcal.reading.detection import SUFFIXES
from taskcal.tables.forms import table_suffixes
from taskcal_groundwork.files import elsewhere_on_windows
from taskcal_groundwork.options import OptionError
from taskcal_studio.stated_options import KEPT, check_stated, files_named, name_of, offered

# Names for files that somebody drops: made from the name that came with them, which is never used as a path itself.

MAX_FILE_BYTES = 52_000_000
"""Of a file that is dropped: a little more than Taskcal reads of one, for what surrounds it."""

MAX_IMAGES, MAX_IMAGES_BYTES = 1000, 4_000_000_000
"""In a folder of images. Conventions: campaigns have 20 to 200 images of 0.5 to 20 MB."""

LONGEST = 60
"""Characters of a name without its ending."""


def plain_name(given: str, endings: Iterable[str]) -> str:
    """A name of letters, digits, dots, hyphens and underscores, with one of the endings.

    Args:
        given: what a browser says that the file is called, perhaps with folders before it.
        endings: those that are taken here, such as ``.csv``.

    Raises:
        TaskcalError: it has none of these endings.
    """
    last = re.split(r"[/\\]", given)[-1]
    ending = next((e for e in sorted(endings, key=len, reverse=True) if last.lower().endswith(e)), None)
    if ending is None:
        raise TaskcalError(f"'{shown(last)}' is not a file of this kind; drop one that ends in {', '.join(endings)}")
    stem = unicodedata.normalize("NFKC", last[: -len(ending)])
    stem = re.sub(r"[^\w.-]+", "-", stem).strip(".-_")[:LONGEST].rstrip(".-_") or "file"
    if elsewhere_on_windows(stem):
        stem = re.sub(r"^[^.]+", r"\g<0>-file", stem)
    return f"{stem}{ending}"


def free_name(wanted: str, taken: Collection[str]) -> str:
    """The name, with a number before its first ending where it is taken; letter case makes no other name."""
    used = {name.casefold() for name in taken}
    if wanted.casefold() not in used:
        return wanted
    stem, dot, ending = wanted.rpartition(".") if "." in wanted else (wanted, "", "")
    number = 2
    while f"{stem}-{number}{dot}{ending}".casefold() in used:
        number += 1
    return f"{stem}-{number}{dot}{ending}"


@dataclass(frozen=True, kw_only=True)
class Folders:
    """Folders of a project; each is made when its first file is written."""

    choices: str = "project.toml"
    header: str = "header.toml"
    """Who measured what, where and with what."""
    made: str = "made.json"
    """From what each result was made."""
    history: str = "history"
    """What was changed, with the former contents."""
    robots: str = "robots"
    campaigns: str = "campaigns"
    tasks: str = "tasks"
    stations: str = "stations"
    boards: str = "boards"
    images: str = "images"
    """A folder for each set."""
    cameras: str = "cameras"
    fixtures: str = "fixtures"
    plans: str = "plans"
    calibrations: str = "calibrations"
    programs: str = "programs"
    cells: str = "cells"
    corrected: str = "corrected"
    reports: str = "reports"


LAYOUT = Folders()

CAMPAIGN_ENDINGS = table_suffixes()
URDF_ENDINGS = (".urdf", ".xacro")
ROBOT_ENDINGS = (".toml", *URDF_ENDINGS)
TABLE_ENDINGS = (".csv", ".txt")
"""Of tables of Denavit–Hartenberg parameters."""
CELL_ENDINGS = (".toml",)
KINEMATICS_ENDINGS = (".conf", ".urp")
TASK_ENDINGS = (".toml",)
STATION_ENDINGS = (".toml",)
BOARD_ENDINGS = (".toml",)
CAMERA_ENDINGS = (".toml", ".yaml", ".yml")
FIXTURE_ENDINGS = (".csv",)
RESULT = ".result.json"
"""Ending of what the command line said of a calibration, beside it."""

PROGRAM_ENDINGS = tuple(suffix for language in languages() for suffix in language.suffixes)


def _inside(path: str) -> str:
    """A file in a folder of the project, by the names that the studio gives."""
    folder, _, name = path.partition("/")
    if not path or (folder and name and plain_name(name, [Path(name).suffix]) == name and ".." not in path):
        return path
    raise ValueError("must be a file in a folder of the project, such as campaigns/first.csv")


ProjectFile = Annotated[str, AfterValidator(_inside)]
"""A path from the project's folder, or nothing."""


def _robot(named: str) -> str:
    """A robot of the catalogue or of the project: whoever opens a project of others reads no other file by it."""
    folder, apart, name = named.partition("/")
    own = folder == LAYOUT.robots and name not in ("", ".", "..") and not set(name) & set("/\\:")
    if own if apart else re.fullmatch(r"[\w.+-]*", named):
        return named
    raise ValueError("must be a name of the catalogue, or a file in robots, such as robots/mine.toml")


RobotName = Annotated[str, AfterValidator(_robot)]
"""A name of the catalogue, or a file in ``robots``; or nothing."""


LiveOption = Literal["controller", "controller-address", "instrument", "instrument-address", "columns", "program"]
"""Of ``taskcal measure``."""


def _stated(options: dict[str, dict[str, str]]) -> dict[str, dict[str, str]]:
    """Options as their commands take them; files among them lie in the project."""
    for command, texts in options.items():
        if command not in KEPT:
            raise ValueError(f"{shown(command)}: no page states options of such a command; known: {', '.join(KEPT)}")
        try:
            check_stated(command, texts)
        except OptionError as wrong:
            raise ValueError(f"{command}: {wrong.said(partial(name_of, command))}") from wrong
        for path in files_named(command, texts):
            _inside(path)
    return options


Options = Annotated[dict[str, dict[str, Annotated[str, Field(max_length=2000)]]], AfterValidator(_stated)]
"""Texts by command, and by the name of the option."""


class Choices(FileSection):
    """Current choices of a project, as in ``project.toml``."""

    name: str = Field(min_length=1, max_length=200)
    robot: RobotName = ""
    campaign: ProjectFile = ""
    points: ProjectFile = ""
    """A second file, with the points of a campaign that has joints alone, until both are joined."""
    board: ProjectFile = ""
    """Boards that the images of a campaign of corners show."""
    lens: Literal["pinhole", "fisheye"] = "pinhole"
    """Of the camera that took them."""
    images: str = Field(default="", pattern=rf"^({LAYOUT.images}/[A-Za-z0-9-]{{1,60}})?$")
    """Their folder."""
    image_times: Literal["", "names", "exif"] = ""
    """Where their times are, if they are paired with a log of joints by time."""
    task: ProjectFile = ""
    station: ProjectFile = ""
    """Where the tracker stands, what the tool carries and what is in the way."""
    calibration: ProjectFile = ""
    program: ProjectFile = ""
    cell: ProjectFile = ""
    tool: str = Field(default="", max_length=200)
    """Of the cell file, for programs that name none."""
    part: str = Field(default="", max_length=200)
    """Likewise."""
    kinematics: ProjectFile = ""
    """With which the controller computes, where these are its own."""
    nominal_controller: bool = False
    """Whether it is stated to compute with those of the robot file."""
    accepted: str = Field(default="", max_length=200)
    """Digest of robot and campaign whose findings are to stay as they are."""
    helper: bool = False
    """Whether targets that the program's text does not state are corrected at run time."""
    options: Options = Field(default_factory=dict)
    """Options of commands that are stated, by their names."""
    observe: Literal["tracker", "pixels"] = "tracker"
    """What measures at the planned poses: a tracker, or a camera that takes images of boards."""
    camera: ProjectFile = ""
    """What is known of that camera."""
    fixtures: ProjectFile = ""
    """Where the boards stand, or the camera does; empty for before the task."""
    language: str = Field(default="RAPID", max_length=50)
    """Of the program that visits the planned poses; empty for none."""
    fit_name: str = Field(default="", max_length=LONGEST)
    """Of the next calibration; empty for one made of its campaign and its model."""
    live: dict[LiveOption, Annotated[str, Field(max_length=200)]] = Field(default_factory=dict)
    """Options of ``taskcal measure`` that are stated, by their names."""
    live_campaign: ProjectFile = ""
    """That was measured live last."""
    notes: dict[ProjectFile, Annotated[str, Field(max_length=2000)]] = Field(default_factory=dict, max_length=1000)
    """On calibrations, by their paths."""

    @model_validator(mode="before")
    @classmethod
    def _options_of_former_keys(cls, given: Mapping[str, Any]) -> Mapping[str, Any]:
        """Projects that were begun before options had names state some by keys of their own."""
        given = {key: value for key, value in given.items() if (key, value) != ("robust", False)}  # all fits are so now
        options = given.get("options", {})
        if not isinstance(options, dict) or not all(isinstance(one, dict) for one in options.values()):
            return given
        fit = {name: text(given[key]) for key, (name, text) in _OF_FITS.items() if key in given}
        fit |= {"seed": str(given["seed"])} if fit and "seed" in given else {}
        plan = {name: text(given[key]) for key, (name, text) in _OF_PLANS.items() if key in given}
        plan |= given.get("observing", {})
        live = given.get("live", {})
        rows = {name: text for name, text in live.items() if name in offered("measure")}
        if not fit and not plan and not rows and "observing" not in given:
            return given
        rest = {key: value for key, value in given.items() if key not in {*_OF_FITS, *_OF_PLANS, "observing"}}
        rest |= {"live": {name: text for name, text in live.items() if name not in rows}}
        stated = {
            "identify": {**fit, **options.get("identify", {})},
            "plan": {**options.get("plan", {}), **plan},
            "measure": {**options.get("measure", {}), **rows},
        }
        return rest | {"options": {**options, **{command: texts for command, texts in stated.items() if texts}}}


def _some(count: int) -> str:
    return str(count) if count else ""


_OF_FITS: Mapping[str, tuple[str, Callable[[Any], str]]] = {
    "effects": ("effects", str), "holdout": ("holdout", str),
}  # fmt: skip
_OF_PLANS: Mapping[str, tuple[str, Callable[[Any], str]]] = {
    "seed": ("seed", str), "poses": ("count", str), "kept_out": ("kept-out", _some),
}  # fmt: skip
"""Former keys, with the options that they are now, and their texts."""


CHANGES = "changes.json"

MAX_UNDO = 100
"""Changes that are kept. A convention: more than anybody goes back one by one."""

JOINED_S = 5.0
"""Between two moves of a slider that are undone together. A convention: a pause to look is longer."""


@dataclass(frozen=True, kw_only=True)
class Change:
    """A change of a project."""

    what: Literal["added", "changed", "chosen", "undone"]
    """Its text."""
    named: tuple[str, str]
    """What was changed, and its value where it is a choice."""
    at: float
    """Seconds since 1970."""
    before: Mapping[str, str | None]
    """Digests of the former contents, by path; None where there was no file."""
    after: Mapping[str, str | None] | None
    """Likewise of the new ones; None while the change goes on."""


_CHANGES = TypeAdapter(list[Change])


def _digest(content: bytes | None) -> str | None:
    return None if content is None else sha256(content).hexdigest()


class Project:
    """A folder that is open."""

    def __init__(self, folder: Path) -> None:
        """Open a project, or begin one where the folder has none.

        Raises:
            FileError: there is no such folder, or its ``project.toml`` cannot be read.
        """
        if not folder.is_dir():
            raise FileError(folder, "cannot be opened: it is not a folder; name one that exists, or one to be made")
        self.folder = folder.resolve()
        self._file = self.folder / LAYOUT.choices
        self.author: Callable[[], str] = str
        """Names whoever changes something now; empty where nobody is known."""
        self.log: list[tuple[str, Change]] = []
        """Changes since the project was opened, those that were taken back, too, with their authors."""
        self._open: dict[str, bytes | None] | None = None
        self._lock = RLock()
        if not self._file.exists():
            write_whole(self._file, tomli_w.dumps(Choices(name=self.folder.name or "project").model_dump()))
        self._end_cut_off()

    @property
    def choices(self) -> Choices:
        """Choices as the file has them now; edits by hand count.

        Raises:
            FileError: it is not as it should be.
        """
        return read_toml(self._file, Choices)

    def choose(self, **changed: object) -> Choices:
        """Change what is being worked with, and save it at once.

        Raises:
            FileError: the file cannot be read or written, or a choice is not one that it may hold.
        """
        values = [str(value) for value in changed.values() if not isinstance(value, Mapping)]
        return self._save(changed, (", ".join(changed), ", ".join(values) or "…"))

    def state(self, command: str, name: str, text: str) -> Choices:
        """State an option of a command by its name, and save it at once; errors as of `choose`."""
        options = self.choices.options
        return self._save({"options": {**options, command: {**options.get(command, {}), name: text}}}, (name, text))

    def _save(self, changed: Mapping[str, object], named: tuple[str, str]) -> Choices:
        choices = Choices.model_validate({**self.choices.model_dump(), **changed})
        with self.change(LAYOUT.choices, chosen=named):
            write_whole(self._file, tomli_w.dumps(choices.model_dump()))
        return choices

    def path(self, relative: str) -> Path:
        """A file of the project.

        Raises:
            FileError: it would lie elsewhere, perhaps by a link.
        """
        path = (self.folder / relative).resolve()
        if not path.is_relative_to(self.folder):
            raise FileError(relative, "lies outside the project's folder; put it inside")
        return path

    def files(self, folder: str, endings: tuple[str, ...] = ()) -> list[str]:
        """Paths of the files in one of the project's folders, by name; hidden ones are left out."""
        place = self.folder / folder
        if not place.is_dir():
            return []
        return sorted(
            f"{folder}/{path.name}"
            for path in place.iterdir()
            if path.is_file()
            and not path.name.startswith(".")
            and path.resolve().is_relative_to(self.folder)
            and (not endings or path.name.lower().endswith(endings))
        )

    def calibrations(self) -> list[str]:
        """Paths of the calibrations."""
        return [path for path in self.files(LAYOUT.calibrations, (".json",)) if not path.endswith(RESULT)]

    def annotate(self, path: str, note: str) -> None:
        """Keep a note on a calibration; an empty one is taken away.

        Raises:
            FileError: the project's file cannot be read or written.
        """
        others = {of: one for of, one in self.choices.notes.items() if of != path}
        self.choose(notes=others | ({path: note} if note else {}))

    def put(self, folder: str, given: str, content: bytes, endings: tuple[str, ...]) -> str:
        """Save a file that somebody dropped, beside what is there; the same file twice is one.

        Returns:
            its path from the project's folder.

        Raises:
            TaskcalError: it is not of this kind, or cannot be written.
        """
        name = plain_name(given, endings)
        place = self.path(folder)
        place.mkdir(exist_ok=True)
        present = place / name
        if not (present.is_file() and present.read_bytes() == content):
            name = free_name(name, [path.name for path in place.iterdir()])
            with self.change(f"{folder}/{name}"):
                write_whole(self.path(f"{folder}/{name}"), content)
        return f"{folder}/{name}"

    def put_image(self, given: str, content: bytes) -> str:
        """Save an image that somebody dropped, in the chosen folder of images; the first one begins a folder.

        Images are not among the changes that can be undone: a folder has hundreds of them.

        Returns:
            path of the folder from the project's.

        Raises:
            TaskcalError: its name is not one that it can keep, another image has it, or the folder is full.
        """
        name = re.split(r"[/\\]", given)[-1]
        if not name.lower().endswith(tuple(SUFFIXES)):
            raise TaskcalError(f"'{shown(name)}' is not an image; drop one that ends in {', '.join(sorted(SUFFIXES))}")
        if not re.fullmatch(r"\w[\w .()+,@~-]{0,99}", name) or elsewhere_on_windows(Path(name).stem):
            raise TaskcalError(
                f"'{shown(name)}' cannot keep its name, by which a row finds it; rename it with letters, digits, spaces and "
                ". - _ ( ) + , @ ~, 100 at most"
            )
        folder = self.choices.images
        if not folder:
            self.path(LAYOUT.images).mkdir(exist_ok=True)
            folder = f"{LAYOUT.images}/{free_name('shots', [one.name for one in self.path(LAYOUT.images).iterdir()])}"
        place = self.path(folder)
        place.mkdir(exist_ok=True)
        present = {path.name.casefold(): path for path in place.iterdir()}
        same = present.get(name.casefold())
        if same is not None and same.read_bytes() != content:
            raise TaskcalError(
                f"'{shown(name)}' is in {folder} already and differs; begin another folder, or rename it"
            )
        size = sum(path.stat().st_size for path in present.values()) + len(content)
        if same is None and (len(present) >= MAX_IMAGES or size > MAX_IMAGES_BYTES):
            raise TaskcalError(
                f"'{shown(name)}' is too much: a folder takes {MAX_IMAGES} images with {MAX_IMAGES_BYTES // 1_000_000} MB in all; "
                "take fewer or smaller ones"
            )
        if same is None:
            write_whole(self.path(f"{folder}/{name}"), content)
        if folder != self.choices.images:
            self.choose(images=folder)
        return folder

    def image_folders(self) -> dict[str, int]:
        """Number of images in each folder of images."""
        place = self.folder / LAYOUT.images
        inside = (
            [path for path in place.iterdir() if path.resolve().is_relative_to(self.folder)] if place.is_dir() else []
        )
        folders = sorted(path for path in inside if path.is_dir())
        return {
            f"{LAYOUT.images}/{folder.name}": sum(path.suffix.lower() in SUFFIXES for path in folder.iterdir())
            for folder in folders
        }

    @contextmanager
    def change(
        self,
        *paths: str,
        chosen: tuple[str, str] | None = None,
        joins: bool = False,
        before: Mapping[str, bytes | None] | None = None,
    ) -> Generator[None, None, None]:
        """Keep the contents that files had before a change, so that it can be undone; a change within another is part of that.

        They are written before anything changes, so that a change that a crash cuts off can be undone, too.

        Args:
            paths: files that may change, from the project's folder.
            chosen: a choice and its value, if that is what it is; by default it is of files, named by the first.
            joins: whether it is one with the last change of the same files, if that was a moment ago.
            before: contents of other files, before a command wrote them.
        """
        with self._lock:
            outer = self._open
            if outer is not None:
                new = self.contents(path for path in paths if path not in outer)
                outer |= new
                self._announce(outer if new else {}, None)
                yield
                return
            self._open = {**(before or {}), **self.contents(paths)}
            try:
                self._announce(self._open, chosen)
                yield
            finally:
                kept, self._open = self._open, None
                self._record(kept, chosen, joins=joins)

    def contents(self, paths: Iterable[str]) -> dict[str, bytes | None]:
        """Contents of files; None where there is none."""
        return {path: self._content(path) for path in paths}

    def _content(self, path: str) -> bytes | None:
        file = self.path(path)
        return file.read_bytes() if file.is_file() else None

    def _announce(self, before: Mapping[str, bytes | None], chosen: tuple[str, str] | None) -> None:
        """Write what may change now, with its former contents."""
        if not before:
            return
        self.path(LAYOUT.history).mkdir(exist_ok=True)
        digests = {path: _digest(content) for path, content in before.items()}
        begun = Change(
            what="changed", named=chosen or (next(iter(before)), ""), at=time.time(), before=digests, after=None
        )
        contents = {self._kept(str(digests[path])): one for path, one in before.items() if one is not None}
        self._write_history([*self.history(), begun], contents)

    def _end_cut_off(self) -> None:
        """Take up the change that a crash cut off, as far as it came."""
        for cut in [one for one in self._changes() if one.after is None]:
            with suppress(TaskcalError):  # a spoilt record: what it has of former contents is dropped
                former = {path: None if digest is None else self._former(digest) for path, digest in cut.before.items()}
                self._record(former, None, joins=False)

    def _record(self, before: Mapping[str, bytes | None], chosen: tuple[str, str] | None, *, joins: bool) -> None:
        after = self.contents(before)
        changed = [path for path in before if before[path] != after[path]]
        if not changed:
            if before:
                self._write_history(self.history(), {})
            return
        what = "chosen" if chosen else "added" if before[changed[0]] is None else "changed"
        digests = ({path: _digest(contents[path]) for path in changed} for contents in (before, after))
        made = Change(
            what=what, named=chosen or (changed[0], ""), at=time.time(), before=next(digests), after=next(digests)
        )
        history = self.history()
        last = history[-1] if history else None
        if joins and last is not None and last.before.keys() == made.before.keys() and made.at - last.at < JOINED_S:
            made = replace(made, what=last.what, before=last.before)
            history = history[:-1]
        kept = [content for path in changed if (content := before[path]) is not None]
        self.path(LAYOUT.history).mkdir(exist_ok=True)
        self._write_history([*history, made][-MAX_UNDO:], {self._kept(str(_digest(one))): one for one in kept})
        self.log.append((self.author(), made))

    def history(self) -> list[Change]:
        """Changes that can be undone, the last one last; none where the record of them was spoilt."""
        return [one for one in self._changes() if one.after is not None]

    def _changes(self) -> list[Change]:
        """Those that can be undone, and the one that goes on."""
        try:
            return _CHANGES.validate_json((self.folder / LAYOUT.history / CHANGES).read_bytes())
        except (OSError, ValueError):
            return []

    def undo(self) -> None:
        """Put back the contents that files had before the last change.

        Raises:
            TaskcalError: there is none, another program has changed one of the files since, or one cannot be written.
        """
        with self._lock:
            *others, last = self.history() or [None]
            if last is None:
                raise TaskcalError("there is nothing to undo")
            for path, digest in (last.after or {}).items():
                if _digest(self._content(path)) != digest:
                    raise TaskcalError(
                        f"'{shown(path)}' was changed outside the studio since; undoing would lose that. What was done before "
                        f"can be put back by hand from the folder {LAYOUT.history}"
                    )
            back = {self.path(path): self._former(digest) for path, digest in last.before.items() if digest is not None}
            self._write_history([one for one in others if one is not None], back)
            for path, digest in last.before.items():
                if digest is None:
                    self.path(path).unlink(missing_ok=True)
            self.log.append((self.author(), replace(last, what="undone")))

    def forget(self) -> None:
        """Undo nothing of what was done so far."""
        self._write_history([], {})

    def _kept(self, digest: str) -> Path:
        """The file that keeps a former content."""
        return self.folder / LAYOUT.history / f"{digest}.old"

    def _former(self, digest: str) -> bytes:
        if not re.fullmatch("[0-9a-f]{64}", digest) or not self._kept(digest).is_file():
            raise TaskcalError(f"the former content is missing from the folder {LAYOUT.history}")
        return self._kept(digest).read_bytes()

    def _write_history(self, history: Sequence[Change], beside: Mapping[Path, bytes]) -> None:
        """Write what can be undone, with other files, all or none; then drop what no change needs."""
        folder = self.folder / LAYOUT.history
        listed = json.dumps([asdict(one) for one in history], indent=1)
        write_all({**beside, folder / CHANGES: listed.encode()})
        needed = {digest for one in history for digest in one.before.values()}
        for old in folder.glob("*.old"):
            if old.stem not in needed:
                old.unlink(missing_ok=True)


# A folder that one process at a time may write in.

NAME = ".studio.lock"


class FolderLock:
    """A lock that the system gives back when its process ends, however it ends."""

    def __init__(self, folder: Path) -> None:
        """Take the lock.

        Raises:
            FileError: another process has it, or the folder is not ours to write in.
        """
        self._path = folder / NAME
        try:
            self._stream: IO[str] = open(self._path, "a+", encoding="utf-8")  # noqa: SIM115  # held open as long as the lock
        except OSError as error:
            raise FileError(folder, f"cannot be opened for writing: {error.strerror or error}") from error
        if not take_lock(self._stream):
            holder = self._holder()
            self._stream.close()
            raise FileError(
                folder, f"is open in another studio already{holder}; close that one first, or open another folder"
            )
        self.tell("")

    def tell(self, address: str) -> None:
        """Say in the lock who has it, for whoever comes second."""
        self._stream.seek(0)
        self._stream.truncate()
        json.dump({"process": os.getpid(), "address": address}, self._stream)
        self._stream.flush()

    def release(self) -> None:
        """Give the lock back. The file stays: taking it away could take away the lock of the next."""
        self._stream.close()

    def _holder(self) -> str:
        try:
            self._stream.seek(0)
            said = json.load(self._stream)
            address = f", {said['address']}" if said["address"] else ""
            return f" (process {int(said['process'])}{address})"
        except (OSError, ValueError, KeyError, TypeError):
            return ""


# The example project: a virtual IRB 6660, a campaign that a virtual tracker measured of it, its task and a program.

ROBOT = "abb-irb6660-205-1.9"

POSES = 90
"""Of the campaign."""


def begin_example(folder: Path) -> Project:
    """Open the example, and write its files where they are missing.

    Raises:
        FileError: the folder cannot be made or written in.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise FileError(folder, f"cannot be made: {error.strerror or error}; name another") from error
    project = Project(folder)
    if project.choices.robot or project.files(LAYOUT.campaigns):
        return project
    contents = _contents()
    chosen = {kind: project.put(place, name, content, (Path(name).suffix,)) for kind, place, name, content in contents}
    project.choose(name="Virtual IRB 6660", robot=ROBOT, **chosen)
    project.forget()
    return project


def _contents() -> list[tuple[str, str, str, bytes]]:
    """Choice, folder, name and content of every file."""
    # what they need takes a second to import, and a project that is there already needs nothing of it
    from math import radians

    import numpy as np

    from taskcal.reading.writer import campaign_text
    from taskcal.robot.catalogue import load_robot
    from taskcal.robot.error_model import ErrorModel
    from taskcal.task.task import reach_task
    from taskcal.virtual.cell import simulate
    from taskcal_demo.milling import milling_program
    from taskcal_demo.procedure import reference_task

    model = ErrorModel(load_robot(ROBOT))
    poses = reach_task(model, reference_task(radians(20.0)), POSES)
    campaign, _ = simulate(model, poses.q, rng=np.random.default_rng(0))
    program = milling_program(model.robot, reference_task(), rows=6).source
    task = (resources.files("taskcal_demo") / "reference-task.toml").read_bytes()
    return [
        ("campaign", LAYOUT.campaigns, "measured.csv", campaign_text(campaign, model.robot).encode()),
        ("task", LAYOUT.tasks, "milling.toml", task),
        ("program", LAYOUT.programs, program.path.name, program.encode()),
    ]
