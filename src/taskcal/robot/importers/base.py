"""Importers of robots: suffixes of the files, required options, and the description of a robot."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any


@dataclass(frozen=True, kw_only=True)
class RobotImporter:
    """Reads robots from files of another program."""

    name: str
    """What messages call such a file; no other importer has it."""
    suffixes: tuple[str, ...]
    """How its files end, in small letters; no other importer has any of them."""
    describe: Callable[[Path, Mapping[str, Any]], dict[str, Any]]
    """A robot file's content from a path and the options that were stated: the robot's ``name``, and those of `options`.

    Raises:
        FileError: the file is wrong, or lacks what it needs.
    """
    options: tuple[str, ...] = ()
    """Those of `taskcal.robot.catalogue.describe_robot` that it has a use for."""
    whole: bool = True
    """Whether a file says by itself all that there is to know, so that it stands for a robot."""
