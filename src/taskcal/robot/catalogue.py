"""The catalogue of robots that come with Taskcal, and loading a robot by name or file."""

from functools import cache
from importlib import resources
from pathlib import Path

from taskcal.errors import TaskcalError, UnknownName
from taskcal.robot.file import read_robot
from taskcal.robot.robot import Robot


def _folder() -> Path:
    return Path(str(resources.files("taskcal.robot") / "catalogue"))


def catalogue_names() -> tuple[str, ...]:
    """Names of the robots in the catalogue."""
    return tuple(sorted(path.stem for path in _folder().glob("*.toml")))


@cache
def _catalogued(name: str) -> Robot:
    return read_robot(_folder() / f"{name}.toml")


def load_robot(source: str | Path) -> Robot:
    """A robot of the catalogue, or of a robot file.

    Args:
        source: a catalogue name, or the path of a ``.toml`` robot file.

    Raises:
        UnknownName: neither the catalogue nor the disk has it.
        FileError: the file does not describe a robot.
    """
    text = str(source)
    if text in catalogue_names():
        return _catalogued(text)
    path = Path(source)
    if path.suffix == ".toml":
        return read_robot(path)
    if path.suffix == ".csv":
        raise TaskcalError(
            f"'{text}' is a table; make a robot file of it: taskcal robots import {text} --convention dh|mdh -o ROBOT.toml"
        )
    raise UnknownName("robot", text, catalogue_names(), "in the catalogue, nor a robot file (.toml)")
