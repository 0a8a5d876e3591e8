"""The catalogue of robots that come with Taskcal, and loading a robot by name or file."""

from functools import cache
from importlib import resources
from pathlib import Path
from typing import Any

import tomli_w

from taskcal.errors import FileError, TaskcalError, UnknownName, shown
from taskcal.robot.importers.dh import describe_dh_table
from taskcal.robot.importers.ur import describe_calibration_conf, describe_kinematics_yaml
from taskcal.robot.importers.urdf import describe_tree, describe_urdf, parse_urdf_tree
from taskcal.robot.importers.xacro import expand_xacro, trusting_xacro
from taskcal.robot.robot import Robot
from taskcal.robot.robot_file import read_robot, robot_from

# Robots from files of other programs: which form a file has, and what a robot file says of the same robot.

URDF, XACRO, TABLE = (".urdf", ".xml"), (".xacro",), (".csv", ".txt")
UR_YAML, UR_CONF = (".yaml", ".yml"), (".conf",)
"""Endings of files, in small letters."""

WHOLE = (*URDF, *XACRO)
"""Of files that say by themselves all that there is to know."""

FORMS = (
    "URDF (.urdf), xacro (.xacro), a Denavit–Hartenberg table (.csv), and UR's kinematics (.yaml) and calibration.conf"
)

TAKEN = {
    URDF: ("tip", "base"),
    XACRO: ("tip", "base"),
    TABLE: ("convention", "units"),
    UR_YAML: (),
    UR_CONF: ("nominal",),
}
"""Options that a form has a use for."""


def describe_robot(
    path: str | Path,
    *,
    convention: str | None = None,
    tip: str | None = None,
    base: str | None = None,
    name: str | None = None,
    units: str | None = None,
    nominal: Robot | None = None,
) -> dict[str, Any]:
    """A robot file's content from a file of another form.

    Args:
        path: URDF or xacro, a table, or a file of Universal Robots.
        convention: of a table.
        tip: of a URDF: the link that is the tool; by default the end of its longest chain.
        base: of a URDF: the link that is the robot's base; the root by default.
        name: the robot's name; the one in the file, or the file's, by default.
        units: of a table whose columns do not state theirs, such as ``m,rad``.
        nominal: of a ``calibration.conf``: the robot to which its deltas are added.

    Raises:
        FileError: it is none of these, or wrong; or it lacks what it needs, or has no use for what was stated.
        UnknownName: a URDF has no such link.
    """
    path = Path(path)
    ending = path.suffix.lower()
    taken = next((options for endings, options in TAKEN.items() if ending in endings), None)
    if taken is None:
        raise FileError(path, f"has an ending that no robot's description has; Taskcal reads {FORMS}")
    stated = {"tip": tip, "base": base, "convention": convention, "units": units, "nominal": nominal}
    surplus = [option for option, value in stated.items() if value is not None and option not in taken]
    if surplus:
        raise FileError(path, f"has no use for --{surplus[0]}, by its ending {shown(ending, 20)}; leave it out")
    if ending in URDF:
        return describe_urdf(path, tip=tip, base=base, name=name)
    if ending in XACRO:
        return describe_tree(parse_urdf_tree(path, expand_xacro(path)), tip=tip, base=base, name=name)
    if ending in TABLE:
        if convention is None:
            raise FileError(path, "is a table; state its convention, --convention dh or --convention mdh")
        return describe_dh_table(path, convention, name, units)
    described = (
        describe_kinematics_yaml(path, name) if ending in UR_YAML else describe_calibration_conf(path, nominal, name)
    )
    try:
        robot_from(described)
    except TaskcalError as error:
        raise FileError(path, str(error)) from error
    return described


def robot_toml(described: dict[str, Any]) -> str:
    """The text of a robot file, as read by `taskcal.load_robot`."""
    return tomli_w.dumps(described)


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
