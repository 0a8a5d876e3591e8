"""The catalogue of robots that come with Taskcal, and loading a robot by name or file."""

from functools import cache
from importlib import resources
from pathlib import Path
from typing import Any

import tomli_w

from taskcal.arguments import checked
from taskcal.errors import FileError, TaskcalError, UnknownName, shown
from taskcal.robot.importers import dh, mjcf, ur, urdf
from taskcal.robot.importers.base import RobotImporter
from taskcal.robot.importers.xacro import trusting_xacro
from taskcal.robot.robot import Robot
from taskcal.robot.robot_file import read_robot, robot_from
from taskcal_groundwork.plugins import load_plugins, state_faults

# Robots from files of other programs: which form a file has, and what a robot file says of the same robot.

GROUP = "taskcal.robot_importers"
"""Entry points of other packages: a `RobotImporter` each."""

_IMPORTERS: dict[str, RobotImporter] = {
    one.name: one for one in (urdf.URDF, urdf.XACRO, mjcf.MJCF, dh.DH_TABLE, ur.KINEMATICS, ur.CALIBRATION_CONF)
}


def importers() -> tuple[RobotImporter, ...]:
    """All of them, those of other packages behind Taskcal's own."""
    load_plugins(GROUP, RobotImporter, _IMPORTERS, lambda one: (one.name, *one.suffixes))
    return tuple(_IMPORTERS.values())


def _importer_of(path: Path) -> RobotImporter | None:
    return next((one for one in importers() if path.suffix.lower() in one.suffixes), None)


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
        path: URDF or xacro, a table, a file of Universal Robots, or one that another package reads.
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
    importer = _importer_of(path)
    if importer is None:
        known = ", ".join(f"{one.name} ({one.suffixes[0]})" for one in importers())
        message = f"has an ending that no robot's description has; Taskcal reads {known} {state_faults(GROUP)}"
        raise FileError(path, message.rstrip())
    given = {"tip": tip, "base": base, "convention": convention, "units": units, "nominal": nominal, "name": name}
    stated = {option: value for option, value in given.items() if value is not None}
    surplus = [option for option in stated if option not in (*importer.options, "name")]
    if surplus:
        ending = shown(path.suffix.lower(), 20)
        raise FileError(path, f"has no use for --{surplus[0]}, by its ending {ending}; leave it out")
    described = importer.describe(path, stated)
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


@cache
def catalogue_names() -> tuple[str, ...]:
    """Names of the robots in the catalogue."""
    return tuple(sorted(path.stem for path in _folder().glob("*.toml")))


@cache
def _catalogued(name: str) -> Robot:
    return read_robot(_folder() / f"{name}.toml")


def _joint(name: str, kind: str, *turns: tuple[str, float]) -> dict[str, Any]:
    """A joint of the free wrist, behind some turns of 90°."""
    limits = {"limits_mm": [-1e5, 1e5]} if kind == "prismatic" else {"limits_deg": [-360.0, 360.0]}
    return {"name": name, "type": kind, "steps": [{f"r{axis}_deg": angle} for axis, angle in turns], **limits}


FREE_WRIST: dict[str, Any] = {
    "name": "wrist",
    "title": "a wrist whose pose is given: three slides, then turns about z, y and x",
    "joint": [
        _joint("slide_x", "prismatic", ("y", 90.0)),
        _joint("slide_y", "prismatic", ("y", -90.0), ("x", -90.0)),
        _joint("slide_z", "prismatic", ("x", 90.0)),
        _joint("turn_z", "revolute"),
        _joint("turn_y", "revolute", ("x", -90.0)),
        _joint("turn_x", "revolute", ("x", 90.0), ("y", 90.0)),
    ],
    "tool": [{"ry_deg": -90.0}],
    "tolerance": {"translation_mm": 1e-6, "rotation_mrad": 1e-6},
}
"""No robot, but what moves as controllers write poses: its joints are a pose's numbers, and no geometry of it can be off."""


@checked
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
    if text == FREE_WRIST["name"]:
        return robot_from(FREE_WRIST)
    path = Path(source)
    linked = tuple(suffix for one in importers() if "tip" in one.options for suffix in one.suffixes)
    if "#" in text and not path.suffix.lower().endswith((".toml", *linked)):
        text, _, link = text.rpartition("#")
        path, tip = Path(text), tip or link
    importer = _importer_of(path)
    if importer is not None and importer.whole and ("tip" in importer.options or (tip is None and base is None)):
        return robot_from(describe_robot(path, tip=tip, base=base))
    if tip is not None or base is not None:
        raise TaskcalError(f"'{shown(text)}' is not a URDF; only one of those has links to name as tip or base")
    if path.suffix == ".toml":
        return read_robot(path)
    if importer is dh.DH_TABLE:
        raise TaskcalError(
            f"'{text}' is a table; make a robot file of it: taskcal robots import {text} --convention dh|mdh -o ROBOT.toml"
        )
    files = ", ".join((".toml", *(one.suffixes[0] for one in importers() if one.whole)))
    hint = f"in the catalogue, nor a robot file ({files}) {state_faults(GROUP)}"
    raise UnknownName("robot", text, catalogue_names(), hint.rstrip())
