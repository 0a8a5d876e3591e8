"""What the columns of a path in CSV mean."""

import re
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from taskcal.csv_table import CsvTable
from taskcal.errors import FileError
from taskcal.robot.robot import Robot

POSITION = ("x_mm", "y_mm", "z_mm")
QUATERNION = ("qx", "qy", "qz", "qw")
AXIS = ("i", "j", "k")
WORDS = ("id", "name", "move", "speed_mm_s", "stop", "tool", "frame")

_NUMBERED = re.compile(r"[jq](\d+)_(deg|rad|mm|m)$")
_UNITS = {"deg": np.pi / 180, "rad": 1.0, "mm": 1e-3, "m": 1.0}


@dataclass(frozen=True, kw_only=True)
class Columns:
    """Which columns a path has; names as the file writes them."""

    position: tuple[str, ...]
    """x, y, z; empty where the path has joint positions only."""
    rotation: tuple[str, ...]
    """Four of a quaternion, or three of the tool's axis."""
    joints: tuple[str, ...]
    """In the robot's order; empty where there are none."""
    joint_scale: tuple[float, ...]
    """What a joint's number is multiplied by for radians or metres."""
    words: Mapping[str, str]
    """The others: names in the file by their meaning."""

    @property
    def only_axis(self) -> bool:
        """The rotation about the tool's axis is left open."""
        return len(self.rotation) == 3

    @property
    def pose(self) -> tuple[str, ...]:
        """Those of a pose."""
        return self.position + self.rotation


def columns_of(table: CsvTable, robot: Robot | None) -> Columns:
    """The columns of a path.

    Raises:
        FileError: one is not known, is lacking, or its unit is not stated; two mean the same.
    """
    names: dict[str, str] = {}
    for name in table.header:
        if name.lower() in names:
            raise FileError(
                table.path, f"two columns are named '{name}' but for letter case; keep one", line=1, column=name
            )
        names[name.lower()] = name
    joints = _joints(table, names, robot)
    position = _all_or_none(table, names, POSITION)
    quaternion = _all_or_none(table, names, QUATERNION)
    axis = _all_or_none(table, names, AXIS)
    words = {word: names[word] for word in WORDS if word in names}
    used = {*position, *quaternion, *axis, *joints, *words.values()}
    unknown = [name for name in table.header if name not in used]
    if unknown:
        raise FileError(
            table.path,
            f"unknown column '{unknown[0]}'; a path has {' '.join(POSITION)} with {' '.join(QUATERNION)} or the tool axis "
            f"{' '.join(AXIS)}, or joints such as J1_deg, and optionally {', '.join(WORDS)}",
            line=1,
        )
    if quaternion and axis:
        raise FileError(table.path, "has both a quaternion and a tool axis; keep one of them", line=1)
    if position and not (quaternion or axis):
        raise FileError(
            table.path, "has positions without the tool's orientation; add qx qy qz qw, or the tool axis i j k", line=1
        )
    if (quaternion or axis) and not position:
        raise FileError(table.path, "has orientations without positions; add x_mm y_mm z_mm", line=1)
    if not position and not joints:
        raise FileError(table.path, "has neither positions x_mm y_mm z_mm nor joints such as J1_deg", line=1)
    return Columns(
        position=position,
        rotation=quaternion or axis,
        joints=joints,
        joint_scale=tuple(_UNITS[name.lower().rpartition("_")[2]] for name in joints),
        words=words,
    )


def _all_or_none(table: CsvTable, names: Mapping[str, str], wanted: tuple[str, ...]) -> tuple[str, ...]:
    found = tuple(names[name] for name in wanted if name in names)
    if found and len(found) < len(wanted):
        lacking = next(name for name in wanted if name not in names)
        raise FileError(table.path, f"has '{found[0]}' but no column '{lacking}'", line=1)
    for name in wanted:
        bare = name.removesuffix("_mm")
        if bare != name and bare in names and not found:
            raise FileError(
                table.path, f"the unit is not stated; name the column {bare}_mm", line=1, column=names[bare]
            )
    return found


def _joints(table: CsvTable, names: Mapping[str, str], robot: Robot | None) -> tuple[str, ...]:
    """The joints' columns in the robot's order, or in that of their numbers where no robot is known."""
    if robot is None:
        numbered = {int(match[1]): name for lower, name in names.items() if (match := _NUMBERED.match(lower))}
        lacking = [i for i in range(1, max(numbered, default=0) + 1) if i not in numbered]
        if lacking:
            raise FileError(table.path, f"has no column for joint {lacking[0]}, such as J{lacking[0]}_deg", line=1)
        return tuple(numbered[i] for i in sorted(numbered))
    found: list[str] = []
    without: list[str] = []
    for number, joint in enumerate(robot.joint_names, start=1):
        units = ("mm", "m") if robot.prismatic[number - 1] else ("deg", "rad")
        spellings = dict.fromkeys(s.lower() for s in (joint, f"J{number}", f"q{number}"))
        given = [names[f"{s}_{unit}"] for s in spellings for unit in units if f"{s}_{unit}" in names]
        if len(given) > 1:
            raise FileError(table.path, f"joint {joint} is given by '{given[0]}' and '{given[1]}'; keep one", line=1)
        found += given
        without += [] if given else [f"{joint}_{units[0]}"]
    if found and without:
        raise FileError(table.path, f"has '{found[0]}' but no column '{without[0]}' of {robot.name}", line=1)
    return tuple(found)


def numbers(table: CsvTable, columns: tuple[str, ...]) -> Float[np.ndarray, "rows columns"]:
    """The cells of some columns; NaN where one is empty."""
    if not columns:
        return np.empty((len(table), 0))
    return np.stack([table.numbers(name, empty=True) for name in columns], axis=1)
