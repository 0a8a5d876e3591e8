"""The catalogue of robots that come with Taskcal, and loading a robot by name or file."""

from functools import cache
from importlib import resources
from pathlib import Path

from taskcal.errors import TaskcalError, UnknownName, shown
from taskcal.robot.description import UR_YAML, WHOLE, describe_robot
from taskcal.robot.file import read_robot, robot_from
from taskcal.robot.robot import Robot
from taskcal.robot.xacro import trusting_xacro


def _folder() -> Path:
    return Path(str(resources.files("taskcal.robot") / "catalogue"))


def catalogue_names() -> tuple[str, ...]:
    """Names of the robots in the catalogue."""
    return tuple(sorted(path.stem for path in _folder().glob("*.toml")))


@cache
def _catalogued(name: str) -> Robot:
    return read_robot(_folder() / f"{name}.toml")


def load_robot(
    source: str | Path, *, tip: str | None = None, base: str | None = None, trust_xacro: bool = False
) -> Robot:
    """A robot of the catalogue, of a robot file, or of a URDF.

    Args:
        source: a catalogue name, or the path of a robot file (``.toml``), of a URDF (``.urdf``) or of a xacro file
            (``.xacro``); behind a ``#`` the tip, as in ``cell.urdf#left_tool0``.
        tip: of a URDF: the link that is the tool; by default the end of its longest chain, ``tool0`` among several.
        base: of a URDF: the link that is the robot's base; the root by default.
        trust_xacro: whether a xacro file may read files outside its own folder and the environment, and run any code.

    Raises:
        UnknownName: neither the catalogue nor the disk has it, or a URDF has no such link.
        FileError: the file does not describe a robot.
    """
    if trust_xacro:
        with trusting_xacro():
            return load_robot(source, tip=tip, base=base)
    text = str(source)
    if text in catalogue_names():
        return _catalogued(text)
    path = Path(source)
    if "#" in text and not path.suffix.lower().endswith((".toml", *WHOLE)):
        text, _, link = text.rpartition("#")
        path, tip = Path(text), tip or link
    if path.suffix.lower() in (*WHOLE, *UR_YAML) and tip is None and base is None:
        return robot_from(describe_robot(path))
    if path.suffix.lower() in WHOLE:
        return robot_from(describe_robot(path, tip=tip, base=base))
    if tip is not None or base is not None:
        raise TaskcalError(f"'{shown(text)}' is not a URDF; only one of those has links to name as tip or base")
    if path.suffix == ".toml":
        return read_robot(path)
    if path.suffix == ".csv":
        raise TaskcalError(
            f"'{text}' is a table; make a robot file of it: taskcal robots import {text} --convention dh|mdh -o ROBOT.toml"
        )
    raise UnknownName("robot", text, catalogue_names(), "in the catalogue, nor a robot file (.toml, .urdf, .xacro)")
