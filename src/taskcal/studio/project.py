"""A project: a folder of plain files, and which of them are being worked with."""

import json
import os
import re
import sys
import unicodedata
from collections.abc import Collection, Iterable
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import IO, Annotated

import tomli_w
from pydantic import AfterValidator, Field

from robot_programs.core.files import elsewhere_on_windows
from robot_programs.languages import languages
from taskcal.errors import FileError, TaskcalError, shown
from taskcal.io.files import write_whole
from taskcal.io.toml_file import Section, read_toml
from taskcal.tables.forms import table_suffixes

# Names for files that somebody drops: made from the name that came with them, which is never used as a path itself.

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
    stem, dot, ending = wanted.rpartition(".")
    number = 2
    while f"{stem}-{number}{dot}{ending}".casefold() in used:
        number += 1
    return f"{stem}-{number}{dot}{ending}"


@dataclass(frozen=True, kw_only=True)
class Layout:
    """Folders of a project; each is made when its first file is written."""

    choices: str = "project.toml"
    header: str = "header.toml"
    """Who measured what, where and with what."""
    made: str = "made.json"
    """From what each result was made."""
    robots: str = "robots"
    campaigns: str = "campaigns"
    tasks: str = "tasks"
    stations: str = "stations"
    plans: str = "plans"
    calibrations: str = "calibrations"
    programs: str = "programs"
    cells: str = "cells"
    corrected: str = "corrected"
    reports: str = "reports"


LAYOUT = Layout()

CAMPAIGN_ENDINGS = table_suffixes()
URDF_ENDINGS = (".urdf", ".xacro")
ROBOT_ENDINGS = (".toml", *URDF_ENDINGS)
TABLE_ENDINGS = (".csv", ".txt")
"""Of tables of Denavit–Hartenberg parameters."""
CELL_ENDINGS = (".toml",)
TASK_ENDINGS = (".toml",)
STATION_ENDINGS = (".toml",)
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


class Choices(Section):
    """Current choices of a project, as in ``project.toml``."""

    name: str = Field(min_length=1, max_length=200)
    robot: RobotName = ""
    campaign: ProjectFile = ""
    points: ProjectFile = ""
    """A second file, with the points of a campaign that has joints alone, until both are joined."""
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
    accept_uncertain: bool = False
    """Whether a program is written that is corrected by less than its uncertainty."""
    effects: str = "none"
    holdout: float = Field(default=0.3, ge=0.0, lt=1.0)
    seed: int = Field(default=0, ge=0)
    poses: int = Field(default=60, ge=1, le=2000)
    """To be planned."""
    robust: bool = False
    """Whether outliers count less."""
    fit_name: str = Field(default="", max_length=LONGEST)
    """Of the next calibration; empty for one made of its campaign and its model."""
    notes: dict[ProjectFile, Annotated[str, Field(max_length=2000)]] = Field(default_factory=dict, max_length=1000)
    """On calibrations, by their paths."""


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
        if not self._file.exists():
            write_whole(self._file, tomli_w.dumps(Choices(name=self.folder.name or "project").model_dump()))

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
        choices = Choices.model_validate({**self.choices.model_dump(), **changed})
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
            write_whole(self.path(f"{folder}/{name}"), content)
        return f"{folder}/{name}"


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
        if not _take(self._stream):
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


if sys.platform == "win32":
    import msvcrt

    def _take(stream: IO[str]) -> bool:
        """Lock a byte far behind the text, so that others can read who has it."""
        stream.seek(1 << 30)
        try:
            msvcrt.locking(stream.fileno(), msvcrt.LK_NBLCK, 1)
        except OSError:
            return False
        return True
else:
    import fcntl

    def _take(stream: IO[str]) -> bool:
        try:
            fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            return False
        return True


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
    return project


def _contents() -> list[tuple[str, str, str, bytes]]:
    """Choice, folder, name and content of every file."""
    # what they need takes a second to import, and a project that is there already needs nothing of it
    from math import radians

    import numpy as np

    from taskcal.demo.milling import milling_program
    from taskcal.demo.procedure import reference_task
    from taskcal.reading.writer import campaign_text
    from taskcal.robot.catalogue import load_robot
    from taskcal.robot.error_model import ErrorModel
    from taskcal.task.task import reach_task
    from taskcal.virtual.cell import simulate

    model = ErrorModel(load_robot(ROBOT))
    poses = reach_task(model, reference_task(radians(20.0)), POSES)
    campaign, _ = simulate(model, poses.q, rng=np.random.default_rng(0))
    program = milling_program(model.robot, reference_task(), rows=6).source
    task = (resources.files("taskcal.demo") / "reference-task.toml").read_bytes()
    return [
        ("campaign", LAYOUT.campaigns, "measured.csv", campaign_text(campaign, model.robot).encode()),
        ("task", LAYOUT.tasks, "milling.toml", task),
        ("program", LAYOUT.programs, program.path.name, program.encode()),
    ]
