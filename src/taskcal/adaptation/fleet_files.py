"""The calibrations and campaigns of many robots, as they lie in a folder: a folder for each robot, or a file for each."""

import os
from collections.abc import Generator, Iterable
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from taskcal.errors import FileError
from taskcal.text_file import read_bytes

CALIBRATION = ".json"
CAMPAIGNS = frozenset({".csv", ".tsv", ".txt", ".dat", ".log", ".xlsx", ".parquet"})
"""Endings of files that may be campaigns."""


@dataclass(frozen=True, kw_only=True)
class RobotFiles:
    """The files of one robot, relative to the fleet's folder."""

    robot: str
    """The first folder below the fleet's, or the name of a file that lies in that itself."""
    calibrations: tuple[str, ...]
    campaigns: tuple[str, ...]


@dataclass(frozen=True, kw_only=True)
class FleetFiles:
    """All files of a fleet."""

    folder: Path
    robots: tuple[RobotFiles, ...]
    """By name."""
    others: tuple[str, ...]
    """Files that are neither, by their endings."""


@dataclass(frozen=True, kw_only=True)
class SentFile:
    """A file's name and content, for a machine that may not see the folder."""

    name: str
    content: bytes


def find_fleet(folder: str | Path) -> FleetFiles:
    """Look through a folder and all below it, but for those that are hidden.

    Raises:
        FileError: there is no such folder.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise FileError(folder, "is not a folder; name one with a folder, or a calibration, for each robot")
    calibrations: dict[str, list[str]] = {}
    campaigns: dict[str, list[str]] = {}
    others: list[str] = []
    for name in sorted(_names(folder)):
        path = Path(name)
        robot = path.parts[0] if len(path.parts) > 1 else path.stem
        suffix = path.suffix.lower()
        if suffix == CALIBRATION:
            calibrations.setdefault(robot, []).append(name)
        elif suffix in CAMPAIGNS:
            campaigns.setdefault(robot, []).append(name)
        else:
            others.append(name)
    robots = (
        RobotFiles(
            robot=robot,
            calibrations=tuple(calibrations.get(robot, ())),
            campaigns=tuple(campaigns.get(robot, ())),
        )
        for robot in sorted({*calibrations, *campaigns})
    )
    return FleetFiles(folder=folder, robots=tuple(robots), others=tuple(others))


def _names(folder: Path) -> Generator[str, None, None]:
    """Of all files, relative to the folder, with slashes."""
    for place, folders, files in os.walk(folder):
        folders[:] = [name for name in folders if not name.startswith(".")]
        for name in files:
            if not name.startswith("."):
                yield (Path(place) / name).relative_to(folder).as_posix()


def read_file(folder: Path, name: str) -> SentFile:
    """A file to be sent.

    Raises:
        FileError: it cannot be read.
    """
    return SentFile(name=name, content=read_bytes(folder / name))


@contextmanager
def laid_out(files: Iterable[SentFile]) -> Generator[Path, None, None]:
    """A folder in which files that were sent lie as they did, for as long as they are read.

    Raises:
        FileError: there is no room for them.
    """
    with TemporaryDirectory(prefix="taskcal-fleet-") as name:
        folder = Path(name)
        for file in files:
            path = folder / file.name
            try:
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_bytes(file.content)
            except OSError as error:
                message = f"cannot be copied to {folder}: {error.strerror or error}; name a folder with room in TMPDIR"
                raise FileError(file.name, message) from error
        yield folder


def reason_of(refusal: Exception, folder: Path) -> str:
    """What a refusal says of a file in a folder, with the file's name in the fleet's."""
    return str(refusal).replace(f"{folder}{os.sep}", "")
