"""A project: a folder of plain files, and which of them are being worked with."""

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tomli_w
from pydantic import AfterValidator, Field

from taskcal.errors import FileError
from taskcal.files import write_whole
from taskcal.programs.languages import LANGUAGES
from taskcal.studio.file_names import free_name, plain_name
from taskcal.toml_file import Section, read_toml


@dataclass(frozen=True, kw_only=True)
class Layout:
    """Which folder of a project holds what; each is made when something is put in it."""

    choices: str = "project.toml"
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

CAMPAIGN_ENDINGS = (".csv", ".txt", ".dat", ".tsv", ".log", ".xlsx")
URDF_ENDINGS = (".urdf", ".xacro")
ROBOT_ENDINGS = (".toml", *URDF_ENDINGS)
TABLE_ENDINGS = (".csv", ".txt")
"""Of tables of Denavit–Hartenberg parameters."""
CELL_ENDINGS = (".toml",)
TASK_ENDINGS = (".toml",)
STATION_ENDINGS = (".toml",)
RESULT = ".result.json"
"""Ending of what the command line said of a calibration, beside it."""

PROGRAM_ENDINGS = tuple(suffix for language in LANGUAGES for suffix in language.suffixes)


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
    """What is being worked with, as ``project.toml`` says it."""

    name: str = Field(min_length=1, max_length=200)
    robot: RobotName = ""
    campaign: ProjectFile = ""
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
        """As the file has them now; whoever edits it by hand is heard.

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
